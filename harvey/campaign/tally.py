"""Tally: a sink that counts what progress tells while a mission runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blackboard.journal import Decision
from logs.explain.turning_points import TurningPoint, TurningPointFinder
from world_models.entries.location import Hypothesis
from world_models.entries.task import Goal, Milestone

if TYPE_CHECKING:
    from sim.stage import Stage


class Tally:
    """Counts milestones, and knows how far it is to go by Harvey's own belief.

    Attributes:
        verified: milestones so far.
        way_m, to_go_m: distance to the goal as the crow flies, at first and now.
        turns: the turning points of the last decision that must not be left out.
        is_lost: whether the robot does not know where it is.
    """

    def __init__(self, stage: Stage) -> None:
        self._world, self._goal = stage.world, stage.goal_world
        self.verified = 0
        self.turns: tuple[TurningPoint, ...] = ()
        self.is_lost = False
        self._finder = TurningPointFinder()
        self.to_go_m = self.way_m = stage.start_world.distance_to(stage.goal_world)

    def __call__(self, decision: Decision) -> None:
        self.turns = tuple(point for point in self._finder.find(decision) if point.is_told)
        for point in self.turns:
            if point.kind in ("lost", "found"):
                self.is_lost = point.kind == "lost"
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, Milestone):
                self.verified += value.status == "verified"
            elif isinstance(value, Goal) and value.is_active:
                self._goal = value.destination.in_world(self._world)
            elif isinstance(value, Hypothesis) and value.is_held:
                self.to_go_m = value.world_from_robot(self._world).distance_to(self._goal)
