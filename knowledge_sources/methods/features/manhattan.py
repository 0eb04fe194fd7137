"""Direction of the level lines of a picture, by histogram voting under the Manhattan-world assumption.

In buildings most level lines run along two directions at right angles.
Source: J. Coughlan, A. Yuille, Manhattan World, ICCV 1999.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats
from world_models.camera import Camera
from world_models.frames import Pose

DIRECTION_BINS = 90  # bins of the histogram of directions over a right angle
MAX_UPRIGHT_COSINE = 0.985  # largest cosine between a segment's rays and the vertical before it counts as upright
MIN_NORMAL_LEVEL = 0.15  # least level part of the unit normal of a segment's plane through the camera
MIN_EYE_SLOPE = 0.06  # least slope of a segment's rays: lines at the height of the camera look alike
MAX_VOTE_LENGTH_PX = 150.0  # px; length beyond which a segment's vote for a direction does not grow
# rad; largest angle from the best bin at which segments share its direction
MAX_DIRECTION_SPREAD_RAD = math.radians(3.0)
# least number of segments that share a direction: two or three marks on a bare wall may do so (experiment kidnap)
MIN_DIRECTION_SEGMENTS = 4

RIGHT_ANGLE_RAD = 0.5 * math.pi
_SMOOTHING = ((-2, 0.4), (-1, 0.8), (0, 1.0), (1, 0.8), (2, 0.4))
"""Shift and weight of each bin of the kernel that smooths the histogram."""


def find_level_direction(
    segments_px: Any, camera: Camera, camera_from_robot: Pose
) -> float | None:
    """The direction in the robot's frame, modulo a right angle, along which most level lines run [rad].

    A segment and the camera span a plane; a level line that lies in it runs across the plane's normal. Segments vote
    with their lengths.

    Args:
        segments_px: (n, 2, 2) segments seen by ``camera`` [px].

    Returns:
        None where too few segments agree.
    """
    angle, weight = _compute_votes(
        np.asarray(segments_px, float).reshape(-1, 2, 2), camera, camera_from_robot)
    if len(angle) < MIN_DIRECTION_SEGMENTS:
        return None
    bins = DIRECTION_BINS
    counts = np.bincount(np.floor(angle / RIGHT_ANGLE_RAD * bins).astype(np.int64) % bins, weight, bins)
    smooth = np.sum([w * np.roll(counts, k) for k, w in _SMOOTHING], axis=0)
    return _average_near(angle, weight, (int(np.argmax(smooth)) + 0.5) / bins * RIGHT_ANGLE_RAD)


def _compute_votes(
    segments: Floats, camera: Camera, camera_from_robot: Pose
) -> tuple[Floats, Floats]:
    """Direction modulo a right angle [rad] and weight of each segment that determines one."""
    flat = (segments - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    rays = np.concatenate([flat, np.ones((len(segments), 2, 1))], axis=2) @ camera_from_robot.rotation
    normal = np.cross(rays[:, 0], rays[:, 1])
    size = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(size, 1e-12)[:, None]
    along = rays[:, 1] - rays[:, 0]
    upright = np.abs(along[:, 2]) > MAX_UPRIGHT_COSINE * np.maximum(np.linalg.norm(along, axis=1), 1e-12)
    at_eye_height = np.minimum(np.abs(rays[:, 0, 2]), np.abs(rays[:, 1, 2])) < MIN_EYE_SLOPE
    level_part = np.hypot(normal[:, 0], normal[:, 1])
    usable = ~upright & (level_part > MIN_NORMAL_LEVEL) & ~at_eye_height & (size > 1e-9)
    n = normal[usable]
    length = np.linalg.norm(segments[usable, 1] - segments[usable, 0], axis=1)
    angle = np.mod(np.arctan2(n[:, 0], -n[:, 1]), RIGHT_ANGLE_RAD)
    return angle, np.minimum(length, MAX_VOTE_LENGTH_PX)


def _average_near(angle: Floats, weight: Floats, centre: float) -> float | None:
    """The weighted mean of the directions near one [rad]; None where there are too few."""
    off = np.mod(angle - centre + 0.5 * RIGHT_ANGLE_RAD, RIGHT_ANGLE_RAD) - 0.5 * RIGHT_ANGLE_RAD
    near = np.abs(off) < MAX_DIRECTION_SPREAD_RAD
    if np.count_nonzero(near) < MIN_DIRECTION_SEGMENTS:
        return None
    return centre + float(np.sum((off * weight)[near])) / float(np.sum(weight[near]))
