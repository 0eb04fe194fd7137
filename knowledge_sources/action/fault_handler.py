"""Fault handler (§2, §4): a fault of the body is waited for, ever longer, but not for ever; and then closed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import EMERGENCY_STOPS, NOT_GIVEN_UP, OPEN_FAULT, find_stop, open_discrepancy
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import (
    GO_ON,
    STOP_KEY,
    BodyFault,
    Contact,
    Course,
    Discrepancy,
    Impasse,
    MotorCommand,
    PictureRequest,
    Recovery,
    Redirection,
    Ride,
)

MAX_FAULT_S = 30.0  # a fault that lasts longer ends the mission
MAX_BROKEN_MOTIONS = 5  # so many motions broken off in a row end the mission
MIN_RETRY_WAIT_S = 0.25  # pause before the first retry after a fault; each further one is twice as long
MAX_RETRY_WAIT_S = 2.0  # longest pause between retries
WORD_WAIT_S = 1.0  # so long it waits before it looks again whether somebody has said go on


class Case(NamedTuple):
    """A fault, a stop, or the word to go on after it; and the recovery that has failed so far, or has ended it."""

    fault: Entry[Any]
    recovery: Entry[Recovery] | None

    @property
    def is_of_fault(self) -> bool:
        return isinstance(self.fault.value, BodyFault) and self.fault.value.is_open


class FaultHandler(RobotKnowledgeSource):
    """Asks for recovery from a fault of the body, each time after twice the pause; closes one that is over.

    After the stop key, and after ``max_fault_s``, there is no way on. An elevator that does not come is no fault of the
    robot: then it is blocked. After a contact or an emergency stop it waits for permission, if the mission wants
    that; then, as after a motion that was broken off, the belief is in doubt: a milestone must be verified before the
    robot moves on. After ``max_broken_motions`` motions in a row that were broken off there is no way on.
    """

    level = Level.ACTION
    on = (Watch(BodyFault, (Posted,)), Watch(BodyFault, (Revised,), lambda f: f.what in EMERGENCY_STOPS),
          Watch(Recovery, (Revised,), lambda r: r.status != "asked"), Watch(Contact, (Posted,)),
          Watch(Redirection, (Revised,), lambda asked: asked.text == GO_ON))
    needs = (NOT_GIVEN_UP,)
    writes = (BodyFault, Recovery, Discrepancy, Impasse, PictureRequest)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """An open fault for which nobody waits, the oldest of them; else the stop after which nobody said go on."""
        asked = {entry.value.fault: entry for entry in view.all(Recovery)}
        waiting = {id for id, entry in asked.items() if entry.value.status == "asked"}
        fault = next((entry for entry in view.having(OPEN_FAULT, True) if entry.id not in waiting), None)
        stop, word = fault or find_stop(view), view.latest(Redirection, lambda asked: asked.text == GO_ON)
        if stop is None and word is not None and word is trigger.entry:
            return Case(word, None)
        return None if stop is None or stop.id in waiting else Case(stop, asked.get(stop.id))

    def rate(self, case: Case) -> float:
        return Priority.ENTER if case.is_of_fault else Priority.MOVE  # it waits when nothing else is left to do

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        fault, recovery = case
        if not case.is_of_fault:
            yield _wait_for_word(view, fault, recovery, self._settings.plan.max_deviation_px)
            return
        f, asked = fault.value, None if recovery is None else recovery.value
        because = (fault,) if recovery is None else (fault, recovery)
        if recovery is not None and asked is not None and asked.status == "over":
            yield from self._close(view, fault, recovery)
        elif STOP_KEY in (f.what, "" if asked is None else asked.what):
            yield Post(Impasse("stopped", f.detail if asked is None else asked.detail), because)
        elif recovery is None or asked is None:
            yield Post(Recovery(fault.id, f.request, f.when_s, MIN_RETRY_WAIT_S), because)
        elif asked.waited_s >= MAX_FAULT_S:
            yield Post(self._give_up(view.get(f.request), f, asked), because)
        else:
            again = replace(asked, status="asked", wait_s=min(2.0 * asked.wait_s, MAX_RETRY_WAIT_S))
            yield Revise(recovery, again, because)

    def _close(self, view: View, fault: Entry[BodyFault], recovery: Entry[Recovery]) -> Iterable[Effect]:
        closed = Revise(fault, replace(fault.value, status="over"), (recovery,))
        yield closed
        motion = view.get(recovery.value.request)
        if motion is None or not isinstance(motion.value, MotorCommand | Course):
            return
        times = MAX_BROKEN_MOTIONS
        if _were_all_broken_off(view, times):
            reason = f"{times} motions in a row were broken off, the last one by: {fault.value.what}"
            yield Post(Impasse("failed", reason), (closed,))
            return
        what = f"{motion.id} was broken off: {fault.value.what}"
        yield _doubt_place(what, self._settings.plan.max_deviation_px, (closed, recovery))

    def _give_up(self, request: Entry[Any] | None, fault: BodyFault, tried: Recovery) -> Impasse:
        """How the mission ends: without an elevator there is no way; else the body has failed."""
        if request is not None and isinstance(request.value, Ride):
            ride, why = request.value, tried.detail or fault.detail
            return Impasse("blocked", f"the elevator {ride.passage} from {ride.origin} to {ride.destination} does not"
                           f" come: {why}; it was called for {tried.waited_s:.0f} s")
        return Impasse("failed", f"{fault.what}, and it was not over after {tried.waited_s:.0f} s; nothing more is"
                       " commanded")


def _wait_for_word(view: View, stop: Entry[Any], wait: Entry[Recovery] | None, bound_px: float) -> Effect:
    """A wait for somebody to say go on; where it was said, a doubt, or of a robot that is lost the next look."""
    if isinstance(stop.value, Redirection):
        if open_discrepancy(view, Level.GOAL) is not None:
            return Post(PictureRequest("probe"), (stop,))
        return _doubt_place("it was told to go on", bound_px, (stop,))
    return Post(Recovery(stop.id, "", stop.value.when_s, WORD_WAIT_S), (stop,)) if wait is None else Revise(
        wait, replace(wait.value, status="asked"), (stop, wait))


def _doubt_place(what: str, bound_px: float, because: tuple[Any, ...]) -> Post:
    """A doubt that a milestone is to measure."""
    return Post(Discrepancy(Level.PLAN, what, None, (bound_px, bound_px), "px"), because)


def _were_all_broken_off(view: View, times: int) -> bool:
    """Whether each of the last ``times`` motions was broken off."""
    broken = {entry.value.request for entry in view.all(BodyFault)}
    asked = sorted((*view.all(MotorCommand), *view.all(Course)), key=lambda entry: -entry.cycle)
    last = asked[:times]
    return len(last) == times and all(command.id in broken for command in last)
