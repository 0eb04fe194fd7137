"""Halt explainer (§4: models are incomplete): what a leg was halted for is held to be there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Entry, Level, Revise, Revised, View, Watch
from knowledge_sources.methods.floor import build_polygon
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, find_swept_next
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Leg, Obstacle

Halted = tuple[Entry[Leg], tuple[Entry[Obstacle], ...]]


class HaltExplainer(RobotKnowledgeSource):
    """Holds what is suspected right before a leg that was halted for it to be there.

    The robot has no other view of it that is nearer: so the plan leads round it, or back to look at it again.
    """

    level, priority = Level.ACTION, Priority.REVISE
    on = (Watch(Leg, (Revised,), lambda leg: leg.status == "halted"),)
    needs = (HELD,)
    writes = (Obstacle,)

    def bind(self, view: View, trigger: Change) -> Halted | None:
        """The leg, and what is suspected where the robot would sweep next."""
        ahead = find_swept_next(HELD.of(view), trigger.entry.value, self._settings.action)
        found = tuple(entry for entry in view.where(Obstacle, lambda o: o.status == "suspected")
                      if build_polygon(entry.value.footprint).intersects(ahead))
        return (trigger.entry, found) if found else None

    def act(self, view: View, case: Halted) -> Iterable[Effect]:
        leg, suspected = case
        for entry in suspected:
            yield Revise(entry, replace(entry.value, status="there"), (entry, leg, HELD.of(view).entry))
