"""Laws of faults: each open one is waited for, ever longer, until the patience is at its end or somebody stops it.

One that is over is closed; a motion that it broke off is a doubt, too many in a row are the end.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Blackboard, Entry, Level, Post, Posted, Revise, Revised
from generated_boards import Bench, made
from harvey.testing import answer, check_source, plain_robot
from knowledge_sources.action.fault_handler import (
    MAX_BROKEN_MOTIONS,
    MAX_FAULT_S,
    MAX_RETRY_WAIT_S,
    MIN_RETRY_WAIT_S,
    FaultHandler,
)
from knowledge_sources.action.motor import Motor
from knowledge_sources.settings import DEFAULT
from world_models.entries import (
    GO_ON,
    STOP_KEY,
    BodyFault,
    Command,
    Contact,
    Course,
    Discrepancy,
    Impasse,
    MotorCommand,
    Outcome,
    PictureRequest,
    Recovery,
    Redirection,
    Ride,
    diagonal,
)
from world_models.entries.body import RecoveryStatus

SOURCE, S = FaultHandler(), DEFAULT.action
MOST = MAX_BROKEN_MOTIONS
REQUESTS = (MotorCommand(0.1, 0.5), Course("Leg-1", 0.4, 0.0), PictureRequest("track"))
steps = st.lists(st.tuples(st.sampled_from(REQUESTS), st.booleans()), min_size=1, max_size=2 * MOST)
"""What was asked for, in order, and whether it was broken off."""
PATIENCE_S = MAX_FAULT_S
waits_s = st.sampled_from((0.05, 0.3, 1.0, MAX_RETRY_WAIT_S))
whats = st.sampled_from(("link lost", STOP_KEY))
recoveries = st.none() | st.builds(
    Recovery, st.just(""), st.just("MotorCommand-1"), st.just(1.0), waits_s, st.just(2),
    st.sampled_from((0.0, 0.5 * PATIENCE_S, PATIENCE_S, 2.0 * PATIENCE_S)),
    st.sampled_from(get_args(RecoveryStatus)), whats, st.just("so it was found"))
faults = st.lists(st.tuples(whats, st.booleans(), recoveries), min_size=1, max_size=3)
"""What is wrong, whether it is over, and what was tried."""
ends = st.sampled_from((None, Outcome("failed", ""), Impasse("failed", ""), Impasse("blocked", "", behind=("x",)),
                        Impasse("blocked", "", behind=("x",), is_open=False)))


@pytest.mark.parametrize("asks", [False, True])
@pytest.mark.parametrize("stop", [
    Contact("bumper", 0.0, 0.2, 3.0), BodyFault("base", "stopped", "", "", 3.0, status="over")])
def test_after_a_stop_it_waits_until_somebody_says_go_on(asks: bool, stop: Any) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.put(Command("", 0.0, None, diagonal(0.01, 0.01), asks))
    found, leg = bench.put(stop), bench.leg(bench.sketch())
    effects = bench.ask(SOURCE, found)
    assert (effects is not None) == asks and (bench.ask(Motor(), leg) is None) == asks
    if effects is not None:
        (wait,) = bench.apply(*effects)
        assert wait.entry.value == Recovery(found.id, "", 3.0, 1.0) and bench.ask(SOURCE, found) is None
        again = bench.ask(SOURCE, bench.revise(wait.entry, status="still failing"))
        assert [value.status for value in made(again, Recovery)] == ["asked"]
        told = bench.revise(bench.put(Redirection(GO_ON)), answer="and does")
        assert [(d.level, d.magnitude) for d in made(bench.ask(SOURCE, told), Discrepancy)] == [(Level.PLAN, None)]
        bench.doubt()
        assert made(bench.ask(SOURCE, told), PictureRequest) == [PictureRequest("probe")]


@given(faults, ends)
@settings(max_examples=300)
def test_the_oldest_open_fault_for_which_nobody_waits_is_answered(drawn: list[Any], end: Any) -> None:
    board = Blackboard()
    unanswered: list[tuple[Any, Any]] = []
    for what, is_over, recovery in drawn:
        status: Any = "over" if is_over else "open"
        fault = BodyFault("base", what, "as it was noticed", "MotorCommand-1", 1.0, status=status)
        (change,) = board.apply([Post(fault)], author="test", cycle=1)
        tried = None
        if recovery is not None:
            (tried_change,) = board.apply([Post(replace(recovery, fault=change.entry.id))], author="test", cycle=1)
            tried = tried_change.entry
        if not is_over and (tried is None or tried.value.status != "asked"):
            unanswered.append((change.entry, tried))
    if end is not None:
        board.apply([Post(end)], author="test", cycle=1)
    is_given_up = isinstance(end, Outcome) or (isinstance(end, Impasse) and end.kind == "failed")
    effects = answer(SOURCE, board.view, Posted(change.entry))
    assert (effects is not None) == (bool(unanswered) and not is_given_up)
    if effects is None:
        return
    (effect, *more), (fault, tried) = effects, unanswered[0]
    if tried is not None and tried.value.status == "over":
        assert isinstance(effect, Revise) and effect.entry is fault and effect.value.status == "over"
        return
    assert more == []
    assert list(effect.because) == [entry for entry in (fault, tried) if entry is not None]
    if fault.value.what == STOP_KEY or (tried is not None and tried.value.what == STOP_KEY):
        detail = fault.value.detail if tried is None else tried.value.detail
        assert effect.value == Impasse("stopped", detail)
    elif tried is None:
        assert effect == Post(Recovery(fault.id, "MotorCommand-1", 1.0, MIN_RETRY_WAIT_S), effect.because)
    elif tried.value.waited_s >= PATIENCE_S:
        assert effect.value.kind == "failed" and fault.value.what in effect.value.reason
    else:
        assert isinstance(effect, Revise) and effect.entry is tried
        wait_s = min(2.0 * tried.value.wait_s, MAX_RETRY_WAIT_S)
        assert effect.value == replace(tried.value, status="asked", wait_s=wait_s)


@given(st.sampled_from((0.0, 0.99, 1.0, 2.0)), st.sampled_from(("", "nobody comes by")))
def test_an_elevator_that_does_not_come_is_named(part: float, detail: str) -> None:
    """It blocks the way, as long as it was called without success for long enough; what the last try found counts."""
    board = Blackboard()

    def put(value: Any) -> Entry[Any]:
        return board.apply([Post(value)], author="test", cycle=1)[0].entry

    ride = put(Ride("PlanSketch-1", 1, "lift-a", "car-1", "car-2"))
    fault = put(BodyFault("elevator", "no ride", "first", ride.id, 1.0))
    tried = put(Recovery(fault.id, ride.id, 1.0, 1.0, 3, part * PATIENCE_S, "still failing", "no ride", detail))
    (effect,) = answer(SOURCE, board.view, Revised(tried)) or ()
    if part < 1.0:
        assert isinstance(effect, Revise) and effect.value.status == "asked"
        return
    assert isinstance(effect, Post) and effect.value.kind == "blocked" and effect.value.is_open
    assert all(word in effect.value.reason for word in ("lift-a", "car-1", "car-2", detail or "first"))


@given(steps, st.booleans())
@settings(max_examples=200)
def test_what_was_broken_off_is_a_doubt_and_so_many_in_a_row_are_the_end(
    drawn: list[tuple[Any, bool]], has_ended: bool
) -> None:
    board, in_a_row = Blackboard(), 0
    for cycle, (request, is_broken) in enumerate([*drawn[:-1], (drawn[-1][0], True)], 1):
        (asked,) = board.apply([Post(request)], author="test", cycle=cycle)
        if is_broken:
            status: Any = "open" if cycle == len(drawn) else "over"
            fault = BodyFault("base", "stalled", "so it was", asked.entry.id, 1.0, status=status)
            (noticed,) = board.apply([Post(fault)], author="test", cycle=cycle)
        if not isinstance(request, PictureRequest):
            in_a_row = in_a_row + 1 if is_broken else 0
    recovery = Recovery(noticed.entry.id, asked.entry.id, 1.0, 0.1, status="over")
    (tried,) = board.apply([Post(recovery)], author="test", cycle=98)
    if has_ended:
        board.apply([Post(Outcome("failed", ""))], author="test", cycle=99)
    effects = answer(SOURCE, board.view, Revised(tried.entry))
    assert (effects is None) == has_ended
    if effects is None:
        return
    closed, *more = effects
    assert isinstance(closed, Revise) and closed.entry is noticed.entry and closed.value.status == "over"
    assert tuple(closed.because) == (tried.entry,)
    if isinstance(drawn[-1][0], PictureRequest):
        assert more == []
        return
    (told,) = more
    if in_a_row >= MOST:
        assert isinstance(told.value, Impasse) and told.value.kind == "failed" and tuple(told.because) == (closed,)
    else:
        bound_px = DEFAULT.plan.max_deviation_px
        assert isinstance(told.value, Discrepancy) and tuple(told.because) == (closed, tried.entry)
        assert (told.value.level, told.value.magnitude) == (Level.PLAN, None)
        assert told.value.bounds == (bound_px, bound_px) and asked.entry.id in told.value.what


def test_a_fault_that_is_forgotten_is_not_closed() -> None:
    (tried,) = Blackboard().apply([Post(Recovery("BodyFault-9", "x", 1.0, 0.1, status="over"))], author="t", cycle=1)
    assert answer(SOURCE, Blackboard().view, Revised(tried.entry)) is None


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    check_source(SOURCE, bench, bench.put(BodyFault("base", "link lost", "", "MotorCommand-1", 1.0)))
