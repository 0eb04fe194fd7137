"""Fault closer (§2, §4): what follows when a fault of the body is over."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard.board import View
from blackboard.change import Change, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.conditions import NOT_GIVEN_UP
from knowledge_sources.priority import Priority
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries.body import BodyFault, Course, MotorCommand, Recovery
from world_models.entries.task import Impasse


class Case(NamedTuple):
    """The recovery, the fault that is over, and the motion that it broke off, if it broke one off."""

    recovery: Entry[Recovery]
    fault: Entry[BodyFault]
    motion: Entry[MotorCommand] | Entry[Course] | None


class FaultCloser(RobotKnowledgeSource):
    """Closes a fault of the body that is over.

    A motion that was broken off puts the belief in doubt: a milestone must be verified before the robot moves on. After
    ``max_broken_motions`` motions in a row that were broken off there is no way on.
    """

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(Recovery, (Revised,), lambda r: r.status == "over"),)
    needs = (NOT_GIVEN_UP,)
    writes = (BodyFault, Discrepancy, Impasse)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """The fault that a recovery was for, and what it broke off."""
        fault, request = view.get(trigger.entry.value.fault), view.get(trigger.entry.value.request)
        is_motion = request is not None and isinstance(request.value, MotorCommand | Course)
        return None if fault is None else Case(trigger.entry, fault, request if is_motion else None)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        recovery, fault, motion = case
        closed = Revise(fault, replace(fault.value, status="over"), (recovery,))
        yield closed
        if motion is None:
            return
        times = self._settings.action.max_broken_motions
        if _were_all_broken_off(view, times):
            reason = f"{times} motions in a row were broken off, the last one by: {fault.value.what}"
            yield Post(Impasse("failed", reason), (closed,))
            return
        bound_px = self._settings.plan.max_deviation_px
        what = f"{motion.id} was broken off: {fault.value.what}"
        yield Post(Discrepancy(Level.PLAN, what, None, (bound_px, bound_px), "px"), (closed, recovery))


def _were_all_broken_off(view: View, times: int) -> bool:
    """Whether each of the last ``times`` motions was broken off."""
    broken = {entry.value.request for entry in view.all(BodyFault)}
    asked = sorted((*view.all(MotorCommand), *view.all(Course)), key=lambda entry: -entry.cycle)
    last = asked[:times]
    return len(last) == times and all(command.id in broken for command in last)
