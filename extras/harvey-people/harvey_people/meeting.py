"""Meeting: where on the next move the robot may meet somebody, how probably; by predicted places and their doubt."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chndtr

from harvey_people.following import predict
from harvey_people.mover import Mover
from knowledge_sources.methods.motion import Clearance, limit_speed
from world_models.actuator import ActuatorModel
from world_models.frames import Pose2

Floats = NDArray[np.float64]
PERSON_M = 0.3
"""A person's legs and arms reach so far from the middle."""
BORNE_M_PER_S = 0.05
"""Speed at which a touch of somebody is borne: of a thing it is that of creeping."""
THINKS_S = 0.3
"""Until a move begins that is decided now; people walk meanwhile."""
STEP_S = 0.1
"""Of the moments that are asked after."""
LEAST_P = 1e-9


def measure_meeting(movers: Sequence[Mover], here: Pose2, heading_rad: float, move_m: float, radius_m: float,
                    speed_m_per_s: float, now_s: float) -> tuple[Clearance, tuple[float, ...]]:
    """Where on a move straight ahead somebody may be met, and how probably; and the largest of that of each mover.

    Args:
        heading_rad: of the move [world]; radius_m: of the robot.
        now_s: when it is decided, by the body's clock.
    """
    lasts_s = THINKS_S + move_m / speed_m_per_s
    times = np.arange(0.0, lasts_s + STEP_S, STEP_S)
    at_m = np.clip((times - THINKS_S) * speed_m_per_s, 0.0, move_m)
    ahead = np.array([math.cos(heading_rad), math.sin(heading_rad)])
    each = np.array([[_meets(mover, here.position + at * ahead, now_s + float(time), radius_m + PERSON_M)
                      for time, at in zip(times, at_m, strict=True)] for mover in movers]).reshape(len(movers), -1)
    either = 1.0 - np.prod(1.0 - each, axis=0)
    clearance = Clearance(at_m, np.maximum(either, LEAST_P), math.inf)
    return clearance, tuple(round(float(p.max(initial=0.0)), 4) for p in each)


def _meets(mover: Mover, place: Floats, at_s: float, reach_m: float) -> float:
    """How probably somebody who moves is within reach of a place at a time."""
    then = predict(mover, at_s)
    variance = 0.5 * (then.covariance[0][0] + then.covariance[1][1])
    away2 = float(np.sum((then.state[:2] - place) ** 2))
    moves = 1.0 / (1.0 + math.exp(-mover.log_odds))
    return moves * float(chndtr(reach_m**2 / variance, 2, away2 / variance))  # non-central chi squared


def may_go(clearance: Clearance, move_m: float, actuator: ActuatorModel) -> bool:
    """Whether the harm that is to be expected on a move at full speed is borne, by the core's formula."""
    return limit_speed(clearance, 0.0, move_m, actuator, BORNE_M_PER_S) >= actuator.speed_m_per_s
