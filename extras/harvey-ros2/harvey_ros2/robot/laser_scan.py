"""A laser scan as a ring of range sensors: the nearest echo within each few degrees about the robot's axis."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from harvey_ros2.robot.robot_file import ScanMount
from world_models.entries import Ranges

SECTORS = 48
MOST_M = 6.0
"""What is further counts as no echo: it is of no use to who drives [m]."""
SIGMA_M = 0.03
"""Of a scanner of a small robot [m]."""
MOST_BEAMS = 100_000


def read_scan(message: Any, mount: ScanMount, when_s: float) -> Ranges | None:
    """The ranges of a LaserScan; None where it is none, or measured nothing.

    As REP 117 says: +inf is no echo, -inf an echo too near to be measured; what else is out of bounds is none at all.
    """
    least, most = float(message.range_min), float(message.range_max)
    first, step = float(message.angle_min), float(message.angle_increment)
    found = np.asarray(message.ranges, float)
    if not (math.isfinite(first + step) and 0.0 <= least < most and 0 < len(found) <= MOST_BEAMS):
        return None
    beams = mount.heading_rad + first + step * np.arange(len(found))
    is_open = np.isposinf(found)
    with np.errstate(invalid="ignore"):
        is_echo = np.isneginf(found) | ((found >= max(least, 1e-6)) & (found <= most))
    away = np.where(np.isneginf(found), least, np.where(is_echo, found, 0.0))
    x, y = mount.forward_m + away * np.cos(beams), mount.left_m + away * np.sin(beams)
    bearings, away = np.where(is_open, beams, np.arctan2(y, x)), np.hypot(x, y)
    reach_m = min(most, MOST_M)
    sectors = np.floor(bearings * SECTORS / math.tau).astype(np.intp) % SECTORS
    directions, distances = [], list[float | None]()
    for sector in range(SECTORS):
        within = sectors == sector
        if not np.any(within & (is_open | is_echo)):
            continue
        nearest = float(np.min(away[within & is_echo], initial=math.inf))
        directions.append(math.remainder((sector + 0.5) * math.tau / SECTORS, math.tau))
        distances.append(nearest if nearest <= reach_m else None)
    if not directions:
        return None
    return Ranges(tuple(directions), tuple(distances), SIGMA_M, math.pi / SECTORS, reach_m, when_s)
