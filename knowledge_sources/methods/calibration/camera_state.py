"""How well the camera is known: its covariance, and what a picture that counts makes of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import compute_chi2
from knowledge_sources.methods.pose import CameraEstimate
from world_models.camera import CAMERA_UNKNOWNS, YAW, Camera
from world_models.entries import CameraState
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

HEIGHT, FOCAL = (CAMERA_UNKNOWNS.index(name) for name in ("height_m", "focal"))
SIGMA_TILT_RAD = SIGMA_ROLL_RAD = SIGMA_YAW_RAD = math.radians(1.5)
"""Standard deviations of the mounting's tilt, roll and yaw (issue: mounted by hand, up to 3 degrees and 8 cm otherwise
than believed, taken for two deviations)."""
SIGMA_HEIGHT_M = 0.04
"""Standard deviation of its height (issue: mounted by hand, up to 3 degrees and 8 cm otherwise than believed, taken
for two deviations)."""
SIGMA_FOCAL = 0.02  # standard deviation of the focal length, as a part of it (issue: up to 4 %)
SIGMA_CENTRE_PX = 0.5  # standard deviation of the principal point, along each axis (harvey experiment calibrate)
MAX_KNOWN_PX = 4.0  # up to this uncertainty in the picture the camera is taken as believed when lines are matched
MIN_MOVE_M = 0.3  # a picture counts if it was taken this far from those that have counted
MIN_TURN_RAD = math.radians(10.0)  # or in a direction that differs by this
MAX_COUNTED = 40  # number of pictures that are remembered as counted
LEAST_SIGMA_RAD = math.radians(0.02)  # tilt, roll and yaw are never known better: lines share errors
LEAST_SIGMA_M = 0.0015  # nor the height
LEAST_SIGMA_FOCAL = 0.001  # nor the focal length
LEAST_SIGMA_CENTRE_PX = 0.2  # nor the principal point
RIGID_DISTANCE_M = 2.5  # distance at which that uncertainty is taken
PRIOR_COVARIANCE_FACTOR = 4.0  # factor by which the belief's covariance is loosened as a prior of the pose
PRIOR_SIGMA_M = 0.05  # standard deviation of the place that is added to that prior
PRIOR_SIGMA_RAD = math.radians(1.5)  # standard deviation of the heading that is added to that prior


def compute_camera_covariance(camera: CameraState) -> Floats:
    """(7, 7) over :data:`~world_models.camera.CAMERA_UNKNOWNS`: as learnt, as stated, or as taken where nobody has."""
    return np.array(camera.covariance) if camera.covariance else compute_first_covariance(camera)


def compute_first_covariance(camera: CameraState) -> Floats:
    """(7, 7) before anything is learnt: what was stated, and what is taken where nothing was."""
    sigmas = (camera.sigma_tilt_rad or SIGMA_TILT_RAD, camera.sigma_roll_rad or SIGMA_ROLL_RAD,
              camera.sigma_yaw_rad or SIGMA_YAW_RAD, camera.sigma_height_m or SIGMA_HEIGHT_M,
              camera.sigma_focal or SIGMA_FOCAL,
              SIGMA_CENTRE_PX, SIGMA_CENTRE_PX)
    return np.asarray(np.diag(np.square(sigmas)))


def compute_least_covariance() -> Floats:
    """(7, 7) of a camera that is known as well as lines can tell."""
    sigmas = (LEAST_SIGMA_RAD, LEAST_SIGMA_RAD, LEAST_SIGMA_RAD, LEAST_SIGMA_M, LEAST_SIGMA_FOCAL,
              LEAST_SIGMA_CENTRE_PX, LEAST_SIGMA_CENTRE_PX)
    return np.asarray(np.diag(np.square(sigmas)))


def compute_knocked_covariance(camera: CameraState) -> Floats:
    """(7, 7) of a camera that may have been knocked: its directions are open again, height and lens as they were."""
    covariance = compute_camera_covariance(camera)
    opened = np.square((SIGMA_TILT_RAD, SIGMA_ROLL_RAD, SIGMA_YAW_RAD, 0.0, 0.0, 0.0, 0.0))
    return np.asarray(covariance + np.diag(opened))


def loosen(covariance: Floats) -> Floats:
    """A belief's covariance (3, 3), world, as the prior of a pose that lines tell."""
    return np.asarray(PRIOR_COVARIANCE_FACTOR * covariance
                      + np.diag([PRIOR_SIGMA_M**2, PRIOR_SIGMA_M**2, PRIOR_SIGMA_RAD**2]))


def add_yaw(pose_covariance: Floats, camera_covariance: Floats, known: Floats) -> Floats:
    """A pose's covariance (3, 3) where the camera's yaw may have become another: the heading follows the camera."""
    extra = max(float(camera_covariance[YAW, YAW] - known[YAW, YAW]), 0.0)
    return pose_covariance + np.diag([0.0, 0.0, extra])


def compute_camera_px(camera: Camera, covariance: Floats, distance_m: float) -> float:
    """How far a covariance (7, 7) moves the picture of what is so far away [px], but for the yaw: root mean square."""
    tilt, roll, _, height, focal, _, _ = np.sqrt(np.diag(covariance))
    aside_px = 0.25 * math.hypot(camera.width, camera.height)
    return math.hypot(camera.fy * tilt, aside_px * roll, camera.fy * height / distance_m, aside_px * focal)


def compute_scale_sigma(camera: CameraState) -> float:
    """How well it is known how large what it sees is, as a part of that: by its focal length and its height."""
    sigmas = np.sqrt(np.diag(compute_camera_covariance(camera)))
    return math.hypot(float(sigmas[FOCAL]), float(sigmas[HEIGHT]) / camera.mount.height_m)


def is_camera_known(robot: RobotModel, covariance: Floats) -> bool:
    """Whether a covariance (7, 7) moves what is seen by no more than lines are looked for where they are predicted."""
    px = compute_camera_px(robot.camera, covariance, RIGID_DISTANCE_M)
    return px <= MAX_KNOWN_PX


def has_counted(camera: CameraState, pose: Pose2) -> bool:
    """Whether a picture from about this pose (world) has counted already: it would be evidence counted twice."""
    return any(
        math.hypot(pose.x_m - x, pose.y_m - y) < MIN_MOVE_M
        and abs(wrap_angle(pose.heading_rad - heading)) < MIN_TURN_RAD
        for x, y, heading in camera.counted)


USUAL_SIGMAS = 3.37
"""Of three unknowns 99 % lie within; the root of their chi square."""


def widen(found: CameraEstimate, believed: Pose2, covariance: Floats) -> Floats:
    """(7, 7) of a camera that was found with a pose, no surer than how far that is from a belief and its covariance.

    Along a corridor a longer focal length looks like a place further on, and pairs that are wrong alike make both.
    Only what lies beyond ``USUAL_SIGMAS`` of the belief is taken for that.
    """
    sigmas = math.sqrt(compute_chi2(found.world_from_robot, believed, covariance + found.pose_covariance))
    strange = max(0.0, 1.0 - USUAL_SIGMAS / max(sigmas, 1e-9)) * found.world_from_robot.minus(believed)
    moved = found.covariance @ found.pose_slopes.T @ np.linalg.solve(found.pose_covariance, strange)
    return np.asarray(found.covariance + np.outer(moved, moved))


def learn(
    camera: CameraState, step: tuple[float, ...], covariance: Floats, pose: Pose2
) -> CameraState:
    """The state after a picture from a pose (world); no covariance below the floor of what lines have in common."""
    raised = covariance + np.maximum(compute_least_covariance() - np.diag(np.diag(covariance)), 0.0)
    looks = (*camera.counted, (pose.x_m, pose.y_m, pose.heading_rad))[-MAX_COUNTED:]
    return replace(camera.moved(step), covariance=to_tuples(raised), counted=looks)


def to_tuples(matrix: Floats) -> tuple[tuple[float, ...], ...]:
    """A symmetric matrix as nested tuples, so that a value that holds it can be compared."""
    return tuple(map(tuple, (0.5 * (matrix + matrix.T)).tolist()))
