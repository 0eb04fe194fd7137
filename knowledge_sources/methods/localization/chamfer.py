"""Which of many poses fits the segments best? Oriented chamfer matching of model lines, many poses at once.

For each direction of line there is a map of how near the next segment of about that direction is; a pose is scored by
reading the maps where points of the model lines fall. Source: G. Borgefors, Hierarchical chamfer matching, PAMI 1988,
with directions kept apart as in M.-Y. Liu et al., Fast directional chamfer matching, CVPR 2010.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from world_models.camera import Camera
from world_models.frames import Pose

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DIRECTIONS = 12
REACH_PX = 24.0
"""Segments further away than this say nothing."""
SHRUNK = 4
"""A map has one pixel for so many of the picture along each side: what is looked for is rough."""
NEAREST_M = 0.3
"""Points nearer to the camera than this are left out."""


@dataclass(frozen=True, slots=True, eq=False)
class ChamferMaps:
    """How near segments are, at each direction and place of a picture.

    Attributes:
        near: (DIRECTIONS, h, w) 1 on a segment of about that direction, 0 at REACH_PX from the next and beyond.
        chance: (DIRECTIONS,) its mean: what a line that is not there finds by chance.
    """

    near: NDArray[np.float32]
    chance: NDArray[np.float32]


def compute_chamfer_maps(segments_px: Any, camera: Camera) -> ChamferMaps:
    """Maps of segments (n, 2, 2); each is drawn under its own direction and the two next to it."""
    size = -(-camera.height // SHRUNK), -(-camera.width // SHRUNK)
    empty = np.full((DIRECTIONS, *size), 255, np.uint8)
    for (u0, v0), (u1, v1) in np.asarray(segments_px, float).reshape(-1, 2, 2):
        own = round(math.atan2(v1 - v0, u1 - u0) / math.pi * DIRECTIONS)
        ends = tuple((round(float(u) / SHRUNK), round(float(v) / SHRUNK)) for u, v in ((u0, v0), (u1, v1)))
        for k in (own - 1, own, own + 1):
            cv2.line(empty[k % DIRECTIONS], ends[0], ends[1], 0, 1)
    reach = REACH_PX / SHRUNK
    away = [np.minimum(cv2.distanceTransform(layer, cv2.DIST_L2, 3), reach) / reach for layer in empty]
    near = np.ascontiguousarray(1.0 - np.asarray(away), np.float32)
    return ChamferMaps(near, near.mean(axis=(1, 2)))


def compute_chamfer_scores(
    maps: ChamferMaps, camera: Camera, camera_from_robot: Pose, poses: Floats, points_world: Floats,
    directions_world: Floats, first: Ints, seen: Ints, view: Ints, stride: int = 1,
) -> Floats:
    """(n, 3) for each pose (n, 3) of the robot (x, y, heading): how near segments are, summed over the points in view;
    what that sum would be by chance; and how many points are in view.

    Pose i is asked about the points ``seen[first[view[i]] : first[view[i] + 1]]``, each or only one of ``stride``.
    """
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height], float)
    return np.asarray(_scores(
        maps.near, maps.chance, lens, np.array(camera_from_robot.rotation), np.array(camera_from_robot.translation),
        np.array(poses, float), points_world, directions_world, first, seen, np.array(view, np.int64), stride))


@njit(cache=True, error_model="numpy")
def _scores(
    near: Any, chance: Any, lens: Any, mount: Any, shift: Any, poses: Any, points: Any, directions: Any, first: Any,
    seen: Any, view: Any, stride: int,
) -> Any:
    out = np.zeros((len(poses), 3))
    bins, height, width = near.shape
    for i in range(len(poses)):
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        x0, y0 = poses[i, 0], poses[i, 1]
        r00, r01 = mount[0, 0] * c - mount[0, 1] * s, mount[0, 0] * s + mount[0, 1] * c
        r10, r11 = mount[1, 0] * c - mount[1, 1] * s, mount[1, 0] * s + mount[1, 1] * c
        r20, r21 = mount[2, 0] * c - mount[2, 1] * s, mount[2, 0] * s + mount[2, 1] * c
        total, by_chance, count = 0.0, 0.0, 0
        for j in range(first[view[i]], first[view[i] + 1], stride):
            k = seen[j]
            x, y, up = points[k, 0] - x0, points[k, 1] - y0, points[k, 2]
            z = r20 * x + r21 * y + mount[2, 2] * up + shift[2]
            if z < NEAREST_M:
                continue
            across = r00 * x + r01 * y + mount[0, 2] * up + shift[0]
            u = lens[0] * across / z + lens[2]
            if u < 0.0 or u >= lens[4]:
                continue
            down = r10 * x + r11 * y + mount[1, 2] * up + shift[1]
            v = lens[1] * down / z + lens[3]
            if v < 0.0 or v >= lens[5]:
                continue
            a, b, w = directions[k, 0], directions[k, 1], directions[k, 2]
            da, db = r00 * a + r01 * b + mount[0, 2] * w, r10 * a + r11 * b + mount[1, 2] * w
            dz = r20 * a + r21 * b + mount[2, 2] * w
            turn = math.atan2(lens[1] * (db * z - dz * down), lens[0] * (da * z - dz * across)) / math.pi * bins
            d = math.floor(turn + 0.5) % bins
            total += near[d, min(height - 1, int(v / SHRUNK + 0.5)), min(width - 1, int(u / SHRUNK + 0.5))]
            by_chance += chance[d]
            count += 1
        out[i, 0], out[i, 1], out[i, 2] = total, by_chance, count
    return out
