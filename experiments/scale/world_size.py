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
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from experiments.report import Cell, Report
from experiments.scale.world_size_campus import Made, make_campus

SIZES, QUICK_SIZES = (12, 1_000, 100_000), (12, 1_000)
OPENINGS, QUICK_OPENINGS = 20, 3
STARTS, QUICK_STARTS = 40, 5
PLANS, QUICK_PLANS = 40, 5
SHORTEST_MS = 0.5
"""A step whose least time is below this is no longer than what clock and machine add to it."""
RATIO, MEMORY_MB, OPEN_MS = 1.1, 50.0, 100.0
LONG = "(ptrans (robot-laboratory (16,2,0)) (allens-office (13,12,0)))"
SHORT = "(ptrans (hallway (66,4,0)) (allens-office (6,5,0)))"
COLUMNS = ("locales", "faces", "file MB", "open ms", "first action ms", "sketching ms", "mission MB", "frames touched",
           "decisions", "same journal", "far route ms", "networkx load ms", "networkx path ms",
           "networkx MB")


def run(quick: bool, seed: int) -> Report:
    """Worlds are made once and kept in the temporary folder; their missions are thought of in turn."""
    folder = Path(tempfile.gettempdir()) / "harvey-worlds-1"
    worlds = [make_campus(size, folder) for size in (QUICK_SIZES if quick else SIZES)]
    goal = SHORT if quick else LONG
    repetitions = (QUICK_STARTS, QUICK_PLANS) if quick else (STARTS, PLANS)
    again, *times = _in_lockstep([worlds[0], *worlds], goal, seed, repetitions)
    openings = QUICK_OPENINGS if quick else OPENINGS
    with ExitStack() as stack:
        probes = [stack.enter_context(_Probe(world, goal, seed)) for world in worlds]
        told = _interleaved(probes, ["open"] * openings + ["drive", "memory"])
    flats = [_flat(world) for world in worlds]
    rows = tuple(_row(*each, told[0]) for each in zip(worlds, told, times, flats, strict=True))
    return Report(
        "The same mission in worlds of any size", COLUMNS, rows,
        notes=(
            f"Mission: {goal}, seed {seed}. Times are of the processor. In one process the agents in all worlds decide"
            f" in turn, each with the file opened anew: {repetitions[0]} times to the first motor command and"
            f" {repetitions[1]} times the whole mission in thought. What is compared are the times of one repetition,"
            " taken within moments of each other, and told is the median of these ratios, so that others' work on the"
            " machine counts less. In the table is the least time of each decision.",
            "open: the world's file; first action: from the command to the first motor command, perception included;"
            " sketching: all acts of the sketcher and the milestone selector, reading the frames included.",
            "mission MB: the most that a process held in which the mission was driven and the world opened"
            f" {openings} times.",
            "far route: from the laboratory to the last locale of the world, refined down to rooms at both ends.",
            "networkx: one process reads every locale and passage from the same file into a Graph and asks for"
            " shortest_path to that locale.",
            f"The smallest world against itself: first action {again.first(times[0]):.3f} x, sketching"
            f" {again.sketching(times[0]):.3f} x, worst step {again.worst(times[0]):.3f} x: what the machine adds.",
        ),
        claims=tuple(claim for each in zip(told[1:], times[1:], rows[1:], strict=True)
                     for claim in _claims(*each, told[0], times[0], rows[0])),
    )


@dataclass(frozen=True, eq=False, slots=True)
class _Times:
    """Of each repetition the time of each decision up to the first motor command, and of each sketch step [ms]."""

    decisions_ms: NDArray[np.float64]
    steps_ms: NDArray[np.float64]

    @property
    def first_ms(self) -> float:
        """The least, decision by decision."""
        return float(np.sum(self.decisions_ms.min(axis=0)))

    @property
    def sketching_ms(self) -> float:
        """The least, step by step."""
        return float(np.sum(self.steps_ms.min(axis=0)))

    def first(self, small: _Times) -> float:
        """How many times as long the first action takes as in the small world: the median over the repetitions."""
        return _ratio(self.decisions_ms.sum(axis=1), small.decisions_ms.sum(axis=1))

    def sketching(self, small: _Times) -> float:
        """The same of all sketch steps together."""
        return _ratio(self.steps_ms.sum(axis=1), small.steps_ms.sum(axis=1))

    def worst(self, small: _Times) -> float:
        """The same of the step for which it is the largest, among those that can be timed."""
        if self.steps_ms.shape != small.steps_ms.shape:
            return float("inf")
        timed = small.steps_ms.min(axis=0) >= SHORTEST_MS
        return max(_ratio(mine, theirs) for mine, theirs in zip(self.steps_ms.T[timed], small.steps_ms.T[timed],
                                                                strict=True))


def _ratio(mine: NDArray[np.float64], theirs: NDArray[np.float64]) -> float:
    """What one takes of the other's time: both times of a repetition were taken within moments."""
    return float(np.median(mine / theirs))


def _in_lockstep(worlds: Sequence[Made], goal: str, seed: int, repetitions: tuple[int, int]) -> list[_Times]:
    """For each world the times of all repetitions; see :mod:`experiments.scale.world_size_lockstep`."""
    command = [sys.executable, "-m", "experiments.scale.world_size_lockstep", goal, str(seed),
               *map(str, repetitions), *(str(world.path) for world in worlds)]
    told: dict[str, list[list[list[float]]]] = {"start": [], "plan": []}
    with (tqdm(total=sum(repetitions), file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar,
          subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child):
        assert child.stdout is not None
        for line in child.stdout:
            for what, times in json.loads(line).items():
                told[what].append(times)
            bar.update()
    if child.returncode:
        raise RuntimeError(f"{' '.join(command)}: expected to end well, got {child.returncode}")
    return [_Times(*(np.array([times[i] for times in told[what]]) for what in ("start", "plan")))
            for i in range(len(worlds))]


class _Probe:
    """A process that runs missions in one world when it is told to."""

    def __init__(self, world: Made, goal: str, seed: int) -> None:
        self._command = [sys.executable, "-m", "experiments.scale.world_size_probe", str(world.path), goal, str(seed)]

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
    command = [sys.executable, "-m", "experiments.scale.world_size_flat", str(world.path)]
    answer: dict[str, Any] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return answer


Answers = dict[str, list[dict[str, Any]]]


def _least(answers: Sequence[dict[str, Any]], what: str) -> float:
    return float(min(answer[what] for answer in answers))


def _row(world: Made, answers: Answers, times: _Times, flat: dict[str, Any], small: Answers) -> tuple[Cell, ...]:
    drive, memory = answers["drive"][0], answers["memory"][0]
    return (
        world.locales, world.faces, world.path.stat().st_size / 1e6, _least(answers["open"], "open_ms"),
        times.first_ms, times.sketching_ms, memory["mb"], drive["touched"],
        drive["decisions"], "yes" if drive["journal"] == small["drive"][0]["journal"] else "NO",
        _least(answers["open"], "far_ms"), flat["load_ms"], flat["path_ms"], flat["mb"],
    )


def _claims(answers: Answers, times: _Times, row: Sequence[Cell], small: Answers, small_times: _Times,
            small_row: Sequence[Cell]) -> list[tuple[str, bool]]:
    size, more_mb = f"{row[0]} locales", float(str(row[6])) - float(str(small_row[6]))
    first, together, worst = (of(small_times) for of in (times.first, times.sketching, times.worst))
    touched = [drive["frames"] for drive in answers["drive"]] == [drive["frames"] for drive in small["drive"]]
    return [
        (f"{size}: the same journal, and the same frames touched", row[9] == "yes" and touched),
        (f"{size}: first action within {RATIO} x the small world's ({first:.3f})", first <= RATIO),
        (f"{size}: all later sketch steps together within {RATIO} x ({together:.3f})", together <= RATIO),
        (f"{size}: each later sketch step of {SHORTEST_MS} ms and more within {RATIO} x (worst {worst:.3f})",
         worst <= RATIO),
        (f"{size}: memory within {MEMORY_MB:.0f} MB ({more_mb:+.1f})", more_mb <= MEMORY_MB),
        (f"{size}: opened in less than {OPEN_MS:.0f} ms", float(str(row[3])) < OPEN_MS),
    ]
