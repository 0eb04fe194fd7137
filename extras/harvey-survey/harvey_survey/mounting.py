"""Mounting of a camera, from one view of a board that lies on the floor, or stands on it, in front of the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from harvey_survey.intrinsics import BoardView, Calibration, Pattern
from knowledge_sources.methods.arrays import Floats

MAX_TILT_RAD = 1.55  # largest tilt of a camera before the view of its mounting board is refused
MAX_ROLL_RAD = 0.8  # largest roll of a camera before the view of its mounting board is refused
STEP = 1e-6  # of the pose, by which derivatives are taken


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
        deviations: (5,) standard deviations of the five parameters above.
    """

    height_m: float
    tilt_rad: float
    roll_rad: float
    to_board_m: float
    yaw_rad: float
    deviations: Floats


def estimate_mounting(
    calibration: Calibration, view: BoardView, pattern: Pattern, *, standing_at_m: float | None = None,
) -> Mounting:
    """Estimate the mounting from one view of a board, with its deviations propagated to first order.

    Args:
        standing_at_m: None for a board that lies flat on the floor; for an upright one the height of its lowest row of
            inner corners above the floor.

    Raises:
        ValueError: no such board is seen like this.
    """
    camera, points = calibration.camera, pattern.points[view.numbers]
    seen_by = camera.matrix, np.asarray(camera.distortion)
    found, turn, place = cv2.solvePnP(points, view.corners_px, *seen_by, flags=cv2.SOLVEPNP_IPPE)
    if not found:
        raise ValueError("expected corners of a flat board, got none that a pose explains")
    turn, place = cv2.solvePnPRefineLM(points, view.corners_px, *seen_by, turn, place)
    pose = np.concatenate([np.ravel(turn), np.ravel(place)])
    values = _compute_parameters(pose, pattern, standing_at_m)
    if not (values[0] > 0.0 and abs(values[1]) < MAX_TILT_RAD and abs(values[2]) < MAX_ROLL_RAD):
        where = "on the floor" if standing_at_m is None else "upright"
        raise ValueError(f"expected a board {where} before the camera, got one that puts it {values[0]:.2f} m high, "
                         f"tilted by {math.degrees(values[1]):.0f} and rolled by {math.degrees(values[2]):.0f} degrees")
    slope = np.stack([(_compute_parameters(pose + move, pattern, standing_at_m) - values) / STEP
                      for move in STEP * np.eye(6)], axis=1)
    covariance = slope @ _compute_pose_covariance(pose, view, points, calibration) @ slope.T
    height_m, tilt_rad, roll_rad, to_board_m, yaw_rad = (float(v) for v in values)
    return Mounting(height_m, tilt_rad, roll_rad, to_board_m, yaw_rad, np.sqrt(np.diag(covariance)))


def _compute_pose_covariance(pose: Floats, view: BoardView, points: Floats, calibration: Calibration) -> Floats:
    """(6, 6) covariance of a pose (6,), from the larger noise of the corners, here or in the calibration, and from the
    deviations of focal lengths and principal point, taken as independent.
    """
    camera = calibration.camera
    px, slope = cv2.projectPoints(points, pose[:3], pose[3:], camera.matrix, np.asarray(camera.distortion))
    jacobian = np.asarray(slope, float)
    here = float(np.sum((view.corners_px - px.reshape(-1, 2)) ** 2)) / (view.corners_px.size - 6)
    by_pose, by_camera = jacobian[:, :6], jacobian[:, 6:10]
    normal = np.linalg.inv(by_pose.T @ by_pose)
    moved = normal @ by_pose.T @ by_camera * calibration.deviations[:4]
    return np.asarray(max(here, calibration.rms_px**2 / 2.0) * normal + moved @ moved.T)


def _compute_parameters(pose: Floats, pattern: Pattern, standing_at_m: float | None) -> Floats:
    """The five parameters (5,) of :class:`Mounting` from a board's pose (6,): rotation vector, place, in the camera."""
    rotation = np.asarray(cv2.Rodrigues(pose[:3])[0], float)
    corners = pattern.points @ rotation.T + pose[3:]
    if standing_at_m is None:
        up = rotation[:, 2] * (-1.0 if rotation[:, 2] @ corners[0] > 0.0 else 1.0)  # the side that is seen
    else:
        axes = np.concatenate([rotation[:, :2].T, -rotation[:, :2].T])
        up = axes[np.argmin(axes[:, 1])]  # the direction along the board that is most upward in the picture
    ahead = np.array([0.0, 0.0, 1.0]) - up[2] * up  # the optical axis, projected to the floor
    ahead /= np.linalg.norm(ahead)
    away = (corners @ ahead).reshape(pattern.rows, pattern.columns)
    if standing_at_m is None:
        height_m = float(-np.mean(corners @ up))
        to_board_m = min(float(np.mean(side)) for side in (away[0], away[-1], away[:, 0], away[:, -1]))
    else:
        heights = corners @ up
        height_m = standing_at_m - float(np.mean(heights[heights < np.min(heights) + 0.5 * pattern.square_m]))
        to_board_m = float(np.mean(away))
    tilt, roll = math.atan2(-up[2], math.hypot(up[0], up[1])), math.atan2(-up[0], -up[1])
    return np.array([height_m, tilt, roll, to_board_m, _compute_yaw(rotation, up, ahead)])


def _compute_yaw(rotation: Floats, up: Floats, ahead: Floats) -> float:
    """Angle of the board's level lines against the camera's right, seen from above, within 45 degrees [rad]."""
    right = np.cross(ahead, up)
    x, y = rotation[:, :2].T
    level = x if abs(x @ up) < abs(y @ up) or abs(x @ right) > abs(y @ right) else y
    angle = math.atan2(float(level @ ahead), float(level @ right))
    return math.pi / 4.0 - (angle + math.pi / 4.0) % (math.pi / 2.0)  # the camera is turned the other way
