"""Travel breaker (§3.2): a way on which something pushed the robot tells nothing of where its camera looks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Discrepancy, Effect, Entry, Level, Posted, Revise, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Travel


class Case(NamedTuple):
    """The way, and what happened on it."""

    travel: Entry[Travel]
    what: Entry[Discrepancy]


class TravelBreaker(RobotKnowledgeSource):
    """Marks the way since the last milestone as broken, when the robot is lost, or something pushed or stopped it."""

    level, priority = Level.ACTION, Priority.REVISE
    on = (Watch(Discrepancy, (Posted,), lambda d: d.level is Level.GOAL or d.magnitude == math.inf),)
    writes = (Travel,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """A way that is not broken yet."""
        travel = view.latest(Travel)
        return None if travel is None or travel.value.is_broken else Case(travel, trigger.entry)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        travel, what = case
        yield Revise(travel, replace(travel.value, is_broken=True), (travel, what))
