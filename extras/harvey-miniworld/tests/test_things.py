"""What stands on miniworld's own textures is seen, and the textures are not."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import shapely
from one_room import needs_egl, plain_floor

import harvey
from harvey_miniworld.drawn_floor import DrawnFloor
from harvey_miniworld.floor_missions import CAMERA, MOUNT, THINGS
from harvey_miniworld.textured_floor import FLOORS, StandingThing
from knowledge_sources.methods.floor import MotionBetween, Seen, is_telling, see_free_floor
from world_models.actuator import ActuatorModel
from world_models.frames import Pose2
from world_models.robot import RobotModel


@pytest.mark.parametrize("texture", FLOORS)
@pytest.mark.parametrize("kind", [None, *THINGS])
def test_a_thing_on_a_textured_floor_is_seen_where_it_stands_and_no_thing_without_one(
    texture: str, kind: str | None
) -> None:
    needs_egl()
    added = () if kind is None else (StandingThing(kind, 4.0, 2.0, 0.4, THINGS[kind]),)
    floor = plain_floor(*added)
    floor = replace(floor, rooms=tuple(replace(room, floor=texture) for room in floor.rooms))
    robot = RobotModel(harvey.build_world(floor.plan), CAMERA, MOUNT, ActuatorModel())
    drawn = DrawnFloor(floor, CAMERA, MOUNT)
    poses = [Pose2(x_m, 1.9, 0.05) for x_m in (1.0, 1.3, 1.6)]
    jpegs = [bytes(cv2.imencode(".jpg", drawn.see(pose)[..., ::-1])[1]) for pose in poses]
    drawn.close()
    earlier = [Seen(jpeg, pose, MotionBetween(pose.inverse() @ poses[2], 0.005, 0.003))
               for pose, jpeg in zip(poses[1::-1], jpegs[1::-1], strict=True)]
    seen = see_free_floor(robot, "corridor", poses[2], 1e-5 * np.eye(3), jpegs[2], earlier, 1.0)
    found = [shapely.Polygon(thing.footprint) for thing in seen.things if is_telling(thing)]
    assert bool(found) == bool(added)
    assert all(shape.distance(added[0].shape) < 0.3 for shape in found)
    assert (np.array(seen.far_m) > seen.near_m).mean() > 0.5
