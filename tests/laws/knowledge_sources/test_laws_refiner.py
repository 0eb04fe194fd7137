"""Laws of the refiner: the current subgoal, once its milestone holds, is drawn in more detail, once."""

from __future__ import annotations

import pytest
from hypothesis import given, settings

from blackboard.change import Posted, Revised
from generated_boards import HALL, Bench, effect_on, plain_robot, poses, reasons, wakes
from knowledge_sources.plan.refiner import Refiner
from world_models.entries.location import Place
from world_models.entries.task import Outcome, PlanSketch
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


@pytest.mark.parametrize("basis", ["command", "odometry", "tracks", "milestone", "relocalization", "ride"])
def test_where_a_search_has_just_found_it_the_first_milestone_holds(basis: str) -> None:
    bench = Bench(plain_robot())
    bench.believe(basis=basis)
    drawn = effect_on(bench.ask(SOURCE, bench.sketch(*WAY, primitive=False)), PlanSketch).value
    assert drawn.verified is (basis == "relocalization")


@pytest.mark.parametrize("lacks", ["nothing", "belief", "goal", "need", "mission"])
def test_it_refines_only_what_is_needed(lacks: str) -> None:
    bench = Bench(plain_robot())
    if lacks != "belief":
        bench.believe()
    sketch = bench.sketch(*WAY, primitive=False)
    goal = bench.view[sketch.value.goal]
    if lacks == "goal":
        bench.retract(goal)
    elif lacks == "need":
        bench.sketch(*WAY, goal=goal, path=(0,))
    elif lacks == "mission":
        bench.put(Outcome("failed", ""))
    assert (bench.ask(SOURCE, sketch) is not None) == (lacks == "nothing")


def test_the_sketch_of_another_subgoal_or_goal_refines_nothing_here() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    sketch = bench.sketch(*WAY, primitive=False)
    bench.sketch(*WAY, goal=bench.view[sketch.value.goal], path=(1,))
    bench.sketch(*WAY, path=(0,))
    assert bench.ask(SOURCE, sketch) is not None


@pytest.mark.parametrize("is_active", [True, False])
@pytest.mark.parametrize("verified", [True, False])
@pytest.mark.parametrize("primitive", [True, False])
@pytest.mark.parametrize("at", [0, 2])
def test_what_it_watches(is_active: bool, verified: bool, primitive: bool, at: int) -> None:
    bench = Bench()
    sketch = bench.sketch(*WAY, at=at, verified=verified, primitive=primitive)
    if not is_active:
        sketch = bench.revise(sketch, status="superseded")
    wakes_it = is_active and verified and not primitive and at < 2
    assert wakes(SOURCE, Posted(sketch)) == wakes(SOURCE, Revised(sketch)) == wakes_it
