"""Fault handler (§2, §4): retries after a fault of the body, or ends the mission."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.questions import is_over
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.entries.body import STOP_KEY, BodyFault, Course, MotorCommand, Recovery
from world_models.entries.task import Outcome


class FaultHandler(OlderSource):
    """Asks for recovery from a fault of the body, and closes the fault when it is over, or ends the mission.

    A motion that was broken off puts the belief in doubt: a milestone must be verified before the robot moves on. The
    mission ends at the stop key, at a fault longer than ``max_fault_s``, and when ``max_broken_motions`` motions in a
    row were broken off.
    """

    level = Level.ACTION
    on = (
        Watch(BodyFault, (Posted,)),
        Watch(Recovery, (Revised,), lambda r: r.status != "asked"),
    )
    writes = (Recovery, BodyFault, Discrepancy, Outcome)

    def judge(self, view: View, trigger: Change) -> float | None:
        return None if is_over(view) else 1.0

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        value = trigger.entry.value
        if isinstance(value, BodyFault):
            yield from self._ask_for_recovery(trigger.entry)
        elif value.status == "over":
            yield from self._close_fault(view, trigger.entry)
        else:
            yield from self._retry(view, trigger.entry)

    def _ask_for_recovery(self, fault: Entry[BodyFault]) -> Iterable[Effect]:
        f = fault.value
        if f.what == STOP_KEY:
            yield Post(Outcome("stopped", f.detail), (fault,))
        else:
            yield Post(Recovery(fault.id, f.request, f.when_s, self._settings.action.min_retry_wait_s), (fault,))

    def _retry(self, view: View, recovery: Entry[Recovery]) -> Iterable[Effect]:
        """Retry after twice the pause (exponential backoff), or end the mission."""
        r, fault = recovery.value, view.get(recovery.value.fault)
        if fault is None:
            return
        if r.what == STOP_KEY:
            yield Post(Outcome("stopped", r.detail), (recovery,))
        elif r.waited_s >= self._settings.action.max_fault_s:
            reason = f"{fault.value.what}, and it was not over after {r.waited_s:.0f} s; nothing more is commanded"
            yield Post(Outcome("failed", reason), (fault, recovery))
        else:
            wait_s = min(2.0 * r.wait_s, self._settings.action.max_retry_wait_s)
            yield Revise(recovery, replace(r, status="asked", wait_s=wait_s), (recovery,))

    def _close_fault(self, view: View, recovery: Entry[Recovery]) -> Iterable[Effect]:
        """Close a fault; after a broken-off motion, ask the plan level for a milestone."""
        fault, request = view.get(recovery.value.fault), view.get(recovery.value.request)
        if fault is None:
            return
        closed = Revise(fault, replace(fault.value, status="over"), (recovery,))
        yield closed
        if request is None or not isinstance(request.value, MotorCommand | Course):
            return
        times = self._settings.action.max_broken_motions
        if _were_all_broken_off(view, times):
            reason = f"{times} motions in a row were broken off, the last one by: {fault.value.what}"
            yield Post(Outcome("failed", reason), (closed,))
            return
        bound_px = self._settings.plan.max_deviation_px
        what = f"{request.id} was broken off: {fault.value.what}"
        yield Post(Discrepancy(Level.PLAN, what, None, (bound_px, bound_px), "px"), (closed, recovery))


def _were_all_broken_off(view: View, times: int) -> bool:
    """Whether each of the last ``times`` motions was broken off."""
    broken = {entry.value.request for entry in view.all(BodyFault)}
    asked = sorted((*view.all(MotorCommand), *view.all(Course)), key=lambda entry: -entry.cycle)
    last = asked[:times]
    return len(last) == times and all(command.id in broken for command in last)
