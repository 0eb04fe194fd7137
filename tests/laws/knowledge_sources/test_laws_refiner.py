"""Laws of the refiner: the current subgoal, once its milestone holds, is drawn in more detail, once."""

from __future__ import annotations

import pytest
from hypothesis import given, settings

from blackboard import Entry
from generated_boards import Bench, effect_on, made, poses, reasons
from harvey.testing import HALL, HOUSE, STUDY, check_source, plain_robot
from knowledge_sources.sketcher.refiner import Refiner
from world_models.entries import Impasse, Place, PlanSketch, Subgoal
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2

SOURCE = Refiner()
WAY = (Place(HALL, 1.0, 2.0), Place(HALL, 4.0, 2.0), Place(HALL, 6.5, 2.5))


@settings(max_examples=20, deadline=None)
@given(poses)
def test_a_subgoal_becomes_straight_legs_from_the_robot_to_its_end(pose: Pose2) -> None:
    for at in (0, 1):
        bench = Bench(plain_robot())
        belief = bench.believe(pose)
        sketch = bench.sketch(*WAY, at=at, primitive=False, path=(3,))
        effect = effect_on(bench.ask(SOURCE, sketch), PlanSketch)
        drawn = effect.value
        assert (drawn.goal, drawn.path, drawn.locale) == (sketch.value.goal, (3, at), HALL)
        assert (drawn.at, drawn.verified, drawn.status) == (0, False, "active")
        assert all(step.primitive for step in drawn.subgoals)
        first, last = drawn.subgoals[0].origin, drawn.subgoals[-1].destination
        assert (first.x_m, first.y_m) == pytest.approx((pose.x_m, pose.y_m))
        assert (last.x_m, last.y_m) == pytest.approx((WAY[at + 1].x_m, WAY[at + 1].y_m))
        assert {sketch.id, belief.id} <= reasons(effect)
        bench.apply(*bench.ask(SOURCE, sketch) or ())
        assert bench.ask(SOURCE, sketch) is None


@pytest.mark.parametrize("rooms", [(HALL, STUDY), (STUDY, HALL)])
def test_a_subgoal_in_another_locale_is_drawn_by_the_door_that_leads_there(rooms: tuple[str, str]) -> None:
    bench, (here, there) = Bench(plain_robot()), (Place(room, 4.0, 2.0) for room in rooms)
    bench.believe(Pose2(4.0, 2.0, 0.0), locale=here.locale)
    drawn = effect_on(bench.ask(SOURCE, bench.sketch(here, there, primitive=False)), PlanSketch).value
    assert "study-door" in {step.passage for step in drawn.subgoals}


TWO_DOORS = HOUSE + """
other-door = { between = ["hall", "study"], wall = "east", along = 0.7, width = 1.0, open = true }
"""


def blocked(doors: int, *, at: int = 0) -> tuple[Bench, Entry[PlanSketch]]:
    """A board on which the way to a door is blocked in the hall, and something else stands in the study.

    The sketch led through another passage before.
    """
    world = read_world(Source.parse(TWO_DOORS if doors == 2 else HOUSE, "house.toml"))
    bench = Bench(plain_robot(world))
    bench.believe(Pose2(6.0, 2.8, 0.0))
    goal = bench.pursue(Place(STUDY, 4.0, 2.0))
    here, before, behind = Place(HALL, 6.0, 2.8), Place(HALL, 7.35, 2.0), Place(STUDY, 0.65, 2.0)
    came = Subgoal(here, here, primitive=True, passage="a door before")
    steps = (Subgoal(here, before, primitive=False), Subgoal(before, behind, primitive=True, passage="study-door"),
             Subgoal(behind, goal.value.destination, primitive=False))
    if doors == 2:
        bench.stand(7.3, 2.7, 0.6, 1.2)
    else:
        bench.stand(6.9, 2.0, 0.2, 1.9)
    bench.stand(3.0, 3.5, 0.1, 0.1, STUDY)
    return bench, bench.put(PlanSketch(goal.id, (), "", (came,) * at + steps, at, verified=True), goal)


@pytest.mark.parametrize("at", [0, 1])
def test_where_no_other_way_leads_there_what_stands_in_the_room_is_behind_it(at: int) -> None:
    bench, sketch = blocked(1, at=at)
    effect = effect_on(bench.ask(SOURCE, sketch), Impasse)
    assert (effect.value.kind, effect.value.goal, effect.value.behind) == ("blocked", "Goal-1", ("Obstacle-1",))
    assert reasons(effect) == {sketch.id, "Hypothesis-1", "Obstacle-1"}


def test_where_another_way_leads_to_the_goal_the_sketch_ends_for_that_one() -> None:
    bench, sketch = blocked(2)
    below = bench.sketch(*WAY, goal=bench.view["Goal-1"], path=(4,))
    effects = bench.ask(SOURCE, sketch)
    assert {(e.entry.id, e.value.status) for e in effects or ()} == {  # type: ignore[union-attr]
        (sketch.id, "superseded"), (below.id, "superseded")}
    assert all(reasons(effect) == {sketch.id} for effect in effects or ())


@pytest.mark.parametrize("at", [0, 1])
def test_a_way_is_another_one_than_what_is_left_of_the_sketch(at: int) -> None:
    """Back through the door by which it came: another way only once it has come."""
    bench = Bench(plain_robot())
    bench.believe(Pose2(6.0, 2.8, 0.0))
    goal = bench.pursue(Place(STUDY, 4.0, 2.0))
    thing = bench.stand(2.0, 1.0, 0.3, 0.3)
    here, there = Place(HALL, 6.0, 2.8), Place(HALL, 2.0, 1.0)
    came = Subgoal(here, here, primitive=True, passage="study-door")
    leads_there = Subgoal(here, there, primitive=False)
    steps = (came, leads_there) if at else (leads_there, came)
    sketch = bench.put(PlanSketch(goal.id, (), "", steps, at, verified=True), goal)
    effects = bench.ask(SOURCE, sketch)
    if at:
        assert [s.status for s in made(effects, PlanSketch)] == ["superseded"]
    else:
        assert effect_on(effects, Impasse).value.behind == (thing.id,)


@pytest.mark.parametrize("basis", ["command", "odometry", "tracks", "milestone", "relocalization", "ride"])
def test_where_a_search_has_just_found_it_the_first_milestone_holds(basis: str) -> None:
    bench = Bench(plain_robot())
    bench.believe(basis=basis)
    drawn = effect_on(bench.ask(SOURCE, bench.sketch(*WAY, primitive=False)), PlanSketch).value
    assert drawn.verified is (basis == "relocalization")


def test_the_sketch_of_another_subgoal_or_goal_refines_nothing_here() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    sketch = bench.sketch(*WAY, primitive=False)
    bench.sketch(*WAY, goal=bench.view[sketch.value.goal], path=(1,))
    bench.sketch(*WAY, path=(0,))
    assert bench.ask(SOURCE, sketch) is not None


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    check_source(SOURCE, bench, bench.sketch(*WAY, primitive=False), without=("Goal-1",))
