"""Pictures of the research center from any pose, as the camera of the main mission takes them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from harvey.simulation.simulated_run import build_robot_model
from sim.render.optics import Optics
from sim.render.sensor import compress_jpeg, expose
from sim.scenario import load_scenario
from sim.stage import Stage, build_stage
from world_models.frames import Pose2
from world_models.robot import RobotModel

ROOM = "robot-laboratory"


@cache
def stage() -> Stage:
    return build_stage(load_scenario("lab-to-allens-office"))


@cache
def robot() -> RobotModel:
    return build_robot_model(stage().scenario)


def photograph(pose: Pose2, rng: np.random.Generator) -> bytes:
    """What the camera sees from a pose of the world, with the sensor's noise."""
    s = stage().scenario
    radiance = Optics.of(s.camera.camera).radiance(stage().building.renderer, robot().camera_from_world(pose))
    return compress_jpeg(expose(radiance, s.sensor, rng, lights_on=True), s.sensor.jpeg_quality)


def draw_places(rng: np.random.Generator) -> Iterator[Pose2]:
    """Poses in the laboratory, off its walls."""
    corners = np.array(robot().world.outline(ROOM))
    while True:
        x_m, y_m = rng.uniform(corners.min(axis=0) + 1.5, corners.max(axis=0) - 1.5)
        yield Pose2(x_m, y_m, rng.uniform(-3.0, 3.0))
