"""Crash safety: missions are killed (SIGKILL) at random moments and resumed; nothing may be lost, all must arrive.

Three claims: every motor command that reached the body stands in the journal, and none reached it twice; a resumed run
reaches its goal; its whole journal, the crash included, is decided again byte for byte.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from experiments.report import Cell, Report
from experiments.trials import campaign_folder, found_by_all
from harvey.run_files.records import read_records
from harvey.simulation.body_replay import interrupted_in
from sim.made_up.short_missions import HALLWAY, OFFICE, fault

CHILD = (sys.executable, "-m", "experiments.robustness.crash_child")
MOST_S = 600.0
"""A child that takes longer than this hangs [s]."""
CYCLE_S = 0.06
"""A kill falls up to so long after a decision: about what a cycle takes."""
RETELLING_S = 12.0
"""A kill of a process that resumes falls up to so long after its start."""
TEXTS: Mapping[str, str] = {
    "office": OFFICE,
    "hallway": HALLWAY,
    "hallway, bumped": HALLWAY + fault("bump", "hallway", 7.0, left_m=0.3, turn_deg=10.0),
    "hallway, dark": HALLWAY + fault("lights_off", "hallway", 5.0, duration_s=8.0),
    "hallway, link lost": HALLWAY + fault("link_lost", "hallway", 6.0, duration_s=4.0),
}
MAIN = "lab-to-allens-office"
FULL: Mapping[str, int] = {"office": 100, "hallway": 30, "hallway, bumped": 30, "hallway, dark": 15,
                           "hallway, link lost": 15, MAIN: 10}
QUICK: Mapping[str, int] = {"office": 3}
DECISIONS: Mapping[str, int] = {"office": 45, "hallway": 120, "hallway, bumped": 130, "hallway, dark": 120,
                                "hallway, link lost": 120, MAIN: 440}
"""About how many decisions a mission takes: a kill falls after one of them."""


@dataclass(frozen=True, slots=True)
class Trial:
    """What to kill, and when.

    Attributes:
        number: of the trial; with the experiment's seed it gives all chance.
        seed: of the mission.
        after: decisions before the first kill; delay_s: between the last of them and the kill.
        again_s: seconds from the start of the process that resumes to a second kill; None for none.
    """

    number: int
    scenario: str
    seed: int
    after: int
    delay_s: float
    again_s: float | None


@dataclass(frozen=True, slots=True)
class Found:
    """What came of a trial.

    Attributes:
        kills: how many processes were killed before they ended.
        in_motion: how many motor commands were broken off.
        wrong: what was lost, done twice or otherwise not as it must be; "" for nothing.
        outcome, error_m: of the mission.
        seconds: wall-clock time.
    """

    number: int
    scenario: str
    kills: int
    in_motion: int
    wrong: str
    outcome: str
    error_m: float
    seconds: float


def run(quick: bool, seed: int) -> Report:
    """Kill and resume; what is done is kept, so that the experiment itself may be cut off."""
    trials = list(_trials(QUICK if quick else FULL, seed))
    folder = campaign_folder("crash", seed, quick=quick)
    found = found_by_all(partial(_tried, folder=folder), trials, Found, folder)
    names = list(dict.fromkeys(trial.scenario for trial in trials))
    rows = [_row(name, [f for f in found if f.scenario == name]) for name in names]
    killed = sum(f.kills for f in found)
    failed = [f"trial {f.number} ({f.scenario}): {f.wrong or f.outcome}; kept in {folder / str(f.number)}"
              for f in found if f.wrong or f.outcome != "reached"]
    return Report(
        "Missions that are killed at random moments and resumed",
        ("scenario", "missions", "kills", "in motion", "nothing lost", "reached", "worst mm", "seconds"), tuple(rows),
        notes=(
            f"Trials 0 to {len(trials) - 1} of seed {seed}: SIGKILL after a random decision and up to {CYCLE_S} s; in "
            f"one of four a second one, up to {RETELLING_S:.0f} s after the start of the process that resumes.",
            "in motion: motor commands that were written down and not yet reported on; they are not carried out again.",
            "nothing lost: what reached the body, by its own memory, is in the journal, once; and the whole journal is "
            "decided again byte for byte.",
            *failed,
        ),
        claims=(
            (f"{killed} kills: nothing acknowledged is lost, nothing done twice", not any(f.wrong for f in found)),
            ("every resumed run reaches its goal", all(f.outcome == "reached" for f in found)),
        ),
    )


def _trials(shares: Mapping[str, int], seed: int) -> Iterator[Trial]:
    """Scenarios in a drawn order, so that what is done when the experiment is cut off is a fair part of it."""
    names = [name for name, share in shares.items() for _ in range(share)]
    order = np.random.default_rng(seed).permutation(len(names))
    for number, name in enumerate(names[i] for i in order):
        rng = np.random.default_rng([seed, number])
        after = int(rng.integers(0, DECISIONS[name]))
        delay_s = float(rng.uniform(0.0, CYCLE_S))
        again_s = float(rng.uniform(2.0, RETELLING_S)) if rng.random() < 0.25 else None
        yield Trial(number, name, number, after, delay_s, again_s)


def _row(name: str, found: Sequence[Found]) -> tuple[Cell, ...]:
    return (
        name, len(found), sum(f.kills for f in found), sum(f.in_motion for f in found),
        sum(1 for f in found if not f.wrong), sum(1 for f in found if f.outcome == "reached"),
        1000.0 * max(f.error_m for f in found), float(np.sum([f.seconds for f in found])),
    )


def _tried(trial: Trial, folder: Path) -> Found:
    """One trial; its files are kept where something is wrong."""
    began, place = time.perf_counter(), folder / str(trial.number)
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    out, memories = place / "run", [place / "memory-0.jsonl"]
    kills = _killed_run(trial, place, memories[0])
    if trial.again_s is not None:
        memories.append(place / f"memory-{len(memories)}.jsonl")
        kills += _killed_after((*CHILD, "resume", str(out), str(memories[-1])), trial.again_s)
    memories.append(place / f"memory-{len(memories)}.jsonl")
    done = subprocess.run((*CHILD, "resume", str(out), str(memories[-1])), capture_output=True, text=True, check=False,
                          timeout=MOST_S)
    seconds = time.perf_counter() - began
    if done.returncode:
        return Found(trial.number, trial.scenario, kills, 0, done.stderr[-400:] or "no result", "none", 0.0, seconds)
    result = json.loads(done.stdout.splitlines()[-1])
    broken_off, wrong = _compared(out / "journal.jsonl", memories)
    wrong = wrong or ("" if result["same"] else "the journal is not decided again as it stands")
    if not wrong and result["outcome"] == "reached":
        shutil.rmtree(place)
    return Found(trial.number, trial.scenario, kills, broken_off, wrong, result["outcome"], result["error_m"], seconds)


def _killed_run(trial: Trial, place: Path, memory: Path) -> int:
    scenario = trial.scenario
    if scenario in TEXTS:
        scenario = str(place / "scenario.toml")
        Path(scenario).write_text(TEXTS[trial.scenario], encoding="utf-8")
    journal = place / "run" / "journal.jsonl"
    with subprocess.Popen((*CHILD, "run", scenario, str(trial.seed), str(place / "run"), str(memory)),
                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as child:
        while child.poll() is None and _lines(journal) < max(trial.after, 0):
            time.sleep(0.002)
        while child.poll() is None and not journal.exists():
            time.sleep(0.002)
        time.sleep(trial.delay_s)
        running = child.poll() is None
        child.kill()
    return int(running)


def _killed_after(command: Sequence[str], seconds: float) -> int:
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as child:
        try:
            child.wait(seconds)
        except subprocess.TimeoutExpired:
            child.kill()
            return 1
    return 0


def _lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


def _compared(journal: Path, memories: Sequence[Path]) -> tuple[int, str]:
    """How many commands were broken off, and what the journal and the body's memory do not agree on."""
    commands: list[tuple[str, list[float]]] = []
    broken_off: set[str] = set()
    for decision in read_records(journal):
        broken_off |= interrupted_in(decision.observed)
        commands += [(record.ref, [record.value["turn_rad"], record.value["move_m"]])
                     for record in decision.made if record.type == "MotorCommand"]
    lines = (line for memory in memories if memory.exists() for line in memory.read_text("utf-8").splitlines())
    done = [item["begun"] for item in map(json.loads, lines) if "begun" in item]
    return len(broken_off), _disagreement(commands, frozenset(broken_off), done)


def _disagreement(
    commands: Sequence[tuple[str, list[float]]], excused: frozenset[str], done: Sequence[list[float]]
) -> str:
    """Each command that was done is written down, in order and once; each other one was broken off before it began."""
    written = iter(commands)
    for command in done:
        for ref, what in written:
            if what == command:
                break
            if ref not in excused:
                return f"{ref} stands in the journal, but never reached the body"
        else:
            return f"the command {command} reached the body, but is not in the journal, or was done twice"
    left = [ref for ref, _ in written if ref not in excused]
    return f"{left[0]} stands in the journal, but never reached the body" if left else ""
