"""What a perfect eye sees of a floor with things on it: for tests of the map and of the motion."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from world_models.entries import FreeFloor
from world_models.frames import Pose2

FAR_M = 8.0


def scan_floor(
    floor: shapely.Geometry, pose: Pose2, locale: str = "room", seen_s: float = 0.0, *, forward_m: float = 0.1,
    count: int = 64, things: Sequence[shapely.Geometry] = (), near_m: float = 1.26,
    half_rad: float = math.radians(32.0),
) -> FreeFloor:
    """What a perfect eye sees of a floor with things on it."""
    x = pose.x_m + forward_m * math.cos(pose.heading_rad)
    y = pose.y_m + forward_m * math.sin(pose.heading_rad)
    bearings = pose.heading_rad + np.linspace(-half_rad, half_rad, count)
    solid = shapely.union_all(list(things)) if things else shapely.Polygon()
    far, ends = [], []
    for bearing in bearings:
        ray = shapely.LineString([(x, y), (x + FAR_M * math.cos(bearing), y + FAR_M * math.sin(bearing))])
        by_model = _cut(ray, floor, x, y)
        blocked = ray.intersection(solid)
        by_thing = math.inf if blocked.is_empty else float(shapely.Point(x, y).distance(blocked))
        far.append(min(by_model, by_thing))
        ends.append("thing" if by_thing < by_model else "model" if by_model < FAR_M - 1e-6 else "sight")
    return FreeFloor("camera", locale, x, y, tuple(map(float, bearings)), tuple(
        float(near_m / math.cos(b - pose.heading_rad)) for b in bearings), tuple(far), tuple(ends),
        tuple(0.02 for _ in bearings), (), seen_s, confirmed_m=tuple(far))


def _cut(ray: shapely.LineString, floor: shapely.Geometry, x: float, y: float) -> float:
    """How far a ray goes over the floor."""
    outside = ray.difference(floor)
    return FAR_M if outside.is_empty else float(shapely.Point(x, y).distance(outside))
