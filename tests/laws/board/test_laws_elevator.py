"""Laws of missions that change floors: no sketch passes a barrier, a ride joins one car, and what is verified stays."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Decision, Post, Quiescence
from box_rooms import barriers
from harvey.dry_run import build_dry_run
from towers import tower
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import Command, Hypothesis, Outcome, PlanSketch, Ride, Subgoal, diagonal
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2
from world_models.robot import RobotModel

CAMERA, MOUNT = Camera.from_field_of_view(math.radians(65.0), 256, 256), CameraMount(1.0, 0.1)


def in_locale(world: World, belief: Hypothesis, locale: str) -> Hypothesis:
    """The same hypothesis in the frame of another locale."""
    return Hypothesis.of_world(world, locale, belief.world_from_robot(world), belief.covariance_world(world),
                               belief.basis)


@st.composite
def towers(draw: st.DrawFn) -> World:
    text = tower(draw(st.integers(2, 4)), storey_m=draw(st.floats(2.8, 6.0)), turn_deg=draw(st.floats(-180, 180)),
                 hall_stop_m=draw(st.floats(1.0, 2.0)))
    return read_world(Source.parse(text, "tower.toml"))


def drive(world: World, origin: str, destination: str) -> tuple[list[object], Outcome]:
    """What is put on the board in a dry run, from hall to hall, and how it ends."""
    made: list[object] = []

    def note(decision: Decision) -> None:
        made.extend(change.entry.value for change in decision.made)

    robot = RobotModel(world, CAMERA, MOUNT, ActuatorModel())
    scheduler = build_dry_run(world, robot, sinks=(note,))
    goal = f"(ptrans ({origin} (12,4.5,0)) ({destination} (14,4.2,0)))"
    scheduler.post([Post(Command(goal, 0.5, None, diagonal(0.003, 0.001)))], "user")
    while scheduler.view.latest(Outcome) is None and scheduler.cycle < 4_000:
        if scheduler.step() is None:
            scheduler.post([Post(Quiescence(scheduler.cycle))], "scheduler")
    outcome = scheduler.view.latest(Outcome)
    return made, outcome.value if outcome else Outcome("failed", "no end")


def check_subgoal(world: World, subgoal: Subgoal) -> None:
    ends = [subgoal.origin.locale, subgoal.destination.locale]
    floors = [world.floor_m(name) for name in ends]
    if subgoal.primitive:
        assert abs(floors[0] - floors[1]) < 1e-9, f"{subgoal} is driven from floor to floor"
        line = shapely.LineString([p.in_world(world).position for p in (subgoal.origin, subgoal.destination)])
        rooms = [room for room in world.rooms if abs(world.floor_m(room) - floors[0]) < 0.1]
        assert not line.intersects(barriers(world, rooms)), f"{subgoal} passes a barrier"
    elif subgoal.passage:
        assert world.common(*ends) == "elevator" and all(world.locale(name).kind == "landing" for name in ends)


@settings(deadline=None, max_examples=4)
@given(towers(), st.data())
def test_sketches_pass_no_barrier_on_any_floor_and_keep_what_is_verified(world: World, data: st.DataObject) -> None:
    halls = [room for room in world.rooms if room.startswith("hall")]
    origin, destination = data.draw(st.permutations(halls))[:2]
    made, outcome = drive(world, origin, destination)
    assert outcome.kind == "reached", outcome
    latest: dict[tuple[object, ...], PlanSketch] = {}
    for sketch in (value for value in made if isinstance(value, PlanSketch)):
        for subgoal in sketch.subgoals:
            check_subgoal(world, subgoal)
        assert all(a.destination.locale == b.origin.locale for a, b in pairwise(sketch.subgoals))
        before = latest.get((sketch.goal, sketch.path))
        if before is not None and before.is_active:
            done = min(before.at, sketch.at)
            assert before.subgoals[:done] == sketch.subgoals[:done]
            assert sketch.at >= before.at or sketch.adjustments == before.adjustments + 1
        latest[sketch.goal, sketch.path] = sketch
    assert [r.destination for r in made if isinstance(r, Ride)] == [f"car-{destination.removeprefix('hall-')}"]


@settings(deadline=None, max_examples=20)
@given(towers(), st.floats(-3.0, 3.0), st.floats(0.0, 0.3))
def test_a_hypothesis_in_the_frame_of_another_floor_comes_back_the_same(
    world: World, heading: float, sigma: float
) -> None:
    here = Hypothesis("car-1", Pose2(1.0, 0.9, heading), diagonal(sigma, 0.1), "command")
    for name in world.locales:
        there = in_locale(world, here, name)
        back = in_locale(world, there, here.locale)
        assert back.locale_from_robot.distance_to(here.locale_from_robot) < 1e-9
        assert there.sigma_m == pytest.approx(here.sigma_m) and back.sigma_m == pytest.approx(here.sigma_m)
        assert np.allclose(back.covariance, here.covariance)


@settings(deadline=None, max_examples=10)
@given(towers(), st.floats(0.6, 1.4), st.floats(0.6, 1.4), st.floats(-3.0, 3.0))
def test_a_robot_one_floor_up_sees_from_one_floor_up(world: World, x: float, y: float, heading: float) -> None:
    robot = RobotModel(world, CAMERA, MOUNT, ActuatorModel())
    belief = Hypothesis("car-2", Pose2(x, y, heading), diagonal(0.01, 0.01), "command")
    pose = belief.world_from_robot(world)
    eye = robot.on_floor_of("car-2").camera_from_world(pose).inverse().translation
    assert np.allclose(eye[:2], robot.camera_from_world(pose).inverse().translation[:2])
    assert abs(eye[2] - MOUNT.height_m - world.floor_m("car-2")) < 1e-9
    assert world.locale_at([*pose.position, world.floor_m("car-2")]) == "car-2"
    up, again = robot.on_floor_of("car-2"), robot.on_floor_of("car-2")
    assert robot.on_floor_of("car-1") is robot
    assert up.camera is again.camera is robot.camera and up.mount == again.mount  # by these views are cached
