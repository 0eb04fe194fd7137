"""Other passages where obstacles leave no way: two rooms with two doors between them."""

from __future__ import annotations

import numpy as np
import pytest

from knowledge_sources.methods.motion.subgoals import SubgoalPlanner
from knowledge_sources.settings import DEFAULT
from two_doors import two_doors
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries.location import Place
from world_models.entries.obstacle import Obstacle
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
