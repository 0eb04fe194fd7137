"""Which way do the level lines of a picture run? In buildings most run along two directions at right angles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.camera import Camera
from world_models.frames import Pose

Floats = NDArray[np.float64]

BINS = 90
"""Of one degree, round a right angle."""
UPRIGHT = 0.985
"""A segment whose plane through the camera holds an upright line to within 10 degrees says nothing of directions."""
LEVEL_EYE = 0.06
"""Nor does one at about the height of the eye, where all level lines look alike."""
SMOOTHING = ((-2, 0.4), (-1, 0.8), (0, 1.0), (1, 0.8), (2, 0.4))
RIGHT_ANGLE_RAD = 0.5 * math.pi
FEWEST = 4
"""Directions that fewer segments share tell nothing: in sight of a bare wall two or three of its marks may."""


def find_level_direction(segments_px: Any, camera: Camera, camera_from_robot: Pose) -> float | None:
    """The direction, modulo a right angle, along which most level lines seen as segments (n, 2, 2) run [rad].

    In the robot's frame. A segment and the camera span a plane; a level line that lies in it runs across the plane's
    normal. Lengths vote; None where too few segments agree.
    """
    angle, weight = _votes(np.asarray(segments_px, float).reshape(-1, 2, 2), camera, camera_from_robot)
    if len(angle) < FEWEST:
        return None
    counts = np.bincount(np.floor(angle / RIGHT_ANGLE_RAD * BINS).astype(np.int64) % BINS, weight, BINS)
    smooth = np.sum([w * np.roll(counts, k) for k, w in SMOOTHING], axis=0)
    return _about(angle, weight, (int(np.argmax(smooth)) + 0.5) / BINS * RIGHT_ANGLE_RAD)


def _votes(segments: Floats, camera: Camera, camera_from_robot: Pose) -> tuple[Floats, Floats]:
    """Direction modulo a right angle and weight of each segment that tells one."""
    flat = (segments - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    rays = np.concatenate([flat, np.ones((len(segments), 2, 1))], axis=2) @ camera_from_robot.rotation
    normal = np.cross(rays[:, 0], rays[:, 1])
    size = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(size, 1e-12)[:, None]
    along = rays[:, 1] - rays[:, 0]
    upright = np.abs(along[:, 2]) > UPRIGHT * np.maximum(np.linalg.norm(along, axis=1), 1e-12)
    low = np.minimum(np.abs(rays[:, 0, 2]), np.abs(rays[:, 1, 2])) < LEVEL_EYE
    tells = ~upright & (np.hypot(normal[:, 0], normal[:, 1]) > 0.15) & ~low & (size > 1e-9)
    n = normal[tells]
    length = np.linalg.norm(segments[tells, 1] - segments[tells, 0], axis=1)
    return np.mod(np.arctan2(n[:, 0], -n[:, 1]), RIGHT_ANGLE_RAD), np.minimum(length, 150.0)


def _about(angle: Floats, weight: Floats, centre: float) -> float | None:
    """The weighted mean of the directions within three degrees of one, if there are enough."""
    off = np.mod(angle - centre + 0.5 * RIGHT_ANGLE_RAD, RIGHT_ANGLE_RAD) - 0.5 * RIGHT_ANGLE_RAD
    near = np.abs(off) < math.radians(3.0)
    if np.count_nonzero(near) < FEWEST:
        return None
    return centre + float(np.sum((off * weight)[near])) / float(np.sum(weight[near]))
