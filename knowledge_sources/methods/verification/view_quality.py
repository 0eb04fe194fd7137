"""How precise would a pose from this view be? The information matrix of the predicted lines, inverted."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.pose.planar import compute_point_jacobian
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

EPSILON_INFORMATION = 1e-6
"""Keeps the information matrix invertible where the lines leave a direction open."""


@dataclass(frozen=True, slots=True)
class ViewQuality:
    """Expected standard deviations of a pose from a view.

    Attributes:
        sigma_m: of the position, in its worst direction.
        sigma_rad: of the heading.
        lines: number of model lines.
    """

    sigma_m: float
    sigma_rad: float
    lines: int


def compute_view_quality(
    lines_world: Floats, camera: Camera, camera_from_robot: Pose, world_from_robot: Pose2, sigma_px: float
) -> ViewQuality:
    """Compute the Cramer-Rao bound of the pose from visible model lines (n, 2, 3) [m, world].

    Each end of a line is measured across the line with standard deviation ``sigma_px``. Infinite without lines.
    """
    n = len(lines_world)
    if n == 0:
        return ViewQuality(math.inf, math.inf, 0)
    state = np.array([world_from_robot.x_m, world_from_robot.y_m, world_from_robot.heading_rad])
    focal = np.array([camera.fx, camera.fy])
    _, pixels, slopes = compute_point_jacobian(lines_world.reshape(-1, 3), focal, state, camera_from_robot)
    along = np.diff(pixels.reshape(n, 2, 2), axis=1)[:, 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    rows = np.einsum("nj,nejk->nek", across, slopes.reshape(n, 2, 2, 3)).reshape(-1, 3) / sigma_px
    covariance = np.linalg.inv(rows.T @ rows + EPSILON_INFORMATION * np.eye(3))
    return ViewQuality(
        math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1])), math.sqrt(float(covariance[2, 2])), n
    )
