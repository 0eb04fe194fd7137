"""Straight lines through a doorway, past what stands beside it.

All coordinates are on the floor, in one frame, in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats

JOINT_M = 0.005
"""Rooms and the doorway between them overlap by this, so that no gap is left by rounding."""


def compute_free_passage(
    rooms: Sequence[Any], thresholds: Any, obstacles: Sequence[Any], clearance_m: float
) -> shapely.Geometry:
    """Where the robot's centre may be in two rooms and the doorway between them.

    Args:
        rooms: the outlines (k, 2) of both.
        thresholds: (n, 2) corners of the doorway's floor.
        obstacles: corners (k, 2) of what stands in the rooms.
        clearance_m: of the robot's centre from all of them.
    """
    parts = [shapely.Polygon(np.asarray(room, float)) for room in rooms]
    parts.append(shapely.convex_hull(shapely.multipoints(np.asarray(thresholds, float).reshape(-1, 2))))
    floor = shapely.union_all([shapely.buffer(part, JOINT_M, join_style="mitre") for part in parts])
    free = shapely.buffer(floor, -clearance_m - JOINT_M)
    solid = [shapely.buffer(shapely.Polygon(np.asarray(corners, float)), clearance_m) for corners in obstacles]
    return shapely.difference(free, shapely.union_all(solid)) if solid else free


def find_line_through(
    free: shapely.Geometry, middles: Any, outward: Any, distances_m: Sequence[float], offsets_m: Sequence[float]
) -> tuple[Floats, Floats] | None:
    """The straight line through a doorway that stays in the free space and is the least aslant.

    Args:
        free: where the robot's centre may be.
        middles: (2, 2) of the thresholds on this side and on the other.
        outward: (2,) unit vector through the doorway, from this side to the other.
        distances_m: of the line's ends from the thresholds.
        offsets_m: how far to either side of the middle they may be; they rise from 0.

    Returns:
        Its ends (2,), on this side and on the other; None where no line stays in the free space.
    """
    (near, far), out = np.asarray(middles, float), np.asarray(outward, float)
    across = np.array([-out[1], out[0]])
    aside = np.array([sign * offset for offset in offsets_m for sign in ((1.0, -1.0) if offset else (1.0,))])
    away, side = (part.ravel() for part in np.meshgrid(distances_m, aside))
    ends = near - away[:, None] * out + side[:, None] * across, far + away[:, None] * out + side[:, None] * across
    first, second = (part.ravel() for part in np.meshgrid(*(np.arange(len(away)),) * 2, indexing="ij"))
    aslant_m = np.abs(side[first]) + np.abs(side[second]) + np.abs(side[first] - side[second])
    order = np.lexsort((first + second, aslant_m))
    first, second = first[order], second[order]
    shapely.prepare(free)
    clear = shapely.covers(free, shapely.linestrings(np.stack([ends[0][first], ends[1][second]], axis=1)))
    k = int(np.argmax(clear))
    return (ends[0][first[k]], ends[1][second[k]]) if clear[k] else None
