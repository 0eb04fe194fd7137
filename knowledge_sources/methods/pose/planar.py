"""A camera on a robot on the floor: three unknowns instead of six, and the prior's share of the likelihood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.numerics.image_error import compute_distance_slopes
from knowledge_sources.methods.pose.numerics.kernels import RigidMotion
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import cross
from knowledge_sources.methods.pose.numerics.trimmed_noise import compute_spread
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.pose import PoseSettings
from world_models.frames import Pose, Pose2, wrap_angle

FEW = "too few measurements: the prior decides the rest"
NOT_BETTER = "no pose fits better than the prior"


@dataclass(frozen=True, slots=True, eq=False)
class PlanarPrior:
    """The belief before the measurement: a Gaussian over (x, y, heading).

    Attributes:
        mean: (3,) x [m], y [m], heading [rad] of ``world_from_robot``.
        information: (3, 3) inverse covariance.
        given: whether the caller stated the covariance; else it is weak and only fills open directions.
    """

    mean: Floats
    information: Floats
    given: bool


def build_planar_prior(prior: Pose2, covariance: Any, settings: PoseSettings = DEFAULT.pose) -> PlanarPrior:
    """The prior as a Gaussian; without a covariance (3, 3) a weak one.

    Raises:
        ValueError: a covariance of another shape.
    """
    mean = np.array([prior.x_m, prior.y_m, prior.heading_rad])
    if covariance is None:
        weak = np.diag([settings.weak_position_m**-2] * 2 + [settings.weak_heading_rad**-2])
        return PlanarPrior(mean, weak, False)
    matrix = np.asarray(covariance, float)
    if matrix.shape != (3, 3):
        raise ValueError(f"expected a prior_covariance of shape (3, 3), got {matrix.shape}")
    return PlanarPrior(mean, np.linalg.inv(matrix), True)


def to_rigid_motion(camera_from_robot: Pose) -> RigidMotion:
    """R and T of the mount, as the compiled functions take them."""
    return np.array(camera_from_robot.rotation), np.array(camera_from_robot.translation)


def to_pose2(state: Floats) -> Pose2:
    """The state (3,) as a pose on the floor."""
    return Pose2(float(state[0]), float(state[1]), wrap_angle(float(state[2])))


def compute_scatter(squares: float, count: int, settings: PoseSettings, bound: float) -> float:
    """The factor on the covariance of ``count`` inlier residuals that scatter more than sigma says, never below 1.

    Args:
        squares: sum of the squared inlier residuals over their stated variance.
        bound: of a pair's squares; what is beyond was left out, so that the inliers scatter less than the noise does.
    """
    freedom = count - 3
    if freedom < settings.min_scatter_freedom:
        return 1.0
    return max(1.0, compute_spread(squares / freedom, bound, settings.max_scatter))


def compute_camera_poses(states: Floats, camera_from_robot: Pose) -> tuple[Floats, Floats]:
    """Rotations (..., 3, 3) and translations (..., 3) of ``camera_from_world`` for states (..., 3)."""
    turn = camera_from_robot.rotation @ _rotate_into_robot(states[..., 2])
    floor = np.concatenate([states[..., :2], np.zeros_like(states[..., :1])], axis=-1)
    return turn, camera_from_robot.translation - np.matmul(turn, floor[..., None])[..., 0]


def compute_line_jacobian(
    points: Floats, directions: Floats, lines: LineSet, states: Floats, camera_from_robot: Pose
) -> tuple[Floats, Floats]:
    """Image distances (..., n, 2) [px] and derivatives (..., n, 2, 3) by (x, y, heading), in numpy for the tests.

    Args:
        points, directions: (..., n, 3) of the model lines [m, world]. lines: for its rays and focal length.
        states: (..., 3). A change of heading turns the world about the robot's own axis.
    """
    mount = camera_from_robot.rotation
    into_robot = np.swapaxes(_rotate_into_robot(states[..., 2]), -1, -2)
    floor = np.concatenate([states[..., :2], np.zeros_like(states[..., :1])], axis=-1)
    p_robot = (points - floor[..., None, :]) @ into_robot
    d_robot = directions @ into_robot
    p = p_robot @ mount.T + camera_from_robot.translation
    d = d_robot @ mount.T
    planes = cross(p, d)
    distances, slopes = compute_distance_slopes(lines, planes)
    axes = np.swapaxes(mount @ np.swapaxes(into_robot, -1, -2), -1, -2)[..., None, :2, :]
    shifts = -cross(axes, d[..., None, :])
    turn = cross(_turn_clockwise(p_robot) @ mount.T, d) + cross(p, _turn_clockwise(d_robot) @ mount.T)
    moves = np.concatenate([shifts, turn[..., None, :]], axis=-2)
    return distances, slopes @ np.swapaxes(moves, -1, -2)


def compute_point_jacobian(
    points: Floats, focal_px: Floats, state: Floats, camera_from_robot: Pose
) -> tuple[Floats, Floats, Floats]:
    """Points in the camera frame (n, 3) [m], pixels (n, 2) from the principal point and derivatives (n, 2, 3).

    Without lens distortion: compare with undistorted pixels.
    """
    mount = camera_from_robot.rotation
    into = _rotate_into_robot(state[2])
    p_robot = (points - np.array([state[0], state[1], 0.0])) @ into.T
    p = p_robot @ mount.T + camera_from_robot.translation
    axes = -(mount @ into)[:, :2].T
    moves = np.concatenate(
        [np.broadcast_to(axes, (len(p), 2, 3)), (_turn_clockwise(p_robot) @ mount.T)[:, None, :]], axis=1
    )
    z = np.maximum(p[:, 2], 1e-9)
    image = p[:, :2] / z[:, None]
    slopes = np.zeros((len(p), 2, 3))
    slopes[:, 0, 0] = slopes[:, 1, 1] = 1.0 / z
    slopes[:, :, 2] = -image / z[:, None]
    slopes *= focal_px[:, None]
    return p, image * focal_px, slopes @ np.swapaxes(moves, 1, 2)


def _rotate_into_robot(headings_rad: Floats) -> Floats:
    """Rotations (..., 3, 3) of ``robot_from_world``."""
    c, s = np.cos(headings_rad), np.sin(headings_rad)
    zero, one = np.zeros_like(c), np.ones_like(c)
    return np.stack([c, s, zero, -s, c, zero, zero, zero, one], axis=-1).reshape(*np.shape(c), 3, 3)


def _turn_clockwise(vectors: Floats) -> Floats:
    """-z x v: how points in the robot's frame move when the robot turns left."""
    return np.stack([vectors[..., 1], -vectors[..., 0], np.zeros_like(vectors[..., 0])], axis=-1)
