"""A camera on a robot on the floor: three unknowns instead of six; and the pose from points tracked in the image."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose import kernels
from knowledge_sources.methods.pose.estimate import (
    BEHIND,
    MAX_SCATTER,
    MIN_SCATTER_FREEDOM,
    PlanarEstimate,
    compute_spread,
)
from knowledge_sources.methods.pose.kernels import RigidMotion
from knowledge_sources.methods.pose.line_set import (
    LineSet,
    check_sigma,
    compute_distance_slopes,
    cross,
    invert_information,
)
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.frames import Pose, Pose2, wrap_angle

POINT_OUTLIER_SIGMAS = 4.0  # a point further than this many standard deviations off is an outlier
WEAK_POSITION_M = 1.0  # m; standard deviation of a robot's position where none is given
WEAK_HEADING_RAD = 0.3  # rad; standard deviation of a robot's heading where none is given
MAX_FLOOR_ITERATIONS = 20  # levenberg-Marquardt steps for the three unknowns of a robot
HUBER_SIGMAS = 1.5  # deviation beyond which a point pulls with a constant force (Huber)
MAX_POINT_ROUNDS = 6  # rounds in which inliers and pose may still change each other

FEW = "too few measurements: the prior decides the rest"
NOT_BETTER = "no pose fits better than the prior"
TOO_FAR = "too far from the predicted point"
MIN_POINTS = 2
"""Two points decide three unknowns."""


class PlanarPrior(NamedTuple):
    """The belief before the measurement: a Gaussian over (x, y, heading).

    Attributes:
        mean: (3,) x [m], y [m], heading [rad] of ``world_from_robot``.
        information: (3, 3) inverse covariance.
        given: whether the caller stated the covariance; else it is weak and only fills open directions.
    """

    mean: Floats
    information: Floats
    given: bool


def build_planar_prior(prior: Pose2, covariance: Any) -> PlanarPrior:
    """The prior as a Gaussian; without a covariance (3, 3) a weak one.

    Raises:
        ValueError: a covariance of another shape.
    """
    mean = prior.vector
    if covariance is None:
        weak = np.diag([WEAK_POSITION_M**-2] * 2 + [WEAK_HEADING_RAD**-2])
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


def compute_scatter(squares: float, count: int, bound: float) -> float:
    """The factor on the covariance of ``count`` inlier residuals that scatter more than sigma says, never below 1.

    Args:
        squares: sum of the squared inlier residuals over their stated variance.
        bound: of a pair's squares; what is beyond was left out, so that the inliers scatter less than the noise does.
    """
    freedom = count - 3
    if freedom < MIN_SCATTER_FREEDOM:
        return 1.0
    return max(1.0, compute_spread(squares / freedom, bound, MAX_SCATTER))


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
    points: Floats, camera: Camera, pose: Pose2, camera_from_robot: Pose
) -> tuple[Floats, Floats, Floats]:
    """Points in the camera frame (n, 3) [m], pixels (n, 2) from the principal point and derivatives (n, 2, 3).

    Without lens distortion: compare with undistorted pixels.
    """
    mount = camera_from_robot.rotation
    into = _rotate_into_robot(pose.vector[2])
    p_robot = (points - np.array([pose.x_m, pose.y_m, 0.0])) @ into.T
    focal_px = np.array([camera.fx, camera.fy])
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


def planar_from_points(
    points_world: Any,
    points_px: Any,
    camera: Camera,
    camera_from_robot: Pose,
    prior: Pose2,
    prior_covariance: Any = None,
    *,
    sigma_px: Any = 1.0,
) -> PlanarEstimate:
    """Robot pose on the floor by Levenberg-Marquardt on Huber's loss, on the points that agree with it.

    First on all points; then points beyond ``POINT_OUTLIER_SIGMAS`` are left out, until they stay the same.

    Args:
        points_world: (n, 3) [m]. points_px: (n, 2) observed, as the lens shows them.
        camera_from_robot: the mount. prior: ``world_from_robot``.
        prior_covariance: (3, 3) of (x, y, heading); ``None``: a weak one.
        sigma_px: standard deviation of u and of v, one number or (n,).

    Raises:
        ValueError: shapes that do not match, a value that is not finite, a sigma that is not > 0.
    """
    world, pixels = _check_points(points_world, points_px)
    sigma = check_sigma(sigma_px, len(world))
    belief = build_planar_prior(prior, prior_covariance)
    focal = np.array([camera.fx, camera.fy])
    observed = camera.undistort(pixels) - (camera.cx, camera.cy)
    mount = to_rigid_motion(camera_from_robot)
    points = world, observed, sigma, focal, belief.mean, belief.information, mount
    bound = POINT_OUTLIER_SIGMAS**2

    def minimise(state: Floats, chosen: Mask, iterations: int = MAX_FLOOR_ITERATIONS) -> tuple[Floats, float]:
        end, _, loss, _ = kernels.minimise_points(points, state, chosen, HUBER_SIGMAS, NEAR_PLANE_M, iterations)
        return end, float(loss)

    def find_near(state: Floats) -> Mask:
        depth, residuals, _ = kernels.project_points(points, state)
        return np.asarray((depth > NEAR_PLANE_M) & (np.sum(residuals**2, axis=1) <= bound))

    state, _ = minimise(belief.mean, np.ones(len(world), bool))
    near = find_near(state)
    for _ in range(MAX_POINT_ROUNDS):
        state, _ = minimise(state, near)
        again = find_near(state)
        if np.array_equal(again, near):
            break
        near = again
    depth, residuals, slopes = kernels.project_points(points, state)
    j = slopes[near].reshape(-1, 3)
    scatter = compute_scatter(float(np.sum(residuals[near] ** 2)), residuals[near].size, bound)
    return PlanarEstimate(
        world_from_robot=to_pose2(state),
        covariance=invert_information(j.T @ j + belief.information) * scatter,
        inliers=near,
        residuals_px=residuals * sigma[:, None],
        rejected=tuple(
            None if n else (BEHIND if d <= NEAR_PLANE_M else TOO_FAR) for n, d in zip(near, depth, strict=True)),
        cost=minimise(state, near, 0)[1],
        reason=FEW if not belief.given and int(np.count_nonzero(near)) < MIN_POINTS else None,
    )


def _check_points(points_world: Any, points_px: Any) -> tuple[Floats, Floats]:
    world = np.array(points_world, float).reshape(-1, 3)
    pixels = np.array(points_px, float).reshape(-1, 2)
    if len(world) != len(pixels):
        raise ValueError(f"expected one pixel a point, got {len(world)} points and {len(pixels)} pixels")
    if not (np.all(np.isfinite(world)) and np.all(np.isfinite(pixels))):
        raise ValueError("expected finite points, got a value that is not")
    return world, pixels
