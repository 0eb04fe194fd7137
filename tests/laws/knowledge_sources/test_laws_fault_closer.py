"""Law of a fault that is over: it is closed; a motion that it broke off is a doubt, too many in a row are the end."""

from __future__ import annotations

from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acting import answer
from blackboard.board import Blackboard
from blackboard.change import Posted, Revised
from blackboard.effect import Post, Revise
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.action.fault_closer import FaultCloser
from knowledge_sources.settings import DEFAULT
from world_models.entries.body import BodyFault, Course, MotorCommand, PictureRequest, Recovery, RecoveryStatus
from world_models.entries.task import Impasse, Outcome

SOURCE, MOST = FaultCloser(), DEFAULT.action.max_broken_motions
REQUESTS = (MotorCommand(0.1, 0.5), Course("Leg-1", 0.4, 0.0), PictureRequest("track"))
steps = st.lists(st.tuples(st.sampled_from(REQUESTS), st.booleans()), min_size=1, max_size=2 * MOST)
"""What was asked for, in order, and whether it was broken off."""


@pytest.mark.parametrize("status", get_args(RecoveryStatus))
def test_it_wakes_when_a_recovery_worked(status: Any) -> None:
    value = Recovery("BodyFault-1", "MotorCommand-1", 1.0, 0.1, status=status)
    (change,) = Blackboard().apply([Post(value)], author="test", cycle=1)
    (watch,) = SOURCE.on
    assert watch.sees(Revised(change.entry)) == (status == "over")
    assert not watch.sees(Posted(change.entry))


@given(steps, st.booleans())
@settings(max_examples=200)
def test_what_was_broken_off_is_a_doubt_and_so_many_in_a_row_are_the_end(
    drawn: list[tuple[Any, bool]], has_ended: bool
) -> None:
    board, in_a_row = Blackboard(), 0
    for cycle, (request, is_broken) in enumerate([*drawn[:-1], (drawn[-1][0], True)], 1):
        (asked,) = board.apply([Post(request)], author="test", cycle=cycle)
        if is_broken:
            fault = BodyFault("base", "stalled", "so it was", asked.entry.id, 1.0)
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
