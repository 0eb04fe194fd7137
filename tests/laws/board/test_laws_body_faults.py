"""Whatever a body does wrong, and for however long: each request is answered, or the mission ends declared."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blackboard import Change, Decision, Effect, Post, Scheduler, View
from harvey.runner.ports import BodyPort
from knowledge_sources.action.fault_handler import (
    MAX_BROKEN_MOTIONS,
    MAX_FAULT_S,
    MAX_RETRY_WAIT_S,
    MIN_RETRY_WAIT_S,
    FaultHandler,
)
from knowledge_sources.goal.mission_monitor import mission_monitor
from knowledge_sources.settings import DEFAULT
from strategies import Note, Scripted
from world_models.entries import (
    LADDER,
    STOP_KEY,
    BodyFault,
    CameraPicture,
    Contact,
    Discrepancy,
    MotionReport,
    MotorCommand,
    Outcome,
    PictureRequest,
    Recovery,
)
from world_models.entries.entry_kinds import KINDS

S = DEFAULT.action
MOST_CYCLES = 2000


class ScriptedBody:
    """Answers as a script says, "" for well and else what is wrong; when that is at its end, as it says ever after."""

    def __init__(self, script: list[str], ever_after: str, touches: Iterable[bool] = ()) -> None:
        """``touches``: whether it touches something in each motion, and each time that it is asked for what it did."""
        self._script, self._ever_after, self._touches = iter(script), ever_after, iter(touches)
        self.now_s, self.motions, self._contact = 0.0, 0, None
        self.touched: list[int] = []
        self.waits: list[float] = []

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        self.motions += 1
        self._touch()
        return self._fault("base") or MotionReport(command.turn_rad, command.move_m, 1.0, self.now_s)

    def claim(self) -> MotionReport | BodyFault:
        self._touch()
        return self._fault("base") or MotionReport(0.0, 0.1, 1.0, self.now_s)

    def take_contact(self) -> Contact | None:
        contact, self._contact = self._contact, None
        return contact

    def _touch(self) -> None:
        """Something, in the motion under way."""
        if self._contact is None and next(self._touches, False):
            self._contact = Contact("bumper", 0.0, 0.2, self.now_s)
            self.touched.append(self.motions)

    def ranges(self) -> None:
        return None

    def look(self, purpose: str) -> CameraPicture | BodyFault:
        return self._fault("camera") or CameraPicture(b"", 0, self.now_s, purpose)

    def wait(self, duration_s: float) -> float:
        self.waits.append(duration_s)
        self.now_s += duration_s
        return self.now_s

    def stop(self) -> None:
        """It stands."""

    def _fault(self, part: str) -> BodyFault | None:
        what = next(self._script, self._ever_after)
        return BodyFault(part, what, "scripted", "", self.now_s) if what else None


def asking(_view: View, trigger: Change) -> Iterable[Effect]:
    value = MotorCommand(0.1, 0.5) if trigger.entry.value.text == "move" else PictureRequest("track")
    yield Post(value, (trigger.entry,))


def drive(requests: list[str], body: ScriptedBody) -> tuple[Scheduler, list[Any]]:
    """What handles faults, and somebody who asks for the next request when the one before is answered."""
    told: list[Any] = []

    def listen(decision: Decision) -> None:
        told.extend(change.entry for change in (*decision.observed, *decision.made))

    scheduler = Scheduler(
        [FaultHandler(), mission_monitor,
         Scripted("asker", Note, asking, writes=(MotorCommand, PictureRequest))],
        ports=(BodyPort(body),), sinks=(listen,), ladder=LADDER, kinds=KINDS,
    )
    for request in requests:
        scheduler.post([Post(Note(request))], "user")
        while scheduler.step() is not None:
            assert scheduler.cycle < MOST_CYCLES
        if scheduler.view.latest(Outcome) is not None:
            break
    return scheduler, told


answers = st.sampled_from(["", "", "link lost", "frame late"])
requests = st.lists(st.sampled_from(["move", "look"]), min_size=1, max_size=6)


@given(requests, st.lists(answers, max_size=12), answers)
def test_each_request_is_answered_once_or_the_mission_ends_declared(
    asked: list[str], script: list[str], ever_after: str
) -> None:
    scheduler, told = drive(asked, ScriptedBody(script, ever_after))
    view, outcome = scheduler.view, scheduler.view.latest(Outcome)
    posted = [e for e in told if e.revision == 0 and isinstance(e.value, MotorCommand | PictureRequest)]
    replies = [e for e in told if isinstance(e.value, MotionReport | CameraPicture)]
    assert len({r.because for r in replies}) == len(replies)
    assert {r.because for r in replies} <= {(e.ref,) for e in posted}
    if outcome is None:
        assert len(replies) == len(posted) == len(asked)
        assert not any(f.value.is_open for f in view.all(BodyFault))
    else:
        assert outcome.value.kind == "failed" and outcome.because


@given(requests, st.lists(answers, max_size=12), answers)
def test_waits_double_and_the_patience_is_the_stated_one(asked: list[str], script: list[str], ever_after: str) -> None:
    body = ScriptedBody(script, ever_after)
    scheduler, told = drive(asked, body)
    assert all(MIN_RETRY_WAIT_S <= wait <= MAX_RETRY_WAIT_S for wait in body.waits)
    last: dict[str, float] = {}
    for r in (e.value for e in told if isinstance(e.value, Recovery) and e.value.status == "asked"):
        assert r.wait_s == min(2.0 * last.get(r.fault, MIN_RETRY_WAIT_S / 2.0), MAX_RETRY_WAIT_S)
        last[r.fault] = r.wait_s
    for recovery in scheduler.view.all(Recovery):
        assert recovery.value.waited_s < MAX_FAULT_S + MAX_RETRY_WAIT_S


@given(st.lists(st.sampled_from(["", "link lost"]), max_size=12))
def test_a_broken_off_motion_and_only_that_puts_the_belief_in_doubt(script: list[str]) -> None:
    scheduler, told = drive(["move"], ScriptedBody(script, ""))
    doubts = scheduler.view.all(Discrepancy)
    broken = [e for e in told if isinstance(e.value, BodyFault)]
    assert len(tuple(doubts)) == (1 if broken else 0)


def test_a_stop_key_ends_it_at_once_also_while_something_else_is_wrong() -> None:
    for script in ([STOP_KEY], ["link lost", "link lost", STOP_KEY]):
        body = ScriptedBody(script, STOP_KEY)
        scheduler, _ = drive(["move", "move"], body)
        outcome = scheduler.view.latest(Outcome)
        assert outcome is not None and outcome.value.kind == "stopped"
        assert len(body.waits) == len(script) - 1


@pytest.mark.parametrize("whole", [0, MAX_BROKEN_MOTIONS - 1])
def test_a_base_that_breaks_off_every_motion_is_given_up(whole: int) -> None:
    """Each fault passes at once, but so many in a row are too many; one whole motion starts the count again."""
    script = ["stalled", ""] * (MAX_BROKEN_MOTIONS - 1) + [""] * bool(whole) + ["stalled", ""] * MAX_BROKEN_MOTIONS
    scheduler, told = drive(["move"] * 20, ScriptedBody(script, ""))
    outcome = scheduler.view.latest(Outcome)
    assert outcome is not None and f"{MAX_BROKEN_MOTIONS} motions in a row" in outcome.value.reason
    moves = [e for e in told if isinstance(e.value, MotorCommand)]
    assert len(moves) == (2 * MAX_BROKEN_MOTIONS if whole else MAX_BROKEN_MOTIONS)


@given(st.integers(1, 4), st.lists(st.sampled_from(["", "link lost", "stalled"]), max_size=12), st.lists(st.booleans()))
def test_what_is_touched_is_told_once_and_with_the_motion_in_which_it_was(
    moves: int, script: list[str], touches: list[bool]
) -> None:
    """Also where that was broken off, and whatever is touched until it has recovered."""
    body = ScriptedBody(script, "", touches)
    scheduler, told = drive(["move"] * moves, body)
    commands = [e.ref for e in told if isinstance(e.value, MotorCommand)]
    contacts = [commands.index(e.because[0]) + 1 for e in told if isinstance(e.value, Contact)]
    if scheduler.view.latest(Outcome) is None:
        assert contacts == body.touched
