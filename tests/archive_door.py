"""A door between a hall and an archive, open and shut, before the robot's camera."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from sim.body.simulated_building import SimulatedBuilding
from sim.ground_truth.table import TrueDoor
from sim.ground_truth.true_changes import build_leaf
from sim.render.sensor import SensorParameters, compress_jpeg, expose
from sim.scenario import CameraSettings
from world_models.actuator import ActuatorModel
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2
from world_models.robot import RobotModel

HALL, DOOR = "north-hall", "archive-north-door"
WORLD = load_world(WORLDS / "two_ways.toml")
DOORWAY = next(door for door in WORLD.doorways if door.name == DOOR)
ROBOT = RobotModel(WORLD, CameraSettings().camera, CameraSettings().mount, ActuatorModel())


@cache
def building(is_shut: bool) -> SimulatedBuilding:
    """As it truly is, with the door shut or as the model has it."""
    leaf = build_leaf(TrueDoor(name=DOOR), DOORWAY, WORLD.floor_m(HALL)) if is_shut else []
    return SimulatedBuilding.of_faces([*WORLD.faces, *leaf])


def before_door(away_m: float, aside_m: float) -> Pose2:
    """A pose in the world, in the hall, that faces the door."""
    middle = DOORWAY.pose_from(HALL)
    at = middle @ Pose2(-away_m, aside_m, 0.0)
    return Pose2(at.x_m, at.y_m, math.atan2(middle.y_m - at.y_m, middle.x_m - at.x_m))


@cache
def photograph(
    pose: Pose2, is_shut: bool, robot: RobotModel = ROBOT, gain: float = 1.0, lights_on: bool = True
) -> bytes:
    """What the camera sees from a pose of the world, in light that is ``gain`` times as bright."""
    radiance = gain * building(is_shut).renderer.radiance(robot.lens, robot.camera_from_world(pose))
    sensor = SensorParameters()
    image = expose(radiance, sensor, np.random.default_rng(1), lights_on=lights_on)
    return compress_jpeg(image, sensor.jpeg_quality)
