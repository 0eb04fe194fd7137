"""Halt explainer (§4: models are incomplete): what a leg was halted for is held to be there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Revise, Revised, View, Watch
from knowledge_sources.methods.floor import build_polygon
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, find_swept_next
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Hypothesis, Leg, Obstacle


class Case(NamedTuple):
    """A leg that was halted, where the robot is, and what is suspected right before it."""

    leg: Entry[Leg]
    belief: Entry[Hypothesis]
    suspected: tuple[Entry[Obstacle], ...]


class HaltExplainer(RobotKnowledgeSource):
    """Holds what is suspected right before a leg that was halted for it to be there.

    The robot has no other view of it that is nearer: so the plan leads round it, or back to look at it again.
    """

    level, priority = Level.ACTION, Priority.REVISE
    on = (Watch(Leg, (Revised,), lambda leg: leg.status == "halted"),)
    needs = (HELD,)
    writes = (Obstacle,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """What is suspected where the robot would sweep next."""
        belief = HELD.of(view)
        ahead = find_swept_next(belief, trigger.entry.value, self._settings.action)
        found = tuple(entry for entry in view.where(Obstacle, lambda o: o.status == "suspected")
                      if build_polygon(entry.value.footprint).intersects(ahead))
        return Case(trigger.entry, belief.entry, found) if found else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        for entry in case.suspected:
            yield Revise(entry, replace(entry.value, status="there"), (entry, case.leg, case.belief))
