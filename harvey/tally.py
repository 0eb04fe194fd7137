"""Tally: a sink that counts what a mission comes to, for progress and for the summary."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from blackboard.change import Change
from blackboard.journal import Decision
from world_models.location import Hypothesis
from world_models.task import Goal, Milestone, Outcome, PlanSketch

if TYPE_CHECKING:
    from sim.assembly import Stage


@dataclass(frozen=True, slots=True)
class Row:
    """How one mission went.

    Attributes:
        seed: its seed.
        outcome, reason: of the :class:`Outcome`.
        error_m: true distance from the goal at the end.
        verified, refuted: milestones.
        sketches: plan sketches drawn; replans: of them, those that replaced an older one; goals: top-level goals.
        collisions: contacts; path_m: true length of the way; time_s: simulated; cycles: decisions; wall_s: real time.
    """

    seed: int
    outcome: str
    reason: str
    error_m: float
    verified: int
    refuted: int
    sketches: int
    replans: int
    goals: int
    collisions: int
    path_m: float
    time_s: float
    cycles: int
    wall_s: float

    @property
    def reached(self) -> bool:
        return self.outcome == "reached"


class Tally:
    """Counts, and knows how far it is to go by Harvey's own belief."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self.cycles = 0
        self.to_go_m = self.way_m = stage.start_world.distance_to(stage.goal_world)
        self.outcome: Outcome | None = None
        self._milestones: dict[str, str] = {}
        self._sketches: dict[str, str] = {}
        self._goals: set[str] = set()

    def __call__(self, decision: Decision) -> None:
        self.cycles = decision.cycle
        for change in (*decision.observed, *decision.made):
            self._take(change)

    def _take(self, change: Change) -> None:
        value, id = change.entry.value, change.entry.id
        if isinstance(value, Milestone):
            self._milestones[id] = value.status
        elif isinstance(value, PlanSketch):
            self._sketches[id] = value.status
        elif isinstance(value, Goal):
            self._goals.add(id)
        elif isinstance(value, Outcome):
            self.outcome = value
        elif isinstance(value, Hypothesis) and value.is_held:
            self.to_go_m = value.world_from_robot(self._stage.world).distance_to(self._stage.goal_world)

    @property
    def verified(self) -> int:
        return self._count("verified")

    def _count(self, status: str) -> int:
        return sum(1 for s in self._milestones.values() if s == status)

    def row(self, seed: int, result: Any, wall_s: float) -> Row:
        score = result.score
        return Row(
            seed=seed, outcome=result.outcome.kind, reason=result.outcome.reason, error_m=score.position_error_m,
            verified=self.verified, refuted=self._count("refuted"), sketches=len(self._sketches),
            replans=sum(1 for s in self._sketches.values() if s == "superseded"), goals=len(self._goals),
            collisions=score.collisions, path_m=score.path_m, time_s=score.time_s, cycles=self.cycles, wall_s=wall_s,
        )
