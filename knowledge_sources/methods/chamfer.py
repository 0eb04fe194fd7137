"""Which of many poses fits the segments best? Oriented chamfer matching of projected model lines.

For each direction of line there is a map of the distance to the nearest segment of about that direction; a pose is
scored by reading the maps where points of the model lines fall. Source: G. Borgefors, Hierarchical chamfer matching,
PAMI 1988, with directions kept apart as in M.-Y. Liu et al., Fast directional chamfer matching, CVPR 2010.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from world_models.camera import NEAR_M, Camera
from world_models.frames import Pose

Floats = NDArray[np.float64]
DIRECTIONS = 12
REACH_PX = 20.0
"""Segments further away than this say nothing."""
ENOUGH = 150
"""With fewer points in view than this, a score counts for less."""
SPACING_M = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class ChamferMaps:
    """One distance map (h, w) for each of the directions, truncated at REACH_PX."""

    maps: NDArray[np.float32]


def chamfer_maps(segments_px: Floats, width: int, height: int) -> ChamferMaps:
    """Maps of segments (n, 2, 2); each is drawn under its own direction and the two next to it."""
    empty = np.full((DIRECTIONS, height, width), 255, np.uint8)
    for (u0, v0), (u1, v1) in segments_px:
        own = round(math.atan2(v1 - v0, u1 - u0) / math.pi * DIRECTIONS)
        for k in (own - 1, own, own + 1):
            ends = (round(float(u0)), round(float(v0))), (round(float(u1)), round(float(v1)))
            cv2.line(empty[k % DIRECTIONS], *ends, 0, 1)
    distances = [np.minimum(cv2.distanceTransform(layer, cv2.DIST_L2, 3), REACH_PX) for layer in empty]
    return ChamferMaps(np.asarray(distances, np.float32))


def sample_lines(lines_world: Floats) -> tuple[Floats, Floats]:
    """Points (k, 3) along lines (n, 2, 3), about SPACING_M apart, and the unit direction (k, 3) of each one's line."""
    points, directions = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for a, b in lines_world:
        length = float(np.linalg.norm(b - a))
        count = max(2, min(60, round(length / SPACING_M)))
        t = (np.arange(count) + 0.5) / count
        points.append(a + t[:, None] * (b - a))
        directions.append(np.broadcast_to((b - a) / max(length, 1e-9), (count, 3)))
    return np.concatenate(points), np.concatenate(directions)


def chamfer_score(
    maps: ChamferMaps, camera: Camera, camera_from_world: Pose, points_world: Floats, directions_world: Floats
) -> float:
    """How well sampled lines fit at a pose: 0 not at all, 1 when a segment of its direction lies under every point."""
    p = camera_from_world.apply(points_world)
    ahead = p[:, 2] > 4.0 * NEAR_M
    p, d = p[ahead], directions_world[ahead] @ camera_from_world.rotation.T
    px = camera.project(p)
    u, v = np.rint(px).astype(np.int64).T
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    if not inside.any():
        return 0.0
    p, d, u, v = p[inside], d[inside], u[inside], v[inside]
    du = camera.fx * (d[:, 0] * p[:, 2] - d[:, 2] * p[:, 0])
    dv = camera.fy * (d[:, 1] * p[:, 2] - d[:, 2] * p[:, 1])
    k = np.rint(np.arctan2(dv, du) / math.pi * DIRECTIONS).astype(np.int64) % DIRECTIONS
    near = 1.0 - maps.maps[k, v, u] / REACH_PX
    return float(np.mean(near)) * min(1.0, len(u) / ENOUGH)
