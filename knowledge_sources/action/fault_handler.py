"""FaultHandler (§2, §4): answers what goes wrong with the body itself, at the level at which it goes wrong."""

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
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.tolerances import PLAN_PX
from world_models.entries.body import STOP_KEY, BodyFault, Course, MotorCommand, Recovery
from world_models.entries.task import Outcome

PATIENCE_S = 30.0
"""A fault that is not over after this long ends the mission [s]."""
STRIKES = 5
"""So many motions broken off in a row end it too: the base answers, but it does not get on."""
FIRST_WAIT_S, LONGEST_WAIT_S = 0.25, 2.0
"""The first pause before trying again; each is twice the one before, up to the longest [s]."""


class FaultHandler(RobotKnowledgeSource):
    """While the body is at fault it keeps the robot standing and tries again; it says when the fault is over, or final.

    A motion that was broken off leaves the belief in doubt: it has to be checked by a milestone before anybody moves
    on. The stop key ends the mission, and so do a fault that does not pass within ``PATIENCE_S`` and a base that never
    gets on.
    """

    level = Level.ACTION
    watches = (
        Watch(BodyFault, (Posted,)),
        Watch(Recovery, (Revised,), lambda r: r.status != "asked"),
    )
    writes = (Recovery, BodyFault, Discrepancy, Outcome)

    def rate(self, view: View, trigger: Change) -> float | None:
        return None if is_over(view) else 1.0

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        value = trigger.entry.value
        if isinstance(value, BodyFault):
            yield from self._noticed(trigger.entry)
        elif value.status == "over":
            yield from self._over(view, trigger.entry)
        else:
            yield from self._in_vain(view, trigger.entry)

    def _noticed(self, fault: Entry[BodyFault]) -> Iterable[Effect]:
        f = fault.value
        if f.what == STOP_KEY:
            yield Post(Outcome("stopped", f.detail), (fault,))
        else:
            yield Post(Recovery(fault.id, f.request, f.when_s, FIRST_WAIT_S), (fault,))

    def _in_vain(self, view: View, recovery: Entry[Recovery]) -> Iterable[Effect]:
        """Again after a longer pause, or it is final."""
        r, fault = recovery.value, view.get(recovery.value.fault)
        if fault is None:
            return
        if r.what == STOP_KEY:
            yield Post(Outcome("stopped", r.detail), (recovery,))
        elif r.waited_s >= PATIENCE_S:
            reason = f"{fault.value.what}, and it was not over after {r.waited_s:.0f} s; nothing more is commanded"
            yield Post(Outcome("failed", reason), (fault, recovery))
        else:
            wait_s = min(2.0 * r.wait_s, LONGEST_WAIT_S)
            yield Revise(recovery, replace(r, status="asked", wait_s=wait_s), (recovery,))

    def _over(self, view: View, recovery: Entry[Recovery]) -> Iterable[Effect]:
        """Closed; where the robot was moving, what it did is only claimed, so a milestone has to hold anew."""
        fault, request = view.get(recovery.value.fault), view.get(recovery.value.request)
        if fault is None:
            return
        closed = Revise(fault, replace(fault.value, status="over"), (recovery,))
        yield closed
        if request is None or not isinstance(request.value, MotorCommand | Course):
            return
        if _never_gets_on(view):
            reason = f"{STRIKES} motions in a row were broken off, the last one by: {fault.value.what}"
            yield Post(Outcome("failed", reason), (closed,))
            return
        what = f"{request.id} was broken off: {fault.value.what}"
        yield Post(Discrepancy(Level.PLAN, what, None, (PLAN_PX, PLAN_PX), "px"), (closed, recovery))


def _never_gets_on(view: View) -> bool:
    """Whether each of the last motions was broken off."""
    broken = {entry.value.request for entry in view.all(BodyFault)}
    asked = sorted((*view.all(MotorCommand), *view.all(Course)), key=lambda entry: -entry.cycle)
    last = asked[:STRIKES]
    return len(last) == STRIKES and all(command.id in broken for command in last)
