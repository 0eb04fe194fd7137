"""The same mission inside worlds of 10, 1,000 and 100,000 locales: what it touches, how long it thinks, what it holds.

Everybody else's way stands beside it: the flat graph of all doorways in networkx, and a shortest path on it.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from harvey.experiments.report import Cell, Report
from harvey.experiments.world_size_campus import Made, make_campus

SIZES, QUICK_SIZES = (12, 1_000, 100_000), (12, 1_000)
STARTS, QUICK_STARTS = 20, 3
PLANS, QUICK_PLANS = 25, 4
RATIO, MEMORY_MB, OPEN_MS = 1.1, 50.0, 100.0
LONG = "(ptrans (robot-laboratory (16,2,0)) (allens-office (13,12,0)))"
SHORT = "(ptrans (hallway (66,4,0)) (allens-office (6,5,0)))"
COLUMNS = ("locales", "faces", "file MB", "open ms", "first action ms", "sketching ms", "mission MB", "frames touched",
           "decisions", "same journal", "far route ms", "networkx load ms", "its path ms", "its MB")


def run(quick: bool, seed: int) -> Report:
    """Worlds are made once and kept in the temporary folder; the worlds' runs are interleaved."""
    folder = Path(tempfile.gettempdir()) / "harvey-worlds-1"
    worlds = [make_campus(size, folder) for size in (QUICK_SIZES if quick else SIZES)]
    starts, plans = (QUICK_STARTS, QUICK_PLANS) if quick else (STARTS, PLANS)
    with ExitStack() as stack:
        probes = [stack.enter_context(_Probe(world, SHORT if quick else LONG, seed)) for world in worlds]
        told = _interleaved(probes, ["start"] * starts + ["plan"] * plans + ["drive", "memory"])
    flats = [_flat(world) for world in worlds]
    rows = tuple(_row(world, answers, told[0], flat) for world, answers, flat in zip(worlds, told, flats, strict=True))
    return Report(
        "The same mission in worlds of any size", COLUMNS, rows,
        notes=(
            f"Mission: {SHORT if quick else LONG}, seed {seed}. Worlds are run in turn, each in a process of its own:"
            f" {starts} starts and {plans} times the mission in thought, each with a new mind and the file opened anew,"
            " and the mission driven; times are the least, and of the processor, so that others' work counts less.",
            "open: the world's file; first action: from the command to the first motor command, perception included;"
            " sketching: all acts of the sketcher and the milestone selector, reading the frames included.",
            "far route: from the laboratory to the last locale of the world, refined down to rooms at both ends.",
            "networkx: one process reads every locale and passage from the same file into a Graph and asks for"
            " shortest_path to that locale.",
            *(_compared(row, rows[0]) for row in rows[1:]),
        ),
        claims=tuple(claim for answers, row in zip(told[1:], rows[1:], strict=True)
                     for claim in _claims(answers, row, told[0], rows[0])),
    )


class _Probe:
    """A process that runs missions in one world when it is told to."""

    def __init__(self, world: Made, goal: str, seed: int) -> None:
        self._command = [sys.executable, "-m", "harvey.experiments.world_size_probe", str(world.path), goal, str(seed)]

    def __enter__(self) -> _Probe:
        self._process = subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def ask(self, what: str) -> dict[str, Any]:
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(what + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"{' '.join(self._command)}: expected an answer to {what!r}, got none")
        answer: dict[str, Any] = json.loads(line)
        return answer


def _interleaved(probes: Sequence[_Probe], wishes: Sequence[str]) -> list[dict[str, list[dict[str, Any]]]]:
    """For each probe and wish the answers; one probe works at a time, and each in turn goes first."""
    told: list[dict[str, list[dict[str, Any]]]] = [{} for _ in probes]
    with tqdm(total=len(wishes) * len(probes), file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:
        for turn, wish in enumerate(wishes):
            for step in range(len(probes)):
                index = (turn + step) % len(probes)
                told[index].setdefault(wish, []).append(probes[index].ask(wish))
                bar.update()
    return told


def _flat(world: Made) -> dict[str, Any]:
    command = [sys.executable, "-m", "harvey.experiments.world_size_flat", str(world.path)]
    answer: dict[str, Any] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return answer


Answers = dict[str, list[dict[str, Any]]]


def _least(answers: Sequence[dict[str, Any]], what: str) -> float:
    return float(min(answer[what] for answer in answers))


def _steps(answers: Answers) -> NDArray[np.float64]:
    """The least time of each later act of sketcher and milestone selector [ms]."""
    steps: NDArray[np.float64] = np.min([plan["steps_ms"] for plan in answers["plan"]], axis=0)
    return steps


def _row(world: Made, answers: Answers, small: Answers, flat: dict[str, Any]) -> tuple[Cell, ...]:
    drive, memory = answers["drive"][0], answers["memory"][0]
    return (
        world.locales, world.faces, world.path.stat().st_size / 1e6, _least(answers["start"], "open_ms"),
        _least(answers["start"], "first_ms"), float(np.sum(_steps(answers))), memory["mb"], drive["touched"],
        drive["decisions"], "yes" if drive["journal"] == small["drive"][0]["journal"] else "NO",
        _least(answers["start"], "far_ms"), flat["load_ms"], flat["path_ms"], flat["mb"],
    )


def _worst_step(answers: Answers, small: Answers) -> float:
    """The largest ratio among acts of 2 ms and more, whose least times are not those of the clock."""
    mine, theirs = _steps(answers), _steps(small)
    return float(np.max(np.where(theirs >= 2.0, mine / theirs, 1.0))) if len(mine) == len(theirs) else float("inf")


def _compared(row: Sequence[Cell], small: Sequence[Cell]) -> str:
    first, sketching = (float(str(row[i])) / float(str(small[i])) for i in (4, 5))
    return (f"{row[0]} locales against {small[0]}: first action {first:.3f} x, sketching {sketching:.3f} x,"
            f" memory {float(str(row[6])) - float(str(small[6])):+.1f} MB.")


def _claims(answers: Answers, row: Sequence[Cell], small: Answers, small_row: Sequence[Cell]
            ) -> list[tuple[str, bool]]:
    size = f"{row[0]} locales"
    first = _least(answers["start"], "first_ms") / _least(small["start"], "first_ms")
    worst = _worst_step(answers, small)
    touched = [drive["frames"] for drive in answers["drive"]] == [drive["frames"] for drive in small["drive"]]
    return [
        (f"{size}: the same journal, and the same frames touched", row[9] == "yes" and touched),
        (f"{size}: first action within {RATIO} x the small world's ({first:.3f})", first <= RATIO),
        (f"{size}: later sketch steps together within {RATIO} x",
         float(np.sum(_steps(answers))) <= RATIO * float(np.sum(_steps(small)))),
        (f"{size}: each later sketch step within {RATIO} x (worst {worst:.3f})", worst <= RATIO),
        (f"{size}: memory within {MEMORY_MB:.0f} MB", float(str(row[6])) - float(str(small_row[6])) <= MEMORY_MB),
        (f"{size}: opened in less than {OPEN_MS:.0f} ms", float(str(row[3])) < OPEN_MS),
    ]
