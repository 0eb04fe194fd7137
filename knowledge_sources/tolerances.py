"""What each servo level may correct, in the image: from the actuator model (§3.2) and the matcher's window (§6.1.4)."""

from __future__ import annotations

import math
from statistics import median

import numpy as np
from numpy.typing import NDArray

from world_models.camera import NEAR_PLANE_M
from world_models.entries.location import Hypothesis
from world_models.robot import RobotModel

Floats = NDArray[np.float64]

PLAN_PX = 30.0
"""Plan level: as far as the matcher looks for what is expected (§6.1.4)."""
SIGMAS = 3.0
FLOOR_PX = 4.0
"""No deviation smaller than this is worth a thought beyond the action level."""


def action_px(robot: RobotModel, belief: Hypothesis, points_world: Floats) -> float:
    """Action level: how far landmarks may be off, by what the wheels are known to do since the belief was sure (§3.2).

    A heading that is wrong moves the image by the focal length times it, a place that is wrong by as much less as the
    landmarks (n, 3) are far ahead; without any, only the heading counts. Beyond that, ``FLOOR_PX`` are left to what the
    correlation itself may be wrong by.
    """
    pose = belief.world_from_robot(robot.world)
    ahead_m = robot.on_floor_of(belief.locale).camera_from_world(pose).apply(points_world.reshape(-1, 3))[:, 2]
    near = ahead_m[ahead_m > NEAR_PLANE_M]
    spread = math.hypot(belief.sigma_rad, belief.sigma_m / median(near.tolist()) if len(near) else 0.0)
    return min(FLOOR_PX + SIGMAS * robot.camera.fx * spread, PLAN_PX)
