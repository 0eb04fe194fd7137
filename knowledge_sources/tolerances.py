"""What each servo level may correct, in the image: from the actuator model (§3.2) and the matcher's window (§6.1.4)."""

from __future__ import annotations

import math

from world_models.location import Hypothesis
from world_models.robot import RobotModel

PLAN_PX = 30.0
"""Plan level: as far as the matcher looks for what is expected (§6.1.4)."""
SIGMAS = 3.0
FLOOR_PX = 4.0
"""No deviation smaller than this is worth a thought beyond the action level."""
AHEAD_M = 3.0
"""How far ahead a landmark is taken to be."""


def action_px(robot: RobotModel, belief: Hypothesis) -> float:
    """Action level: how far a landmark may be off, by what the wheels are known to do since the belief was sure."""
    spread = math.hypot(belief.sigma_rad, belief.sigma_m / AHEAD_M)
    return min(FLOOR_PX + SIGMAS * robot.camera.fx * spread, PLAN_PX)
