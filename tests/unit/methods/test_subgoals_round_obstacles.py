"""Other passages where obstacles leave no way: two rooms with two doors between them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from experiments.generated.floors import generated_floor
from knowledge_sources.methods.motion import CLEARANCES_M, SubgoalPlanner
from knowledge_sources.settings import DEFAULT
from two_doors import two_doors
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import Hypothesis, Obstacle, Place, Subgoal
from world_models.frames import Pose2
from world_models.robot import RobotModel

DOORS = ("north-door", "south-door")


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    return two_doors(tmp_path_factory.mktemp("world")).world


def list_doors(world: World, obstacles: list[Obstacle]) -> list[str] | None:
    """Through which doors the robot would go from the study to the parlour."""
    camera = Camera.from_field_of_view(1.1)
    robot = RobotModel(world, camera, CameraMount(1.0), ActuatorModel())
    here, there = Place("study", 3.4, 4.1), Place("parlour", 1.3, 3.7)
    parts = SubgoalPlanner(robot, DEFAULT.plan, obstacles).plan_between_locales(here, there, 0.1)
    return None if parts is None else [part.passage for part in parts if part.passage]


def plan_across(world: World, obstacles: list[Obstacle], here: Pose2, there: Place) -> list[Any] | None:
    """The way (k, 2) across the study from a pose [world]; None where none is left."""
    robot = RobotModel(world, Camera.from_field_of_view(1.1), CameraMount(1.0), ActuatorModel())
    belief = Hypothesis.of_world(world, "study", here, np.eye(3) * 1e-6, "milestone")
    subgoal = Subgoal(Place.of_world(world, "study", here.x_m, here.y_m), there, False)
    parts = SubgoalPlanner(robot, DEFAULT.plan, obstacles).plan_across(subgoal, belief)
    return None if parts is None else [here.position, *(p.destination.in_world(world).position for p in parts)]


def stand_before(world: World, door: str, side: str = "study", away_m: float = 0.6) -> Obstacle:
    """A thing that stands before a door, on one side."""
    doorway = next(d for d in world.doorways_of("study") if d.name == door)
    middle = doorway.threshold_of(side).mean(axis=0) - away_m * doorway.outward_from(side)
    return stand(side, (middle[0], middle[1]), (0.25, 0.25))


def stand(locale: str, middle: tuple[float, float], half: tuple[float, float]) -> Obstacle:
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners = tuple((float(x), float(y)) for x, y in np.array(middle) + signs * half)
    return Obstacle(f"{locale}/obstacle-1", locale, corners, 0.02, *middle, 2.0 * half[0])


def test_with_nothing_in_the_way_the_first_door_is_taken(world: World) -> None:
    assert list_doors(world, []) == ["north-door"]


@pytest.mark.parametrize("side", ["study", "parlour"])
def test_what_stands_before_a_door_on_either_side_sends_the_robot_to_the_other(world: World, side: str) -> None:
    assert list_doors(world, [stand_before(world, "north-door", side)]) == ["south-door"]
    assert list_doors(world, [stand_before(world, "south-door", side)]) == ["north-door"]


def test_with_something_before_both_doors_there_is_no_way(world: World) -> None:
    assert list_doors(world, [stand_before(world, door) for door in DOORS]) is None


def test_what_is_only_suspected_or_gone_blocks_nothing(world: World) -> None:
    gone = stand_before(world, "north-door")
    assert list_doors(world, [Obstacle(**{f: getattr(gone, f) for f in gone.__slots__} | {"status": "gone"})]) == [
        "north-door"]


@pytest.mark.parametrize("off_m", [0.02, 0.05, -0.05])
def test_a_robot_that_stands_in_a_doorway_finds_its_way_back(world: World, off_m: float) -> None:
    doorway = next(d for d in world.doorways_of("study") if d.name == "north-door")
    x_m, y_m = doorway.threshold_of("study").mean(axis=0) + off_m * doorway.outward_from("study")
    for obstacles in ([], [stand("study", (1.5, 1.5), (0.25, 0.25))]):
        assert plan_across(world, obstacles, Pose2(float(x_m), float(y_m), 0.0), Place("study", 3.4, 4.1)) is not None


def test_where_there_is_room_the_way_keeps_away_from_what_the_model_lacks(world: World) -> None:
    """Its top may be wider than its feet."""
    start, end = Place("study", 3.4, 4.1).in_world(world), Place("study", 1.2, 1.2)
    middle = 0.5 * (start.position + end.in_world(world).position)
    thing = stand("study", (float(middle[0]), float(middle[1])), (0.1, 0.1))
    way = plan_across(world, [thing], start, end)
    assert way is not None
    radius_m = RobotModel(world, Camera.from_field_of_view(1.1), CameraMount(1.0), ActuatorModel()).radius_m
    away_m = shapely.LineString(way).distance(shapely.Polygon(thing.footprint))
    assert away_m > radius_m + CLEARANCES_M[0] + DEFAULT.plan.overhang_m - 0.01


@pytest.mark.parametrize("seed", [2, 1_000_005])
def test_things_of_the_model_beside_a_doorway_are_passed_without_contact(seed: int) -> None:
    """Here things stand beside a doorway, so that there is room only diagonally: one was touched again and again."""
    world = generated_floor(seed, 6, open_share=1.0).world
    robot = RobotModel(world, Camera.from_field_of_view(1.1), CameraMount(1.0), ActuatorModel())
    planner, passed = SubgoalPlanner(robot, DEFAULT.plan), 0
    for doorway in world.doorways:
        rooms = doorway.between
        here, there = (Place.of_world(world, room, *np.mean(world.outline(room), axis=0).tolist()) for room in rooms)
        for part in planner.plan_between_locales(here, there, 0.1) or ():
            if part.passage == doorway.name:
                leg = shapely.LineString([end.in_world(world).position for end in (part.origin, part.destination)])
                things = [thing for room in rooms for thing in world.obstacles(room)]
                assert all(leg.distance(shapely.Polygon(thing)) >= robot.radius_m for thing in things), doorway.name
                passed += 1
    assert passed >= 6
