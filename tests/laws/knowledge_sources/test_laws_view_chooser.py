"""Laws of the view chooser: when a milestone is due, and in which direction it is looked for."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Effect, Entry, Level
from generated_boards import Bench, effect_on, mirrored, mirrored_place, poses, reasons, to_world
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.verification import turn_headings
from knowledge_sources.milestone_selector.view_chooser import LONG_TURN_RAD, ViewChooser
from knowledge_sources.reads import MAX_LOOK_ERROR_RAD
from world_models.entries import Milestone, Place, PlanSketch, Subgoal
from world_models.entries.task import MilestoneStatus
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2, wrap_angle

HALL, LONG_TURN, SMALL = "north-hall", LONG_TURN_RAD, 1e-6
HERE, LENGTH_M, TOLERANCE_M = Place(HALL, 2.0, 1.2), 1.0, 0.1


def first_direction(turn_rad: float, length_m: float = LENGTH_M, *, primitive: bool = True) -> float:
    """In which direction it looks first where the next leg leads aside by this [rad from the present heading]."""
    world = load_world(WORLDS / "two_ways.toml")
    facing = 0.7
    along = facing + turn_rad
    end = Place(HALL, HERE.x_m + length_m * math.cos(along), HERE.y_m + length_m * math.sin(along))
    leg = Subgoal(HERE, end, primitive=primitive, tolerance_m=TOLERANCE_M)
    here = HERE.in_world(world)
    pose = Pose2(here.x_m, here.y_m, facing)
    sketch = PlanSketch("Goal-1", (), HALL if primitive else "", (leg,))
    return next(ViewChooser().list_headings(world, sketch, pose)) - facing


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_before_a_long_turn_it_looks_along_the_leg_and_else_ahead(side: float) -> None:
    assert first_direction(side * (LONG_TURN - SMALL)) == 0.0
    assert first_direction(side * (LONG_TURN + SMALL)) == pytest.approx(side * (LONG_TURN + SMALL))


def test_where_there_is_nothing_to_drive_as_it_is_it_looks_ahead() -> None:
    assert first_direction(2.0, TOLERANCE_M - SMALL) == first_direction(2.0, primitive=False) == 0.0
    assert first_direction(2.0, TOLERANCE_M + SMALL) == pytest.approx(2.0)


SOURCE = ViewChooser()
TURN = to_world(Pose2(0.0, 0.0, 0.0)).heading_rad
"""Of the hall in the world."""
FROM, TO, AHEAD = Place("hall", 2.0, 2.0), Place("hall", 6.0, 2.0), Pose2(2.0, 2.0, 0.0)


def due(pose: Pose2 = AHEAD, *, at: int = 0, to: Place = TO) -> tuple[Bench, Entry[PlanSketch]]:
    """A board on which a milestone is due."""
    bench = Bench(plain_robot())
    bench.believe(pose)
    return bench, bench.sketch(FROM, to, at=at, verified=False)


def milestone_of(effects: tuple[Effect, ...] | None) -> Milestone:
    value: Milestone = effect_on(effects, Milestone).value
    return value


@settings(max_examples=25)
@given(poses, st.sampled_from((0, 1)))
def test_it_looks_in_one_of_the_directions_that_come_into_question(pose: Pose2, at: int) -> None:
    bench, sketch = due(pose, at=at)
    effects = bench.ask(SOURCE, sketch)
    chosen = milestone_of(effects)
    here = to_world(pose)
    headings = list(SOURCE.list_headings(plain_robot().world, sketch.value, here))
    assert any(abs(wrap_angle(chosen.look_heading_rad - h)) <= MAX_LOOK_ERROR_RAD for h in headings)
    if abs(wrap_angle(chosen.look_heading_rad - here.heading_rad)) <= MAX_LOOK_ERROR_RAD:
        assert chosen.look_heading_rad == pytest.approx(here.heading_rad)
    assert (chosen.sketch, chosen.index, chosen.status, chosen.tried, chosen.log_odds_so_far) == (
        sketch.id, at, "turning", (), ())
    assert reasons(effect_on(effects, Milestone)) == {sketch.id, "Hypothesis-1"}


@pytest.mark.parametrize("ahead", [0.3, math.pi - TURN, math.pi - TURN - 0.01, math.pi - TURN + 0.01, -2.9])
@pytest.mark.parametrize("off", [-0.5, 0.5, -0.9, 0.9, -1.1, 1.1])
def test_a_direction_that_the_robot_faces_already_is_the_one_that_it_faces(ahead: float, off: float) -> None:
    """Also where the numbers of both lie a whole turn apart."""
    pose = Pose2(2.0, 2.0, wrap_angle(ahead))
    wanted = wrap_angle(ahead + off * MAX_LOOK_ERROR_RAD)
    bench, sketch = due(pose, at=1, to=Place("hall", 2.0, 2.0, wanted))
    one = ViewChooser()
    one.list_headings = lambda *_: iter([wanted + TURN])  # type: ignore[method-assign]
    chosen = milestone_of(bench.ask(one, sketch)).look_heading_rad
    assert wrap_angle(chosen - (to_world(pose).heading_rad if abs(off) < 1.0 else wanted + TURN)) == pytest.approx(0.0)


@settings(max_examples=25)
@given(poses, st.floats(-1.2, 1.2))
def test_the_directions_of_the_mirrored_board_are_mirrored(pose: Pose2, wanted: float) -> None:
    """In the same order but for those all round, which begin on one side."""
    listed = []
    hall = to_world(Pose2(0.0, 0.0, 0.0)).heading_rad
    for here, to in ((pose, Place("hall", 6.0, 1.3, wanted)),
                     (mirrored(pose), mirrored_place(Place("hall", 6.0, 1.3, wanted)))):
        _, sketch = due(here, at=1, to=to)
        found = list(SOURCE.list_headings(plain_robot().world, sketch.value, to_world(here)))
        around = len(turn_headings(to_world(here)))
        listed.append([wrap_angle(h - hall) for h in found[:len(found) - around]])
    one, other = listed
    assert one and [wrap_angle(a + b) for a, b in zip(one, other, strict=True)] == pytest.approx([0.0] * len(one))


@pytest.mark.parametrize("status", ["not testable", "verified", "refuted", "withdrawn"])
@pytest.mark.parametrize("same", ["same", "another sketch", "another index"])
def test_where_the_same_milestone_was_not_testable_it_looks_elsewhere(status: MilestoneStatus, same: str) -> None:
    bench, sketch = due()
    before = (0.4, 1.4)
    last = bench.await_milestone(sketch.id if same != "another sketch" else "PlanSketch-9",
                                 0 if same != "another index" else 1, look_heading_rad=0.5, tried=before)
    assert bench.ask(SOURCE, sketch) is None  # it is looked for already
    bench.revise(last, status=status)
    chosen = milestone_of(bench.ask(SOURCE, sketch))
    tried = (*before, 0.5) if (status, same) == ("not testable", "same") else ()
    assert chosen.tried == tried
    for heading in tried:
        assert abs(wrap_angle(chosen.look_heading_rad - heading)) > MAX_LOOK_ERROR_RAD


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench, sketch = due()
    bench.doubt(Level.PLAN, 3.0)  # measured within its bound, it does not keep it from looking
    check_source(SOURCE, bench, sketch, without=("Goal-1",))
