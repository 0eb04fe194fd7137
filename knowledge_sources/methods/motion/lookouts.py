"""Places from which something on the floor can be looked at again.

All coordinates are on the floor, in one frame, in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats


def list_lookouts(
    free: shapely.Geometry, floor: shapely.Geometry, footprint: Any, distances_m: Sequence[float], directions: int,
    short_m: float,
) -> Floats:
    """The poses (n, 3) x, y, heading [rad] round a thing that face it, with nothing in between.

    Args:
        free: where the robot's centre may be.
        floor: where nothing stands but the thing, at most.
        footprint: corners (k, 2) of the thing.
        distances_m: of the robot's centre from the thing's middle.
        directions: so many round it are tried.
        short_m: the last so much of a line of sight, before the thing's near side, need not be floor.
    """
    shape = shapely.convex_hull(shapely.multipoints(np.asarray(footprint, float).reshape(-1, 2)))
    middle = shapely.get_coordinates(shape.centroid)[0]
    around = 2.0 * np.pi * np.arange(directions) / directions
    away, at = (part.ravel() for part in np.meshgrid(distances_m, around, indexing="ij"))
    out = np.column_stack([np.cos(at), np.sin(at)])
    places = middle + away[:, None] * out
    kept = shapely.contains_xy(free, places[:, 0], places[:, 1])
    lines = shapely.difference(shapely.linestrings(np.stack([places, np.broadcast_to(middle, places.shape)], axis=1)),
                               shapely.buffer(shape, short_m))
    kept &= shapely.covers(floor, lines)
    return np.asarray(np.column_stack([places, np.arctan2(-out[:, 1], -out[:, 0])])[kept])
