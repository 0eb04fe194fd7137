"""Law of what a revised frame takes with it: on drawn boards, exactly what rested on it, against a plain listing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, get_args

from hypothesis import given, settings
from hypothesis import strategies as st

from acting import answer
from blackboard.board import Blackboard, View
from blackboard.change import Revised
from blackboard.effect import Post, Revise
from blackboard.entry import Entry
from knowledge_sources.action.dependency_withdrawer import DependencyWithdrawer
from world_models.building.locale_frame import FrameChange, LocaleFrame
from world_models.entries.task import Milestone, MilestoneStatus, PlanSketch

THINGS = ("study/table-1", "study/table-10", "study/rack-1")
LANDMARKS = (*THINGS, "study/table-1/top")
changes = st.lists(st.builds(
    FrameChange, st.sampled_from(("gone", "removed", "shut")), st.sampled_from(THINGS), st.just("test")), max_size=2)
milestones = st.lists(st.tuples(
    st.just("verified") | st.sampled_from(get_args(MilestoneStatus)),
    st.sampled_from((None, "before", "between", "after", "other")),
    st.lists(st.sampled_from(LANDMARKS), max_size=1), st.sampled_from((0, 1))), min_size=1, max_size=3)
"""Status, what of a frame it rests on, its landmarks, and its number in the sketch."""


def make_frame(name: str, changed: tuple[FrameChange, ...] = ()) -> LocaleFrame:
    """A frame of which only name and changes are read here."""
    nothing: Any = None
    locale: Any = SimpleNamespace(name=name, parent=None)
    return LocaleFrame("world", locale, nothing, (), (), (), (), (), (), (), changed)


def put(board: Blackboard, *effects: Any) -> Entry[Any]:
    return board.apply(effects, author="test", cycle=0)[-1].entry


@given(milestones, changes, st.booleans(), st.booleans())
@settings(max_examples=500, deadline=None)
def test_what_rested_on_a_frame_is_withdrawn_and_nothing_else(
    drawn: list[Any], changed: list[FrameChange], is_active: bool, is_verified: bool
) -> None:
    board = Blackboard()
    board_sketch = put(board, Post(PlanSketch("Goal-1", (), "", (), at=1, verified=is_verified,
                                              status="active" if is_active else "done")))
    other = put(board, Post(make_frame("parlour")))
    before = put(board, Post(make_frame("study")))
    between = put(board, Revise(before, make_frame("study")))
    reasons = {"before": before, "between": between, "other": other}
    frame = put(board, Revise(between, make_frame("study", tuple(changed))))
    board.apply([Revise(other, make_frame("parlour"))], author="test", cycle=0)
    posted = []
    for status, rests_on, landmarks, index in drawn:
        because = () if rests_on is None else ({**reasons, "after": frame}[rests_on],)
        value = Milestone(board_sketch.id, index, "a place", 0.0, tuple(landmarks), status=status)
        posted.append(put(board, Post(value, because)))
    gone = [change.name for change in changed if change.what in ("gone", "removed")]
    expected, is_unverified = set(), False
    for entry, (status, rests_on, landmarks, index) in zip(posted, drawn, strict=True):
        is_lost = any(f"{landmark}/".startswith(f"{thing}/") for landmark in landmarks for thing in gone)
        if (status in ("turning", "expected") and rests_on in ("before", "between")) or (
            status == "verified" and is_lost
        ):
            expected.add(entry.id)
            is_unverified |= status == "verified" and is_active and is_verified and index == 1
    trigger = Revised(frame)
    answered = answer(DependencyWithdrawer(), View(board), trigger)
    assert (answered is not None) == bool(expected)
    effects: list[Any] = list(answered or ())
    assert {e.entry.id for e in effects if e.value.__class__ is Milestone} == expected
    assert all(e.value.status == "withdrawn" for e in effects if isinstance(e.value, Milestone))
    sketches = [e.value for e in effects if isinstance(e.value, PlanSketch)]
    assert [s.verified for s in sketches] == [False] * is_unverified
    assert all(frame in effect.because for effect in effects)
