"""The live page: what fifty watchers cost a mission, what one that reads nothing does, what hostile requests can do."""

from __future__ import annotations

import json
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from experiments.report import Cell, Report
from harvey.runner.teller import find_page
from harvey.simulation.simulated_run import build_head, run_mission
from harvey_serve import watcher_clients
from sim.scenario import load_scenario
from sim.stage import Stage, build_stage

SCENARIO, QUICK_SCENARIO = "lab-to-allens-office", "forty-foot-hallway"
WATCHERS, PAIRS, QUICK_PAIRS = 50, 5, 1
REQUESTS = 10_000
MOST_COST = 1.10
COLUMNS = ("what", "required", "ours")


@dataclass
class _Drive:
    """One mission: its wall and processor time [s], its journal, and what its clients tell."""

    wall_s: float
    processor_s: float
    journal: bytes
    state: str
    clients: list[dict[str, Any]] = field(default_factory=list)


def run(quick: bool, seed: int) -> Report:
    """Drive the same mission without a page, with it, with watchers, with one that does not read, and under attack."""
    stage = build_stage(load_scenario(QUICK_SCENARIO if quick else SCENARIO))
    with TemporaryDirectory() as folder:
        bench = _Bench(stage, seed, Path(folder))
        bench.drive([])  # compiled, and in memory, before it counts
        pairs = [(bench.drive(None), bench.drive([("watch", WATCHERS)]))
                 for _ in range(QUICK_PAIRS if quick else PAIRS)]
        stalled = bench.drive([("stall", 1)])
        attacked = bench.drive([("attack", REQUESTS)])
    alone, watched = [one for one, _ in pairs], [one for _, one in pairs]
    cost = statistics.median(two.wall_s / one.wall_s for one, two in pairs)
    stall = stalled.wall_s / statistics.median(one.wall_s for one in alone)
    told = [client for one in watched for client in one.clients]
    answers: dict[str, int] = attacked.clients[0]["answers"]
    errors = sum(count for status, count in answers.items() if status.startswith("5"))
    rows: tuple[tuple[Cell, ...], ...] = (
        ("mission alone, wall time, median [s]", None, statistics.median(one.wall_s for one in alone)),
        (f"with {WATCHERS} watchers [s]", None, statistics.median(one.wall_s for one in watched)),
        (f"ratio, median of {len(pairs)} pairs", MOST_COST, cost),
        ("ratio of processor time, the page's included", None,
         statistics.median(two.processor_s / one.processor_s for one, two in pairs)),
        ("messages a watcher got, a second, mean", None, statistics.fmean(client["rate"] for client in told)),
        ("MB sent a second, mean", None,
         statistics.fmean(sum(client["mb"] for client in one.clients) / one.wall_s for one in watched)),
        ("ratio with one watcher that reads nothing", None, stall),
        *((f"hostile requests answered by {status}", None, count) for status, count in sorted(answers.items())),
    )
    same = all(one.journal == alone[0].journal for one in (*alone, *watched, stalled, attacked))
    claims = (
        ("the same decisions, byte for byte, in every drive", same),
        (f"{WATCHERS} watchers cost at most {MOST_COST - 1:.0%} of the mission's time", cost <= MOST_COST),
        (f"{REQUESTS} hostile requests: none answered by an error of the server, none heeded",
         sum(answers.values()) == REQUESTS and errors == 0 and attacked.state == "running"),
    )
    return Report("What watching costs", COLUMNS, rows, NOTES, claims)


NOTES = (
    "Wall times of a mission that waits for nothing (--speed 0): the worst case, as at the robot's own speed it waits"
    " most of the time. Drives alone and watched alternate. The watchers are one other process.",
    "Hostile: without the token or with a wrong one, of other origins and hosts, of odd methods, paths and bodies, and"
    " bytes that are no request; drawn from the seed. 'closed': the server hung up, as it may.",
    "On a busy machine the ratio says little: it needs two quiet cores.",
)


class _Bench:
    """Drives one mission again and again."""

    def __init__(self, stage: Stage, seed: int, folder: Path) -> None:
        self._stage, self._seed, self._folder, self._count = stage, seed, folder, 0

    def drive(self, clients: Sequence[tuple[str, int]] | None) -> _Drive:
        """``clients``: what each kind does and how many; None: without a page."""
        self._count += 1
        out = self._folder / str(self._count)
        if clients is None:
            began, spent = time.perf_counter(), time.process_time()
            run_mission(self._stage, self._seed, out=out)
            return _Drive(time.perf_counter() - began, time.process_time() - spent, _journal(out), "")
        return self._drive_served(clients, out)

    def _drive_served(self, clients: Sequence[tuple[str, int]], out: Path) -> _Drive:
        head = build_head(self._stage, self._seed)
        port = find_free_port()
        with (find_page("watchers").serve(port, head.load_world(), head.model(head.load_world()).lens, "a run",
                                          token="a-token", part=self._stage.part) as page,
              _clients(clients, port, self._seed) as processes):
            began, spent = time.perf_counter(), time.process_time()
            run_mission(self._stage, self._seed, out=out, sinks=(page.live,), head=head, tell=page.teller.tell,
                        around=lambda body, _replayed: page.guard(body))
            wall_s, processor_s, state = time.perf_counter() - began, time.process_time() - spent, page.gate.state
            ends = [what == "attack" for what, _ in clients]
            told = [json.loads(one.communicate()[0]) for one, by_itself in zip(processes, ends, strict=True)
                    if by_itself]
            page.live.end("over")
            told += [json.loads(one.communicate()[0]) for one, by_itself in zip(processes, ends, strict=True)
                     if not by_itself]
            state = page.gate.state if state == "running" else state
        return _Drive(wall_s, processor_s, _journal(out), state, [one for client in told for one in client])


def find_free_port() -> int:
    """A port of this machine that nobody uses now."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port: int = listening.getsockname()[1]
        return port


@contextmanager
def _clients(clients: Sequence[tuple[str, int]], port: int, seed: int) -> Iterator[list[subprocess.Popen[str]]]:
    """Processes of clients that are connected; each tells at its end, as JSON, what it got."""
    processes = [
        subprocess.Popen([sys.executable, "-m", watcher_clients.__name__, what, str(port), str(count), str(seed)],
                         stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True)
        for what, count in clients]
    try:
        for process in processes:
            assert process.stdout is not None
            process.stdout.readline()  # it is ready
        yield processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _journal(out: Path) -> bytes:
    return (out / "journal.jsonl").read_bytes()
