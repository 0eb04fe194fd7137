"""Where a robot truly can go: what a planner knows that knows everything solid."""

from __future__ import annotations

import numpy as np
import shapely

from sim.body.collision import ROBOT_RADIUS_M, Obstacles
from world_models.frames import Pose2

QUARTER_STEPS = 8
"""Corners of a quarter circle round the end of an obstacle: the way round it is too near by 2 mm at most."""


def find_free_floor(obstacles: Obstacles, margin_m: float = 0.0) -> shapely.Geometry:
    """Where the robot's centre may be, with its rim ``margin_m`` from everything solid; world frame [m]."""
    ends = obstacles.segments_world.reshape(-1, 2)
    low, high = ends.min(axis=0), ends.max(axis=0)
    return take_from_floor(shapely.box(*low, *high), obstacles, margin_m)


def take_from_floor(free: shapely.Geometry, obstacles: Obstacles, margin_m: float = 0.0) -> shapely.Geometry:
    """A free floor without what is near to further obstacles."""
    if not len(obstacles.segments_world):
        return free
    solid = shapely.linestrings(obstacles.segments_world)
    near = shapely.buffer(solid, ROBOT_RADIUS_M + margin_m, quad_segs=QUARTER_STEPS)
    return shapely.difference(free, shapely.union_all(near))


def has_way(free: shapely.Geometry, start: Pose2, goal: Pose2) -> bool:
    """Whether a way leads over a free floor from one place to another."""
    ends = shapely.points(np.array([start.position, goal.position]))
    return any(bool(shapely.intersects(part, ends).all()) for part in shapely.get_parts(free))
