"""Tolerances of the servo levels in the image, from the actuator model (§3.2) and the matcher's window (§6.1.4)."""

from __future__ import annotations

import math
from statistics import median

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.settings import DEFAULT, Settings
from world_models.camera import NEAR_PLANE_M
from world_models.entries import Hypothesis
from world_models.robot import RobotModel

TOLERANCE_SIGMAS = 3.0  # standard deviations of the believed pose that the action level may correct (§3.2)


Floats = NDArray[np.float64]


def action_px(robot: RobotModel, belief: Hypothesis, points_world: Floats, settings: Settings = DEFAULT) -> float:
    """The action level's tolerance [px]: how far landmarks may be off by the uncertainty of the believed pose (§3.2).

    An error of the heading moves the image by the focal length times the error; an error of the place by the focal
    length times the error over the distance ahead of the landmarks, ``points_world`` (n, 3). Without landmarks only the
    heading counts. ``min_tolerance_px`` is added for the error of correlation itself; the plan level's bound is the
    largest tolerance.
    """
    pose = belief.world_from_robot(robot.world)
    ahead_m = robot.on_floor_of(belief.locale).camera_from_world(pose).apply(points_world.reshape(-1, 3))[:, 2]
    near = ahead_m[ahead_m > NEAR_PLANE_M]
    spread = math.hypot(belief.sigma_rad, belief.sigma_m / median(near.tolist()) if len(near) else 0.0)
    action = settings.action
    return min(action.min_tolerance_px + TOLERANCE_SIGMAS * robot.camera.fx * spread,
               settings.plan.max_deviation_px)
