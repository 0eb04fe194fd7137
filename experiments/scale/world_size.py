"""The same mission in worlds of 12, 1,000 and 100,000 locales: frames read, time and memory.

Beside it the usual method: the flat graph of all doorways in networkx, and a shortest path on it.
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
from experiments.scale.worlds.campus import Campus, write_campus
from world_models.files.packed import FORMAT

SIZES, QUICK_SIZES = (12, 1_000, 100_000), (12, 1_000)
OPENINGS, QUICK_OPENINGS = 20, 3
STARTS, QUICK_STARTS = 40, 5
PLANS, QUICK_PLANS = 40, 5
MIN_STEP_MS = 0.5
"""Shorter steps cannot be timed."""
MAX_RATIO, MAX_MORE_MB, MAX_OPEN_MS = 1.1, 50.0, 100.0
LONG_GOAL = "(ptrans (robot-laboratory (16,2,0)) (allens-office (13,12,0)))"
SHORT_GOAL = "(ptrans (hallway (66,4,0)) (allens-office (6,5,0)))"
COLUMNS = ("locales", "faces", "file MB", "open ms", "first action ms", "sketching ms", "mission MB", "frames touched",
           "decisions", "same journal", "far route ms", "networkx load ms", "networkx path ms",
           "networkx MB")


def run(quick: bool, seed: int) -> Report:
    """Write the worlds, once, into the temporary folder, and time the mission in all of them in turn."""
    folder = Path(tempfile.gettempdir()) / FORMAT.replace(" ", "-")
    worlds = [write_campus(size, folder) for size in (QUICK_SIZES if quick else SIZES)]
    goal = SHORT_GOAL if quick else LONG_GOAL
    repetitions = (QUICK_STARTS, QUICK_PLANS) if quick else (STARTS, PLANS)
    again, *times = _time_in_lockstep([worlds[0], *worlds], goal, seed, repetitions)
    openings = QUICK_OPENINGS if quick else OPENINGS
    with _Probe(worlds[0], goal, seed) as first:
        first.ask("drive")  # compiles what is not compiled yet, which takes memory
    with ExitStack() as stack:
        probes = [stack.enter_context(_Probe(world, goal, seed)) for world in worlds]
        answers = _ask_interleaved(probes, ["open"] * openings + ["drive", "memory"])
    flats = [_measure_networkx(world) for world in worlds]
    rows = tuple(_row(*each, answers[0]) for each in zip(worlds, answers, times, flats, strict=True))
    return Report(
        "The same mission in worlds of different size", COLUMNS, rows,
        notes=(
            f"Mission: {goal}, seed {seed}. Times are of the processor. In one process the agents in all worlds decide"
            f" in turn, each with the file opened again: {repetitions[0]} times to the first motor command and"
            f" {repetitions[1]} times a dry run of the whole mission. Compared are the times of one repetition, taken"
            " within moments of each other; the claims are on the median of these ratios, so that other load on the"
            " machine counts less. The table has the least time of each decision.",
            "open: the world's file; first action: from the command to the first motor command, perception included;"
            " sketching: all acts of the sketcher and the milestone selector, reading the frames included.",
            "mission MB: peak memory of a process in which the mission was driven and the world opened"
            f" {openings} times.",
            "far route: from the laboratory to the last locale of the world, refined down to rooms at both ends.",
            "networkx: one process reads every locale and passage from the same file into a Graph and asks for"
            " shortest_path to that locale.",
            "The smallest world against itself, as a measure of the noise: first action"
            f" {again.first(times[0]):.3f} x, sketching {again.sketching(times[0]):.3f} x,"
            f" worst step {again.worst(times[0]):.3f} x.",
            *([f"Not claimed by --quick: that each sketch step is within {MAX_RATIO} x; {QUICK_PLANS} repetitions"
               " are too few for that on a busy machine."] if quick else []),
        ),
        claims=tuple(claim for each in zip(answers[1:], times[1:], rows[1:], strict=True)
                     for claim in _claims(*each, answers[0], times[0], rows[0])),
    )


@dataclass(frozen=True, eq=False, slots=True)
class _Times:
    """Times of each decision up to the first motor command and of each sketch step, by repetition [ms]."""

    decisions_ms: NDArray[np.float64]
    steps_ms: NDArray[np.float64]

    @property
    def first_ms(self) -> float:
        """Sum of the least time of each decision."""
        return float(np.sum(self.decisions_ms.min(axis=0)))

    @property
    def sketching_ms(self) -> float:
        """Sum of the least time of each step."""
        return float(np.sum(self.steps_ms.min(axis=0)))

    def first(self, small: _Times) -> float:
        """Ratio of the time to the first action to the small world's: the median over the repetitions."""
        return _ratio(self.decisions_ms.sum(axis=1), small.decisions_ms.sum(axis=1))

    def sketching(self, small: _Times) -> float:
        """The same ratio of all sketch steps together."""
        return _ratio(self.steps_ms.sum(axis=1), small.steps_ms.sum(axis=1))

    def worst(self, small: _Times) -> float:
        """The largest such ratio of a single step, among those that can be timed."""
        if self.steps_ms.shape != small.steps_ms.shape:
            return float("inf")
        timed = small.steps_ms.min(axis=0) >= MIN_STEP_MS
        return max(_ratio(mine, theirs) for mine, theirs in zip(self.steps_ms.T[timed], small.steps_ms.T[timed],
                                                                strict=True))


def _ratio(mine: NDArray[np.float64], theirs: NDArray[np.float64]) -> float:
    """Median of the ratios by repetition, whose two times were taken within moments of each other."""
    return float(np.median(mine / theirs))


def _time_in_lockstep(worlds: Sequence[Campus], goal: str, seed: int, repetitions: tuple[int, int]) -> list[_Times]:
    """Measure the times of all repetitions in each world; see :mod:`experiments.scale.worlds.lockstep`."""
    command = [sys.executable, "-m", "experiments.scale.worlds.lockstep", goal, str(seed),
               *map(str, repetitions), *(str(world.path) for world in worlds)]
    measured: dict[str, list[list[list[float]]]] = {"start": [], "plan": []}
    with (tqdm(total=sum(repetitions), file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar,
          subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child):
        assert child.stdout is not None
        for line in child.stdout:
            for what, times in json.loads(line).items():
                measured[what].append(times)
            bar.update()
    if child.returncode:
        raise RuntimeError(f"{' '.join(command)}: expected to end well, got {child.returncode}")
    return [_Times(*(np.array([times[i] for times in measured[what]]) for what in ("start", "plan")))
            for i in range(len(worlds))]


class _Probe:
    """A process that runs missions in one world on request."""

    def __init__(self, world: Campus, goal: str, seed: int) -> None:
        self._command = [sys.executable, "-m", "experiments.scale.worlds.probe", str(world.path), goal, str(seed)]

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


def _ask_interleaved(probes: Sequence[_Probe], requests: Sequence[str]) -> list[dict[str, list[dict[str, Any]]]]:
    """Answers by probe and request; one probe works at a time, and each in turn goes first."""
    answers: list[dict[str, list[dict[str, Any]]]] = [{} for _ in probes]
    with tqdm(total=len(requests) * len(probes), file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:
        for turn, request in enumerate(requests):
            for step in range(len(probes)):
                index = (turn + step) % len(probes)
                answers[index].setdefault(request, []).append(probes[index].ask(request))
                bar.update()
    return answers


def _measure_networkx(world: Campus) -> dict[str, Any]:
    command = [sys.executable, "-m", "experiments.scale.worlds.flat", str(world.path)]
    answer: dict[str, Any] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return answer


Answers = dict[str, list[dict[str, Any]]]


def _least(answers: Sequence[dict[str, Any]], what: str) -> float:
    return float(min(answer[what] for answer in answers))


def _row(world: Campus, answers: Answers, times: _Times, flat: dict[str, Any], small: Answers) -> tuple[Cell, ...]:
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
        (f"{size}: first action within {MAX_RATIO} x the small world's ({first:.3f})", first <= MAX_RATIO),
        (f"{size}: all later sketch steps together within {MAX_RATIO} x ({together:.3f})", together <= MAX_RATIO),
        *([(f"{size}: each later sketch step of {MIN_STEP_MS} ms and more within {MAX_RATIO} x (worst {worst:.3f})",
            worst <= MAX_RATIO)] if len(times.steps_ms) >= PLANS else []),
        (f"{size}: memory within {MAX_MORE_MB:.0f} MB ({more_mb:+.1f})", more_mb <= MAX_MORE_MB),
        (f"{size}: opened in less than {MAX_OPEN_MS:.0f} ms", float(str(row[3])) < MAX_OPEN_MS),
    ]
