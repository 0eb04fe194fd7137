"""One mission on a floor of identical rooms, told right or wrong in which it is: how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from blackboard.journal import Decision
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from experiments.generated.missions import write_twin_mission
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
