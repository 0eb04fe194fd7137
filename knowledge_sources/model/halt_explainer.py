"""Halt explainer (§4: models are incomplete): what a leg is halted for, or would be next, is held to be there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Entry, Level, Posted, Revise, Revised, View, Watch
from knowledge_sources.methods.floor import build_polygon
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, current_leg, find_swept_next
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Leg, Obstacle

Ahead = tuple[Entry[Leg], tuple[Entry[Obstacle], ...]]


class HaltExplainer(RobotKnowledgeSource):
    """Holds what is suspected next on the robot's way to be there, and so what a leg was halted for.

    The robot has no other view of it that is nearer: so the plan leads round it, or back to look at it again.
    """

    level, priority = Level.ACTION, Priority.REVISE
    on = (
        Watch(Leg, (Revised,), lambda leg: leg.status == "halted"),
        Watch(Obstacle, (Posted, Revised), lambda o: o.status == "suspected"),
    )
    needs = (HELD,)
    writes = (Obstacle,)

    def bind(self, view: View, trigger: Change) -> Ahead | None:
        """The leg, and what is suspected where the robot would sweep next."""
        leg = view.latest(Leg)
        if leg is None or (leg.value.status != "halted" and current_leg(view) is None):
            return None
        ahead = find_swept_next(HELD.of(view), leg.value, self._settings.action)
        found = tuple(entry for entry in view.where(Obstacle, lambda o: o.status == "suspected")
                      if build_polygon(entry.value.footprint).intersects(ahead))
        return (leg, found) if found else None

    def act(self, view: View, case: Ahead) -> Iterable[Effect]:
        leg, suspected = case
        for entry in suspected:
            yield Revise(entry, replace(entry.value, status="there"), (entry, leg, HELD.of(view).entry))
