"""Laws of the goal sketcher: one sketch for a goal that has none, from where the robot is; else it sees no way on."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Revise
from generated_boards import Bench, effect_on, made, poses, reasons, to_world
from harvey.testing import HALL, STUDY, check_source, plain_robot
from knowledge_sources.methods.floor import revise_by_thing
from knowledge_sources.model.model_reviser import ModelReviser
from knowledge_sources.reads import find_frames
from knowledge_sources.reads.sketches import GOAL_TOLERANCE_M
from knowledge_sources.sketcher.goal_sketcher import GoalSketcher
from world_models.entries import (
    DoorPicture,
    DoorState,
    Impasse,
    Obstacle,
    Place,
    PlanSketch,
    SketchStatus,
)
from world_models.frames import Pose2

SOURCE = GoalSketcher()
AIM = Place(STUDY, 3.0, 2.0)


@settings(max_examples=25, deadline=None)
@given(poses, st.sampled_from((Place(HALL, 6.0, 1.5), AIM)))
def test_the_sketch_leads_from_the_robot_to_the_goal_step_by_step(pose: Pose2, aim: Place) -> None:
    bench = Bench(plain_robot())
    belief, goal = bench.believe(pose), bench.pursue(aim)
    effect = effect_on(bench.ask(SOURCE, goal), PlanSketch)
    drawn = effect.value
    assert (drawn.goal, drawn.path, drawn.locale, drawn.at, drawn.verified, drawn.status, drawn.halts) == (
        goal.id, (), "", 0, False, "active", 0)
    first, last = drawn.subgoals[0], drawn.subgoals[-1]
    assert (first.origin.locale, last.destination) == (HALL, aim) and last.tolerance_m == GOAL_TOLERANCE_M
    assert (first.origin.x_m, first.origin.y_m) == pytest.approx((pose.x_m, pose.y_m))
    passages = [step.passage for step in drawn.subgoals if step.passage]
    assert passages == (["study-door"] if aim.locale == STUDY else [])
    crossed = {place.locale for step in drawn.subgoals for place in (step.origin, step.destination)}
    assert reasons(effect) == {goal.id, belief.id, *(f.id for f in find_frames(bench.view, crossed))}
    bench.apply(*bench.ask(SOURCE, goal) or ())
    assert bench.ask(SOURCE, goal) is None


@pytest.mark.parametrize("basis", ["command", "odometry", "tracks", "milestone", "relocalization", "ride"])
def test_where_a_search_has_just_found_it_the_first_milestone_holds(basis: str) -> None:
    """The same look is not asked for twice; once it has moved, or was corrected otherwise, it is."""
    bench = Bench(plain_robot())
    bench.believe(basis=basis)
    drawn = effect_on(bench.ask(SOURCE, bench.pursue(AIM)), PlanSketch).value
    assert drawn.verified is (basis == "relocalization")


@pytest.mark.parametrize(("status", "halts"), [("halted", 4), ("superseded", 0)])
def test_halts_are_counted_in_a_row(status: SketchStatus, halts: int) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    goal = bench.pursue(AIM)
    old = bench.revise(bench.sketch(goal=goal), status=status, halts=3)
    effect = effect_on(bench.ask(SOURCE, old), PlanSketch)
    assert effect.value.halts == halts and old.id in reasons(effect)


def test_halts_on_the_way_to_another_goal_do_not_count() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    before = bench.pursue()
    old = bench.revise(bench.sketch(goal=before), status="halted", halts=2)
    bench.revise(before, status="abandoned")
    effect = effect_on(bench.ask(SOURCE, bench.pursue(AIM)), PlanSketch)
    assert effect.value.halts == 0 and old.id not in reasons(effect)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_only_what_takes_the_goal_is_behind_it_and_named(side: float) -> None:
    bench = Bench(plain_robot())
    belief = bench.believe(Pose2(1.0, 2.0, 0.0))
    other, thing = bench.stand(3.0, 2.0 - side, 0.1, 0.1), bench.stand(6.0, 2.0 + 0.7 * side, 0.2, 0.2)
    goal = bench.pursue(Place(HALL, 6.0, 2.0 + 0.7 * side))
    effect = effect_on(bench.ask(SOURCE, goal), Impasse)
    assert effect.value.behind == (thing.id,) and reasons(effect) == {goal.id, belief.id, thing.id}
    assert thing.value.words() in effect.value.reason and other.value.words() not in effect.value.reason


@pytest.mark.parametrize("is_shut", [False, True])
def test_where_no_way_is_left_it_says_what_leaves_none(is_shut: bool) -> None:
    """All that stands there, as each may be wrong; or the door that is shut, which nothing that stands is behind."""
    bench = Bench(plain_robot())
    if is_shut:
        picture = DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), 1.0, 2.0, 0.3, 4.0, "")
        door = bench.put(DoorState("study-door", (HALL, STUDY), "shut", 0.99, 5.0, 2, picture, 1.0))
        bench.apply(*bench.ask(ModelReviser(), door) or ())
    belief, things = bench.believe(Pose2(1.0, 2.0, 0.0)), [bench.stand(5.0, y, 0.2, 1.0) for y in (1.0, 3.0)]
    goal = bench.pursue(AIM)
    effect = effect_on(bench.ask(SOURCE, goal), Impasse)
    assert effect.value.behind == tuple(thing.id for thing in things)
    assert reasons(effect) == {goal.id, belief.id, *(thing.id for thing in things)}
    assert ("study-door is shut" in effect.value.reason) == is_shut
    assert all((thing.value.words() in effect.value.reason) != is_shut for thing in things)


def test_sketches_for_earlier_goals_are_superseded() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    before = bench.pursue()
    old = bench.sketch(goal=before)
    bench.revise(before, status="abandoned")
    goal = bench.pursue(AIM)
    ended, drawn = made(bench.ask(SOURCE, goal), PlanSketch)
    assert (ended.goal, ended.status, drawn.goal) == (before.id, "superseded", goal.id) and old.value.is_active


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("from_wall_m", "fits"), [(0.1, False), (1.0, True)])
def test_where_the_robot_does_not_fit_at_the_goal_it_sees_no_way_on(
    side: float, from_wall_m: float, fits: bool
) -> None:
    """At the wall on either side."""
    bench = Bench(plain_robot())
    belief = bench.believe(Pose2(1.0, 2.0, 0.0))
    goal = bench.pursue(Place(HALL, 6.0, 2.0 + side * (2.0 - from_wall_m)))
    effects = bench.ask(SOURCE, goal)
    assert bool(made(effects, PlanSketch)) == fits
    if not fits:
        effect = effect_on(effects, Impasse)
        assert (effect.value.kind, effect.value.goal, effect.value.behind) == ("blocked", goal.id, ())
        assert effect.value.is_open and reasons(effect) == {goal.id, belief.id}


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("off_m", "is_taken"), [(0.2, True), (1.2, False)])
def test_a_goal_that_is_occupied_is_called_so(side: float, off_m: float, is_taken: bool) -> None:
    """By the frame of its room, in which the thing is by its name."""
    bench = Bench(plain_robot())
    bench.believe(Pose2(1.0, 2.0, 0.0))
    goal = bench.pursue(Place(HALL, 6.0, 2.0))
    y_m = 2.0 + side * off_m
    corners: Any = tuple(tuple(to_world(Pose2(6.0 + dx, y_m + dy, 0.0)).position.tolist())
                         for dx, dy in ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)))
    thing = bench.put(Obstacle(f"{HALL}/obstacle-1", HALL, corners, 0.02, 6.0, y_m, 0.2))
    frame = bench.frame()
    bench.apply(Revise(frame, revise_by_thing(frame.value, thing.value, "test", 0.0), (frame, thing)))
    effects = bench.ask(SOURCE, goal)
    assert bool(made(effects, Impasse)) is is_taken
    if is_taken:
        effect = effect_on(effects, Impasse)
        assert "is occupied by something 0.2 m wide" in effect.value.reason and effect.value.behind == (thing.id,)


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    check_source(SOURCE, bench, bench.pursue(AIM))
