"""A camera on a robot on the floor: three unknowns instead of six, and the prior's share of the likelihood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.pose.estimate import Array
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.numerics.image_error import distance_slopes
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import cross
from world_models.frames import Pose, Pose2, wrap_angle

WEAK_SHIFT_M = 1.0
WEAK_TURN_RAD = 0.3
FEW = "too few measurements: the prior decides the rest"
NOT_BETTER = "no pose fits better than the prior"


@dataclass(frozen=True, slots=True, eq=False)
class PlanarPrior:
    """What is believed before the image is asked.

    Attributes:
        mean: (3,) x [m], y [m], heading [rad] of ``world_from_robot``.
        information: (3, 3) inverse covariance.
        given: whether the caller stated the covariance; else it is weak and only fills open directions.
    """

    mean: Array
    information: Array
    given: bool

    @property
    def arrays(self) -> tuple[Array, Array]:
        """Mean and information, as the compiled loops take them."""
        return self.mean, self.information


def build_planar_prior(prior: Pose2, covariance: Any) -> PlanarPrior:
    """The prior as a Gaussian; without a covariance a weak one (1 m, 0.3 rad)."""
    mean = np.array([prior.x_m, prior.y_m, prior.heading_rad])
    if covariance is None:
        weak = np.diag([WEAK_SHIFT_M**-2, WEAK_SHIFT_M**-2, WEAK_TURN_RAD**-2])
        return PlanarPrior(mean, weak, False)
    matrix = np.asarray(covariance, float)
    if matrix.shape != (3, 3):
        raise ValueError(f"expected a prior_covariance of shape (3, 3), got {matrix.shape}")
    return PlanarPrior(mean, np.linalg.inv(matrix), True)


def mounted(camera_from_robot: Pose) -> tuple[Array, Array]:
    """R and T of the mount, as the compiled loops take them."""
    return np.array(camera_from_robot.rotation), np.array(camera_from_robot.translation)


def prior_pull(states: Array, prior: PlanarPrior) -> tuple[Array, Array]:
    """Squared distance (...) of states (..., 3) to the prior in its deviations, and half its gradient (..., 3)."""
    away = states - prior.mean
    away[..., 2] = np.remainder(away[..., 2] + np.pi, 2.0 * np.pi) - np.pi
    pull = away @ prior.information
    return np.sum(away * pull, axis=-1), pull


def pose2(state: Array) -> Pose2:
    """The state as a pose on the floor."""
    return Pose2(float(state[0]), float(state[1]), wrap_angle(float(state[2])))


def compute_camera_poses(states: Array, camera_from_robot: Pose) -> tuple[Array, Array]:
    """Rotations (..., 3, 3) and translations (..., 3) of ``camera_from_world`` for states (..., 3)."""
    turn = camera_from_robot.rotation @ _robot_from_world(states[..., 2])
    floor = np.concatenate([states[..., :2], np.zeros_like(states[..., :1])], axis=-1)
    return turn, camera_from_robot.translation - np.matmul(turn, floor[..., None])[..., 0]


def compute_line_jacobian(
    points: Array, directions: Array, lines: LineSet, states: Array, camera_from_robot: Pose
) -> tuple[Array, Array]:
    """Image distances (..., n, 2) [px] and derivatives (..., n, 2, 3) by (x, y, heading).

    ``points`` and ``directions`` (..., n, 3), in the world, and ``lines`` (for its rays and focal length) may be
    gathered by subset; ``states`` is (..., 3). A heading change turns the world about the robot's own axis.
    """
    mount = camera_from_robot.rotation
    into_robot = np.swapaxes(_robot_from_world(states[..., 2]), -1, -2)
    floor = np.concatenate([states[..., :2], np.zeros_like(states[..., :1])], axis=-1)
    p_robot = (points - floor[..., None, :]) @ into_robot
    d_robot = directions @ into_robot
    p = p_robot @ mount.T + camera_from_robot.translation
    d = d_robot @ mount.T
    planes = cross(p, d)
    distances, slopes = distance_slopes(lines, planes)
    axes = np.swapaxes(mount @ np.swapaxes(into_robot, -1, -2), -1, -2)[..., None, :2, :]
    shifts = -cross(axes, d[..., None, :])
    turn = cross(_clockwise(p_robot) @ mount.T, d) + cross(p, _clockwise(d_robot) @ mount.T)
    moves = np.concatenate([shifts, turn[..., None, :]], axis=-2)
    return distances, slopes @ np.swapaxes(moves, -1, -2)


def compute_point_jacobian(
    points: Array, focal_px: Array, state: Array, camera_from_robot: Pose
) -> tuple[Array, Array, Array]:
    """Points in the camera frame (n, 3), pixels (n, 2) from the principal point and derivatives (n, 2, 3).

    Without lens distortion: compare with undistorted pixels.
    """
    mount = camera_from_robot.rotation
    into = _robot_from_world(state[2])
    p_robot = (points - np.array([state[0], state[1], 0.0])) @ into.T
    p = p_robot @ mount.T + camera_from_robot.translation
    axes = -(mount @ into)[:, :2].T
    moves = np.concatenate(
        [np.broadcast_to(axes, (len(p), 2, 3)), (_clockwise(p_robot) @ mount.T)[:, None, :]], axis=1
    )
    z = np.maximum(p[:, 2], 1e-9)
    image = p[:, :2] / z[:, None]
    slopes = np.zeros((len(p), 2, 3))
    slopes[:, 0, 0] = slopes[:, 1, 1] = 1.0 / z
    slopes[:, :, 2] = -image / z[:, None]
    slopes *= focal_px[:, None]
    return p, image * focal_px, slopes @ np.swapaxes(moves, 1, 2)


def _robot_from_world(headings_rad: Array) -> Array:
    c, s = np.cos(headings_rad), np.sin(headings_rad)
    zero, one = np.zeros_like(c), np.ones_like(c)
    return np.stack([c, s, zero, -s, c, zero, zero, zero, one], axis=-1).reshape(*np.shape(c), 3, 3)


def _clockwise(vectors: Array) -> Array:
    """-z x v: how points in the robot's frame move when the robot turns left."""
    return np.stack([vectors[..., 1], -vectors[..., 0], np.zeros_like(vectors[..., 0])], axis=-1)
