"""Missions on floors of identical rooms: does it use what it was told, and notice where that is wrong?

The robot is told the room at the start, right with probability 0.98. Otherwise it is put down in another room that
looks the same, at the same place of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from blackboard.journal import Decision
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from experiments.generated.missions import write_twin_mission
from experiments.report import Cell, Report
from experiments.trials import RESULTS, at_least, at_most, campaign_folder, run_trials
from harvey.campaign.campaign import Task, run_task
from world_models.entries.location import PlaceOdds

REACHED_M = 0.3
"""A robot that says that it has reached the goal is wrong if it is farther away: another room is metres away."""


@dataclass(frozen=True, slots=True)
class TwinTrial:
    """A mission: the seed of floor, mission and run, and whether the robot is told the right room."""

    seed: int
    is_told_right: bool


@dataclass(frozen=True, slots=True)
class TwinResult:
    """How a mission ended, in plain types.

    Attributes:
        rooms: number of identical rooms.
        error_m: true distance from the goal.
        doubts: times that the robot doubted its place at the goal level.
        by_odds: times that a place was believed by what was told or tracked.
    """

    seed: int
    is_told_right: bool
    rooms: int
    outcome: str
    reason: str
    error_m: float
    doubts: int
    by_odds: int
    relocations: int
    collisions: int
    robot_s: float
    wall_s: float

    @property
    def is_right(self) -> bool:
        """Whether it reached the goal, and says so."""
        return self.outcome == "reached" and self.error_m <= REACHED_M

    @property
    def is_wrong(self) -> bool:
        """Whether it says that it reached the goal, and is elsewhere."""
        return self.outcome == "reached" and self.error_m > REACHED_M

    @property
    def is_noticed(self) -> bool:
        """Whether it doubted its place, and does not say that it is at the goal while it is elsewhere."""
        return self.doubts > 0 and not self.is_wrong


def run_twin_mission(trial: TwinTrial) -> TwinResult:
    """Run the mission of a trial."""
    doubts: set[str] = set()
    by_odds = [0]

    def note(decision: Decision) -> None:
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, Discrepancy) and value.level is Level.GOAL:
                doubts.add(change.entry.id)
            by_odds[0] += isinstance(value, PlaceOdds)

    with TemporaryDirectory() as folder:
        mission = write_twin_mission(Path(folder), trial.seed, is_told_right=trial.is_told_right)
        r = run_task(Task(str(mission.path), (), trial.seed), sinks=[note])
    return TwinResult(
        trial.seed, trial.is_told_right, mission.rooms, r.outcome, r.reason, r.error_m, len(doubts), by_odds[0],
        r.relocalizations, r.collisions or 0, r.sim_time_s, r.wall_time_s)


MISSIONS, QUICK_MISSIONS = 3_000, 4
FIRST_SEED, SEEDS_APART = 1_000_000, 10_000
"""Seeds below 100,000 are for development: constants were chosen on some of them."""
P_TOLD_RIGHT = 0.98
MIN_REACHED, MIN_NOTICED, MAX_WRONG = 0.99, 0.90, 0.001
WORST_SHOWN = 6
COLUMNS = ("told", "paper", "peer", "missions", "reached", "proves at least", "noticed", "wrong and confident",
           "proves at most", "believed by odds", "relocated", "robot's mean s", "mean CPU s")


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive so many missions, of seeds 1,000,000 + 10,000 ``seed`` + 0, 1, ....; the small version one told wrong."""
    number = missions or (QUICK_MISSIONS if quick else MISSIONS)
    first = FIRST_SEED + SEEDS_APART * seed
    trials = [TwinTrial(first + k, _is_told_right(first + k) if not quick else k > 0) for k in range(number)]
    folder = campaign_folder(f"twins-{missions}" if missions else "twins", seed, quick=quick)
    ends = run_trials(run_twin_mission, trials, TwinResult, folder, "mission")
    right = [end for end in ends if end.is_told_right]
    wrong = [end for end in ends if not end.is_told_right]
    report = Report(
        "Missions on floors of 5 to 40 identical rooms", COLUMNS,
        tuple(_row(name, e) for name, e in (("right", right), ("wrong", wrong)) if e),
        notes=(
            f"Seeds {first} to {first + number - 1}; no constant was chosen on them. Bounds are one-sided, of 95 %, by"
            " Clopper and Pearson.",
            "reached: the goal, and in truth. noticed: it doubted its place, and does not end as reached elsewhere."
            " wrong and confident: it ends as reached, and is elsewhere. believed by odds: times that a place was"
            " believed by what was told or tracked, of several that look alike.",
            "Paper and peers have no such missions: the paper's robot always knows where it begins.",
            *_worst("told right, missions to look at", [e for e in right if not e.is_right]),
            *_worst("told wrong, missions to look at", [e for e in wrong if not e.is_noticed]),
            f"One line per mission: {folder / RESULTS}",
        ),
        claims=tuple(_claims(right, wrong, quick=quick)),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def _is_told_right(seed: int) -> bool:
    return bool(np.random.default_rng([seed, 11]).random() < P_TOLD_RIGHT)


def _row(name: str, ends: Sequence[TwinResult]) -> tuple[Cell, ...]:
    reached, wrong = sum(e.is_right for e in ends), sum(e.is_wrong for e in ends)
    return (
        name, None, None, len(ends), reached, f"{at_least(reached, len(ends)):.1%}", sum(e.is_noticed for e in ends),
        wrong, f"{at_most(wrong, len(ends)):.2%}", sum(e.by_odds for e in ends), sum(e.relocations for e in ends),
        math.fsum(e.robot_s for e in ends) / len(ends), math.fsum(e.wall_s for e in ends) / len(ends),
    )


def _claims(right: Sequence[TwinResult], wrong: Sequence[TwinResult], *, quick: bool) -> Iterator[tuple[str, bool]]:
    if right:
        reached = sum(e.is_right for e in right)
        yield (f"told right: at least {MIN_REACHED:.0%} reach: {reached} of {len(right)}, so at least"
               f" {at_least(reached, len(right)):.1%}", reached >= MIN_REACHED * len(right))
    if wrong and not quick:
        noticed = sum(e.is_noticed for e in wrong)
        yield (f"told wrong: at least {MIN_NOTICED:.0%} notice: {noticed} of {len(wrong)}, so at least"
               f" {at_least(noticed, len(wrong)):.1%}", noticed >= MIN_NOTICED * len(wrong))
    ends = [*right, *wrong]
    confident = sum(e.is_wrong for e in ends)
    yield (f"wrong and confident: at most {MAX_WRONG:.1%}: {confident} of {len(ends)}, so at most"
           f" {at_most(confident, len(ends)):.2%}", confident <= MAX_WRONG * len(ends))


def _worst(what: str, ends: Sequence[TwinResult]) -> list[str]:
    """Name the missions to look at."""
    told = "; ".join(f"{e.seed} ({e.rooms} rooms, {e.outcome}: {e.reason})" for e in ends[:WORST_SHOWN])
    return [f"{what}: {told}"] if told else []
