"""Recovery retrier (§2, §4): a fault that is not over is waited for longer, but not for ever."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard.board import View
from blackboard.change import Change, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.conditions import GOING_ON
from knowledge_sources.priority import Priority
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries.body import STOP_KEY, BodyFault, Recovery
from world_models.entries.task import Outcome


class Case(NamedTuple):
    """A recovery that was in vain, and the fault that is not over."""

    recovery: Entry[Recovery]
    fault: Entry[BodyFault]


class RecoveryRetrier(RobotKnowledgeSource):
    """Retries a recovery after twice the pause, or ends the mission: at the stop key, and after ``max_fault_s``."""

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(Recovery, (Revised,), lambda r: r.status not in ("asked", "over")),)
    needs = (GOING_ON,)
    writes = (Recovery, Outcome)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """The fault that a recovery was for."""
        fault = view.get(trigger.entry.value.fault)
        return None if fault is None else Case(trigger.entry, fault)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        (recovery, fault), s = case, self._settings.action
        r = recovery.value
        if r.what == STOP_KEY:
            yield Post(Outcome("stopped", r.detail), (recovery,))
        elif r.waited_s >= s.max_fault_s:
            reason = f"{fault.value.what}, and it was not over after {r.waited_s:.0f} s; nothing more is commanded"
            yield Post(Outcome("failed", reason), (fault, recovery))
        else:
            wait_s = min(2.0 * r.wait_s, s.max_retry_wait_s)
            yield Revise(recovery, replace(r, status="asked", wait_s=wait_s), (recovery,))
