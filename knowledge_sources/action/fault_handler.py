"""Fault handler (§2, §4): what a fault of the body asks for."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.conditions import GOING_ON
from knowledge_sources.priority import Priority
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries.body import STOP_KEY, BodyFault, Recovery
from world_models.entries.task import Outcome


class FaultHandler(RobotKnowledgeSource):
    """Asks for recovery from a fault of the body; at the stop key it ends the mission."""

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(BodyFault, (Posted,)),)
    needs = (GOING_ON,)
    writes = (Recovery, Outcome)

    def bind(self, view: View, trigger: Change) -> Entry[BodyFault]:
        return trigger.entry

    def act(self, view: View, case: Entry[BodyFault]) -> Iterable[Effect]:
        f = case.value
        if f.what == STOP_KEY:
            yield Post(Outcome("stopped", f.detail), (case,))
        else:
            yield Post(Recovery(case.id, f.request, f.when_s, self._settings.action.min_retry_wait_s), (case,))
