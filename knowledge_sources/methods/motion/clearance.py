"""Whether a robot can stand somewhere, as far as its model knows: how far the nearest wall or thing is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely


def wall_distance_m(outline: Any, openings: Sequence[Any], point: Any) -> float:
    """How far a point (2,) is from the sides of a room (k, 2), less its openings, each the corners (n, 2) of its floor.

    In an open doorway one stands far from walls, though at the border of the room.
    """
    walls = shapely.LinearRing(np.asarray(outline, float))
    if len(openings):
        walls = walls.difference(shapely.union_all([_hull(opening) for opening in openings]))
    return float(walls.distance(shapely.Point(point)))


def thing_distance_m(footprint: Any, point: Any) -> float:
    """How far a point (2,) is from what stands on a footprint (k, 2); 0 within it."""
    return float(shapely.Polygon(np.asarray(footprint, float)).distance(shapely.Point(point)))


def _hull(opening: Any) -> shapely.Geometry:
    return shapely.MultiPoint(np.asarray(opening, float)).convex_hull.buffer(1e-6)
