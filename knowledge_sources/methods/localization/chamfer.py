"""Oriented chamfer matching: score many poses at once by the distance of projected model points to segments.

Each direction of line has a map of the distance to the next segment of about that direction. A pose is scored by
reading the maps where points of the model lines are projected. Source: G. Borgefors, Hierarchical chamfer matching,
PAMI 1988, with directions apart as in M.-Y. Liu et al., Fast directional chamfer matching, CVPR 2010.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Floats32, Ints
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.localization import LocalizationSettings
from world_models.camera import Camera
from world_models.frames import Pose


@dataclass(frozen=True, slots=True, eq=False)
class ChamferMaps:
    """Nearness of segments by direction and place in a picture.

    Attributes:
        near: (d, h, w) 1 on a segment of about that direction, falling to 0 at the reach; in reduced pixels.
        chance: (d,) its mean: the score of a point of a line that is not there.
    """

    near: Floats32
    chance: Floats32


def compute_chamfer_maps(
    segments_px: Any, camera: Camera, settings: LocalizationSettings = DEFAULT.localization
) -> ChamferMaps:
    """Compute maps of segments (n, 2, 2); each is drawn under its own direction and the two next to it."""
    shrink, directions = settings.chamfer_shrink, settings.chamfer_directions
    size = -(-camera.height // shrink), -(-camera.width // shrink)
    empty = np.full((directions, *size), 255, np.uint8)
    for (u0, v0), (u1, v1) in np.asarray(segments_px, float).reshape(-1, 2, 2):
        own = round(math.atan2(v1 - v0, u1 - u0) / math.pi * directions)
        ends = tuple((round(float(u) / shrink), round(float(v) / shrink)) for u, v in ((u0, v0), (u1, v1)))
        for k in (own - 1, own, own + 1):
            cv2.line(empty[k % directions], ends[0], ends[1], 0, 1)
    reach = settings.chamfer_reach_px / shrink
    away = [np.minimum(cv2.distanceTransform(layer, cv2.DIST_L2, 3), reach) / reach for layer in empty]
    near = np.ascontiguousarray(1.0 - np.asarray(away), np.float32)
    return ChamferMaps(near, near.mean(axis=(1, 2)))


def compute_chamfer_scores(
    maps: ChamferMaps, camera: Camera, camera_from_robot: Pose, poses: Floats, points_world: Floats,
    directions_world: Floats, first: Ints, visible: Ints, cell: Ints, stride: int = 1,
    settings: LocalizationSettings = DEFAULT.localization,
) -> Floats:
    """Score poses of the robot by the points of model lines that they show.

    Args:
        poses: (n, 3) x, y, heading [m, rad, world].
        points_world, directions_world: (p, 3) points of lines and unit directions of their lines.
        first, visible, cell: pose i shows the points ``visible[first[cell[i]] : first[cell[i] + 1]]``.
        stride: one of so many of these points is projected.

    Returns:
        (n, 3) for each pose: nearness summed over the points in view, the sum expected by chance, number of points.
    """
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height], float)
    return np.asarray(_score(
        maps.near, maps.chance, lens, np.array(camera_from_robot.rotation), np.array(camera_from_robot.translation),
        np.array(poses, float), points_world, directions_world, first, visible, np.array(cell, np.int64), stride,
        settings.chamfer_shrink, settings.min_point_depth_m))


@njit(cache=True, error_model="numpy")
def _score(
    near: Any, chance: Any, lens: Any, mount: Any, shift: Any, poses: Any, points: Any, directions: Any, first: Any,
    visible: Any, cell: Any, stride: int, shrink: int, min_depth_m: float,
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
        for j in range(first[cell[i]], first[cell[i] + 1], stride):
            k = visible[j]
            x, y, up = points[k, 0] - x0, points[k, 1] - y0, points[k, 2]
            z = r20 * x + r21 * y + mount[2, 2] * up + shift[2]
            if z < min_depth_m:
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
            total += near[d, min(height - 1, int(v / shrink + 0.5)), min(width - 1, int(u / shrink + 0.5))]
            by_chance += chance[d]
            count += 1
        out[i, 0], out[i, 1], out[i, 2] = total, by_chance, count
    return out
