"""Mounting of a camera, from one view of a board that lies on the floor, or stands on it, in front of the robot."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.calibration.intrinsics import Calibration, Pattern, project_board
from world_models.camera import Camera

MAX_TILT_RAD = 1.55  # largest tilt of a camera before the view of its mounting board is refused
MAX_ROLL_RAD = 0.8  # largest roll of a camera before the view of its mounting board is refused


@dataclass(frozen=True, eq=False)
class Mounting:
    """Place and orientation of a camera against the floor.

    Attributes:
        height_m: optical centre above the floor.
        tilt_rad: downward; roll_rad: clockwise as the camera looks (its right side is low).
        to_board_m: from the camera ahead along the floor: to the nearest inner corners of a lying board, to the middle
            of a standing one.
        yaw_rad: angle of the board's rows against the picture: the camera's yaw on the robot, to the left, where the
            board was laid square to the robot.
        covariance: (5, 5) of the five parameters above.
        rms_px: distance of the found corners from the projected ones.
    """

    height_m: float
    tilt_rad: float
    roll_rad: float
    to_board_m: float
    yaw_rad: float
    covariance: Floats
    rms_px: float

    @property
    def deviations(self) -> Floats:
        """(5,) standard deviations of the five parameters."""
        return np.sqrt(np.diag(self.covariance))


def estimate_mounting(
    calibration: Calibration, corners_px: Floats, pattern: Pattern, *, standing_at_m: float | None = None,
) -> Mounting:
    """Estimate the mounting from one view of a board, with its covariance propagated to first order.

    Args:
        corners_px: (n, 2) inner corners in the picture, row by row [px].
        standing_at_m: None for a board that lies flat on the floor; for an upright one the height of its lowest row of
            inner corners above the floor.

    Raises:
        ValueError: no such board is seen like this.
    """
    camera = calibration.camera
    pose = _solve_pose(camera, corners_px, pattern)

    def compute(values: Floats) -> Floats:
        if standing_at_m is None:
            return _compute_from_lying(values, pattern)
        return _compute_from_standing(values, pattern, standing_at_m)

    values = compute(pose)
    px, jacobian = project_board(pattern, pose[:3], pose[3:], camera.matrix, np.asarray(camera.distortion))
    slope = _differentiate(compute, pose)
    covariance = slope @ _compute_pose_covariance(jacobian, corners_px - px, calibration) @ slope.T
    if not (values[0] > 0.0 and abs(values[1]) < MAX_TILT_RAD and abs(values[2]) < MAX_ROLL_RAD):
        where = "on the floor" if standing_at_m is None else "upright"
        raise ValueError(f"expected a board {where} before the camera, got one that puts it {values[0]:.2f} m high, "
                         f"tilted by {math.degrees(values[1]):.0f} and rolled by {math.degrees(values[2]):.0f} degrees")
    rms = float(np.sqrt(np.mean(np.sum((corners_px - px) ** 2, axis=1))))
    height_m, tilt_rad, roll_rad, to_board_m, yaw_rad = (float(v) for v in values)
    return Mounting(height_m, tilt_rad, roll_rad, to_board_m, yaw_rad, covariance, rms)


def _solve_pose(camera: Camera, corners_px: Floats, pattern: Pattern) -> Floats:
    """(6,) rotation vector and place of the board in the camera's frame (IPPE, then Levenberg-Marquardt)."""
    k = np.asarray(camera.distortion)
    found, turn, place = cv2.solvePnP(pattern.points, corners_px, camera.matrix, k, flags=cv2.SOLVEPNP_IPPE)
    if not found:
        raise ValueError("expected corners of a flat board, got none that a pose explains")
    turn, place = cv2.solvePnPRefineLM(pattern.points, corners_px, camera.matrix, k, turn, place)
    return np.concatenate([np.ravel(turn), np.ravel(place)])


def _compute_from_lying(pose: Floats, pattern: Pattern) -> Floats:
    """The five parameters from a pose (6,) of a board that lies on the floor."""
    rotation, corners = _transform_corners(pose, pattern)
    up = rotation[:, 2] * (-1.0 if rotation[:, 2] @ corners[0] > 0.0 else 1.0)  # the side that is seen
    height_m, to_board_m = float(-np.mean(corners @ up)), _average_nearest(corners @ _compute_ahead(up), pattern)
    return _to_parameters(up, height_m, to_board_m, _compute_yaw(rotation, up))


def _compute_from_standing(pose: Floats, pattern: Pattern, lowest_m: float) -> Floats:
    """The five parameters from a pose (6,) of an upright board."""
    rotation, corners = _transform_corners(pose, pattern)
    axes = np.concatenate([rotation[:, :2].T, -rotation[:, :2].T])
    up = axes[np.argmin(axes[:, 1])]  # the direction along the board that is most upward in the picture
    heights = corners @ up
    lowest = heights[heights < np.min(heights) + 0.5 * pattern.square_m]
    height_m, to_board_m = lowest_m - float(np.mean(lowest)), float(np.mean(corners @ _compute_ahead(up)))
    return _to_parameters(up, height_m, to_board_m, _compute_yaw(rotation, up))


def _transform_corners(pose: Floats, pattern: Pattern) -> tuple[Floats, Floats]:
    """Rotation (3, 3) of the board, and its corners (n, 3), in the camera's frame."""
    rotation = np.asarray(cv2.Rodrigues(pose[:3])[0], float)
    return rotation, pattern.points @ rotation.T + pose[3:]


def _average_nearest(distances: Floats, pattern: Pattern) -> float:
    """The mean distance of the outermost row or column of corners that is nearest."""
    grid = distances.reshape(pattern.rows, pattern.columns)
    return float(min(np.mean(side) for side in (grid[0], grid[-1], grid[:, 0], grid[:, -1])))


def _compute_ahead(up: Floats) -> Floats:
    """The camera's optical axis projected to the floor, as a unit vector (3,) in its own frame."""
    flat = np.array([0.0, 0.0, 1.0]) - up[2] * up
    return np.asarray(flat / np.linalg.norm(flat))


def _compute_yaw(rotation: Floats, up: Floats) -> float:
    """Angle of the board's level lines against the camera's right, seen from above, within 45 degrees [rad]."""
    ahead = _compute_ahead(up)
    right = np.cross(ahead, up)
    x, y = rotation[:, :2].T
    level = x if abs(x @ up) < abs(y @ up) or abs(x @ right) > abs(y @ right) else y
    angle = math.atan2(float(level @ ahead), float(level @ right))
    return math.pi / 4.0 - (angle + math.pi / 4.0) % (math.pi / 2.0)  # the camera is turned the other way


def _to_parameters(up: Floats, height_m: float, to_board_m: float, yaw_rad: float) -> Floats:
    """The five parameters (5,) of :class:`Mounting`."""
    tilt, roll = math.atan2(-up[2], math.hypot(up[0], up[1])), math.atan2(-up[0], -up[1])
    return np.array([height_m, tilt, roll, to_board_m, yaw_rad])


def _differentiate(function: Callable[[Floats], Floats], pose: Floats, step: float = 1e-6) -> Floats:
    """Derivative (5, 6) by central differences."""
    moves = step * np.eye(6)
    return np.stack([(function(pose + m) - function(pose - m)) / (2.0 * step) for m in moves], axis=1)


def _compute_pose_covariance(jacobian: Floats, residuals_px: Floats, calibration: Calibration) -> Floats:
    """(6, 6) covariance of the pose, from the larger noise of the corners, here or in the calibration, and from the
    covariance of the intrinsics.
    """
    here = float(np.sum(residuals_px**2)) / (residuals_px.size - 6)
    by_pose, by_camera = jacobian[:, :6], jacobian[:, 6 : 6 + len(calibration.covariance)]
    normal = np.linalg.inv(by_pose.T @ by_pose)
    moved = normal @ by_pose.T @ by_camera
    return np.asarray(max(here, calibration.sigma_px**2) * normal + moved @ calibration.covariance @ moved.T)
