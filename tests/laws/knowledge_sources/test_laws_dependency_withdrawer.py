"""Laws of the dependency withdrawer: a revised frame takes with it exactly what rested on what it no longer says."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Blackboard, Entry, Post, Revise, Revised, View
from generated_boards import Bench, made, reasons, to_world
from harvey.testing import HALL, STUDY, answer, check_source, plain_robot
from knowledge_sources.methods.motion import CLEARANCES_M
from knowledge_sources.methods.motion.ways_left import LEG_SLACK_M
from knowledge_sources.model.dependency_withdrawer import dependency_withdrawer
from world_models.building.locale_frame import FrameChange, LocaleFrame
from world_models.entries import Milestone, Obstacle, Place, PlanSketch, Subgoal, Track, Tracks, UserReport
from world_models.entries.task import MilestoneStatus
from world_models.frames import Pose2

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
    answered = answer(dependency_withdrawer, View(board), trigger)
    assert (answered is not None) == bool(expected)
    effects: list[Any] = list(answered or ())
    assert {e.entry.id for e in effects if e.value.__class__ is Milestone} == expected
    assert all(e.value.status == "withdrawn" for e in effects if isinstance(e.value, Milestone))
    sketches = [e.value for e in effects if isinstance(e.value, PlanSketch)]
    assert [s.verified for s in sketches] == [False] * is_unverified
    assert all(frame in effect.because for effect in effects)


# What blocks a way, or has led round it: on boards of the plain house, the sketch along the middle of the hall.

LEAST_M, MOST_M = CLEARANCES_M[-1], CLEARANCES_M[0]
RADIUS_M = plain_robot().radius_m
SMALL = 1e-3
FROM, MIDDLE, TO = Place(HALL, 1.0, 2.0), Place(HALL, 4.0, 2.0), Place(HALL, 7.0, 2.0)


def square(x_m: float, y_m: float) -> tuple[tuple[float, float], ...]:
    """The corners, 20 cm apart, of something round a place in the hall [m, world]."""
    return tuple(to_world(Pose2(x_m + dx, y_m + dy, 0.0)).position
                 for dx, dy in ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)))


def revise_for(
    x_m: float, y_m: float, *, at: int = 0, status: str = "there", locale: str = HALL, here: Pose2 | None = None,
    primitive: bool = True, touched_s: float | None = None, has_goal: bool = True,
) -> set[str]:
    """The ids of the sketches that are superseded for a thing in the hall, of one that leads by its middle."""
    bench = Bench(plain_robot())
    bench.believe(here or Pose2(1.0, 2.0, 0.0))
    sketch = bench.sketch(FROM, MIDDLE, TO, at=at, primitive=primitive)
    if not has_goal:
        bench.revise(bench.view[sketch.value.goal], status="abandoned")
    thing = bench.put(Obstacle("hall/obstacle-1", locale, square(x_m, y_m), 0.05, x_m, y_m, 0.2, seen_s=3.0,
                               touched_s=touched_s, status=status))  # type: ignore[arg-type]
    changed, frame = FrameChange("extra", thing.value.name, "test", square(x_m, y_m)), bench.frame()
    (revised,) = bench.apply(Revise(frame, replace(frame.value, changes=(changed,)), (frame, thing)))
    effects = bench.ask(dependency_withdrawer, revised.entry)
    assert all(reasons(effect) == {frame.id} for effect in effects or ())
    assert all(s.status == "superseded" for s in made(effects, PlanSketch))
    return {effect.entry.id for effect in effects or () if not isinstance(effect, Post)}


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("more_m", [-SMALL, SMALL])
def test_a_thing_that_is_nearer_to_the_way_than_the_least_clearance_blocks_it(side: float, more_m: float) -> None:
    """Less a slack: what is found where it was believed does not send the robot another way."""
    reach_m = RADIUS_M + LEAST_M - LEG_SLACK_M + 0.1
    assert bool(revise_for(5.5, 2.0 + side * (reach_m + more_m))) == (more_m < 0.0)


@pytest.mark.parametrize("more_m", [-SMALL, SMALL])
def test_a_thing_that_is_gone_had_led_the_way_where_a_subgoal_is_near_to_it(more_m: float) -> None:
    reach_m = RADIUS_M + MOST_M + LEG_SLACK_M + 0.1
    for x_m in (FROM.x_m, MIDDLE.x_m, TO.x_m):
        assert bool(revise_for(x_m, 2.0 + reach_m + more_m, status="gone")) == (more_m < 0.0)
    assert not revise_for(5.5, 2.0, status="gone")  # between subgoals nothing turned for it


def test_only_what_is_left_of_the_way_counts() -> None:
    assert revise_for(2.5, 2.0) and not revise_for(2.5, 2.0, at=1, here=Pose2(4.0, 2.0, 0.0))
    assert not revise_for(2.5, 2.0, here=Pose2(3.2, 2.0, 0.0))  # of the leg under way, what is before the robot
    assert revise_for(5.5, 2.0, at=1, here=Pose2(4.0, 2.0, 0.0))
    assert not revise_for(5.5, 2.0, locale=STUDY)
    assert not revise_for(5.5, 2.0, has_goal=False)
    assert revise_for(TO.x_m, 2.0, primitive=False)  # of a step that is not drawn yet only the end counts
    assert not revise_for(5.5, 2.0, primitive=False)


@pytest.mark.parametrize(("touched_s", "is_blocked"), [(3.0, True), (2.0, False), (None, False)])
def test_where_the_robot_touches_it_now_the_way_is_blocked_wherever_it_leads(
    touched_s: float | None, is_blocked: bool
) -> None:
    assert bool(revise_for(5.5, 3.5, touched_s=touched_s)) == is_blocked


@pytest.mark.parametrize("passage", ["study-door", "other-door"])
@pytest.mark.parametrize("at", [0, 1])
@pytest.mark.parametrize("is_found", [False, True])
def test_a_way_through_a_door_that_was_found_shut_is_drawn_anew(passage: str, at: int, is_found: bool) -> None:
    """Also where a thing that is not on the way comes into the frame at once."""
    bench = Bench(plain_robot())
    bench.believe()
    goal = bench.pursue(Place(STUDY, 3.0, 2.0))
    steps = (Subgoal(FROM, Place(STUDY, 1.0, 2.0), primitive=False, passage=passage),
             Subgoal(Place(STUDY, 1.0, 2.0), Place(STUDY, 3.0, 2.0), primitive=True))
    sketches = [bench.put(PlanSketch(goal.id, path, "", steps, at)) for path in ((), (0,))]
    done = bench.put(PlanSketch(goal.id, (), "", steps, 0, status="done"))
    shut = (FrameChange("shut", "study-door", "test"),)
    far = to_world(Pose2(0.6, 3.6, 0.0)).position
    box = tuple((float(far[0] + x), float(far[1] + y)) for x, y in ((0.0, 0.0), (0.1, 0.0), (0.0, 0.1)))
    thing = Obstacle("hall/obstacle-1", HALL, box, 0.02, 0.6, 3.6, 0.1)
    told, frame = [bench.put(said) for said in (UserReport("study-door", "shut"), thing)[:1 + is_found]], bench.frame()
    (revised,) = bench.apply(Revise(frame, replace(frame.value, changes=shut), (frame, *told)))
    effects = bench.ask(dependency_withdrawer, revised.entry)
    misled = passage == "study-door" and at == 0
    ids = {effect.entry.id for effect in effects or () if not isinstance(effect, Post)}
    assert ids == ({sketch.id for sketch in sketches} if misled else set()) and done.id not in ids


@pytest.mark.parametrize(("what", "locale", "is_drawn_anew"), [
    ("gone", HALL, True), ("extra", HALL, True), ("removed", HALL, False), ("", HALL, True), ("gone", STUDY, False)])
def test_a_way_across_a_room_that_was_rearranged_is_drawn_anew(what: Any, locale: str, is_drawn_anew: bool) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.sketch(FROM, MIDDLE, TO)
    changed = (FrameChange(what, f"{locale}/desk", "test"),) if what else ()
    effects = bench.ask(dependency_withdrawer, bench.revise(bench.frame(locale), changes=changed))
    assert bool(made(effects, PlanSketch)) == is_drawn_anew


def test_landmarks_that_are_gone_are_not_followed_and_the_others_are() -> None:
    bench = Bench(plain_robot())
    names = ("hall/desk-1", "hall/desk-1/top", "hall/desk-10", "hall/rack")
    items = tuple(Track(name, (0.0, 0.0, 0.0), "CameraPicture-1", (0.0, 0.0), 1.0, (0.0, 0.0), None, 0.0, 1.0)
                  for name in names)
    tracks = bench.put(Tracks("CameraPicture-1", 9, items, (), 4))
    frame = bench.frame()
    for thing, kept in (("hall/desk-1", names[2:]), ("hall/rack", names[:3]), ("hall/lamp", names)):
        changed = replace(frame.value, changes=(FrameChange("gone", thing, "test"),))
        revised = Entry(frame.id, 1, changed, "test", 99)
        effects = answer(dependency_withdrawer, bench.view, Revised(revised))
        assert (effects is None) == (kept == names)
        for effect in effects or ():
            assert not isinstance(effect, Post) and effect.entry is tracks and effect.because == (revised,)
            assert effect.value == replace(tracks.value, items=tuple(t for t in items if t.landmark in kept))


def test_a_milestone_of_a_sketch_that_is_drawn_anew_is_not_awaited() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    sketch = bench.sketch(FROM, TO)
    awaited, other = bench.await_milestone(sketch.id, 0), bench.await_milestone("PlanSketch-9", 0)
    gone = (FrameChange("gone", "hall/desk", "test"),)
    effects = bench.ask(dependency_withdrawer, bench.revise(bench.frame(), changes=gone))
    ids = {effect.entry.id for effect in effects or () if not isinstance(effect, Post)}
    assert ids == {awaited.id, sketch.id} and other.id not in ids


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.sketch(FROM, MIDDLE, TO)
    gone = (FrameChange("gone", "hall/desk", "test"),)
    check_source(dependency_withdrawer, bench, bench.revise(bench.frame(), changes=gone))
