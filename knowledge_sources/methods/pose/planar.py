"""A camera on a robot on the floor: three unknowns instead of six; and the pose from points tracked in the image.

Where the model is inexact its errors are modes (:class:`world_models.building.model_errors.LineErrors`): a wall with
all that is on it, a door, a thing. To first order in the image, the distance of a segment's end from its model line is
r + J dx + A a, with the pose's change dx and the modes' amplitudes a in standard deviations, of which a prior is known:
N(0, I). Errors that lines share do not average out. So the amplitudes are not solved for but integrated out: the
residuals have the covariance S = sigma^2 I + A A', and the pose of greatest marginal likelihood is that of generalised
least squares, with the covariance (J' S^-1 J + prior)^-1. It is what a Schmidt-Kalman filter states whose considered
states are the modes. Source: S. F. Schmidt, Application of state-space methods to navigation problems, Advances in
Control Systems 3, 1966.
"""

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
    OUTLIER_SIGMAS,
    LineSet,
    build_line_set,
    check_sigma,
    compute_distance_slopes,
    cross,
    invert_information,
)
from world_models.building.model_errors import LineErrors
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.frames import Pose, Pose2, wrap_angle

POINT_OUTLIER_SIGMAS = 4.0  # a point further than this many standard deviations off is an outlier
WEAK_POSITION_M = 1.0  # m; standard deviation of a robot's position where none is given
WEAK_HEADING_RAD = 0.3  # rad; standard deviation of a robot's heading where none is given
MAX_FLOOR_ITERATIONS = 20  # levenberg-Marquardt steps for the three unknowns of a robot
HUBER_SIGMAS = 1.5  # deviation beyond which a point pulls with a constant force (Huber)
MAX_POINT_ROUNDS = 6  # rounds in which inliers and pose may still change each other
SHARED_PRIOR_FACTOR = 3.0
"""A prior of the same model is loosened by so many times what the model's errors make uncertain."""
MARGINAL_SPREAD = 1.4
"""Factor on the standard deviations of such a pose, for segments matched to a wrong line nearby (after a few poses on
generated floors)."""
MAX_FEW_LINES = 3  # so few lines move a prior of unknown worth only as far as their noise demands
MAX_MARGINAL_ROUNDS = 12  # rounds in which lines that do not agree are left out
MAX_MARGINAL_STEPS = 8  # steps of Gauss-Newton in each of them
MIN_MARGINAL_STEP = 1e-7  # step [m, rad] at which these end (convergence)

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


def compute_displaced_jacobian(
    lines: LineSet, shifts: Floats, state: Floats, camera_from_robot: Pose
) -> tuple[Floats, Floats, Floats]:
    """Distances (n, 2) [px], derivatives (n, 2, 3) by (x, y, heading) and (n, 2, k) by the amplitudes of the modes.

    Args:
        shifts: (k, n, 3) as in :class:`LineErrors`, one row a line.
    """
    points = lines.points[:, 0]
    distances, by_pose = compute_line_jacobian(points, lines.directions, lines, state, camera_from_robot)
    rotation, translation = compute_camera_poses(state, camera_from_robot)
    along = lines.directions @ rotation.T
    planes = cross(points @ rotation.T + translation, along)
    _, slopes = compute_distance_slopes(lines, planes)
    moved = cross(shifts @ rotation.T, along[None])
    return distances, by_pose, np.einsum("ned,knd->nek", slopes, moved)


def compute_sigmas_px(
    lines_world: Floats, errors: LineErrors, camera: Camera, camera_from_robot: Pose, pose: Pose2
) -> Floats:
    """(n,) by how much the model's errors displace each line in the image, across it: a standard deviation [px].

    The larger of a line's two ends; 0 where it is not in view.
    """
    rotation, translation = compute_camera_poses(pose.vector, camera_from_robot)
    projected, _ = camera.project_segments(np.array(lines_world, float), Pose(rotation, translation))
    sigmas = np.zeros(len(lines_world))
    seen = np.flatnonzero(np.isfinite(projected).all(axis=(1, 2)))
    if len(seen) and len(errors.displacement_modes):
        lines = build_line_set(lines_world[seen], projected[seen], camera, 1.0)
        _, _, by_mode = compute_displaced_jacobian(lines, errors.displacements[:, seen], pose.vector, camera_from_robot)
        sigmas[seen] = np.sqrt(np.sum(by_mode**2, axis=2)).max(axis=1)
    return sigmas


class MarginalFit(NamedTuple):
    """A pose of greatest marginal likelihood.

    Attributes:
        state: (3,) x [m], y [m], heading [rad].
        covariance: (3, 3).
        near: (n,) the lines that agree with it.
        residuals_px: (n, 2) what of the distances the model's errors do not explain.
        cost: squared distances over their covariance, plus the prior's share.
    """

    state: Floats
    covariance: Floats
    near: Mask
    residuals_px: Floats
    cost: float


def maximise_marginal(
    lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, prior: PlanarPrior, state: Floats, near: Mask,
) -> MarginalFit:
    """The pose of greatest marginal likelihood from lines of which some are wrong.

    Lines whose remaining residual is beyond ``OUTLIER_SIGMAS`` are left out, the worst first.

    Args:
        shifts: (k, n, 3) displacement of each line by one standard deviation of each mode [m, world].
        sigma_px: of a segment's end across its line.
        state, near: where to start, and the lines (n,) that are used at first.
    """
    bound, near = 2.0 * OUTLIER_SIGMAS**2, near.copy()
    prior = _loosen(prior, lines.take(near), shifts[:, near], sigma_px, mount, state)
    for _ in range(MAX_MARGINAL_ROUNDS):
        state = _minimise(lines.take(near), shifts[:, near], sigma_px, mount, prior, state)
        squares = np.where(near, np.sum(_explain(lines, shifts, sigma_px, mount, state, near) ** 2, axis=1), 0.0)
        worst = float(squares.max(initial=0.0))
        if worst <= bound * sigma_px**2 or np.count_nonzero(near) <= MAX_FEW_LINES:
            break
        near = near & (squares < 0.5 * worst)
    r, slopes, weights = _linearise(lines.take(near), shifts[:, near], sigma_px, mount, state)
    away = to_pose2(state).minus(to_pose2(prior.mean))
    chi2 = float(r @ weights @ r)
    scatter = MARGINAL_SPREAD**2 * compute_scatter(chi2, len(r), bound)
    return MarginalFit(
        state, np.asarray(np.linalg.inv(slopes.T @ weights @ slopes + prior.information) * scatter, float), near,
        _explain(lines, shifts, sigma_px, mount, state, near), chi2 + float(away @ prior.information @ away))


def _loosen(
    prior: PlanarPrior, lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, state: Floats,
) -> PlanarPrior:
    """The prior without what it may share with these lines: it came of the same model, with the same errors.

    The share is the part of the covariance that the model's errors make. Where the lines tell nothing it is none.
    """
    if not prior.given or not np.any(prior.information):
        return prior
    _, slopes, weights = _linearise(lines, shifts, sigma_px, mount, state)
    exact = slopes.T @ slopes / sigma_px**2 + prior.information
    share = np.linalg.inv(slopes.T @ weights @ slopes + prior.information) - np.linalg.inv(exact)
    loose = np.linalg.inv(prior.information) + SHARED_PRIOR_FACTOR * share
    return PlanarPrior(prior.mean, np.asarray(np.linalg.inv(loose), float), True)


def _minimise(
    lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, prior: PlanarPrior, state: Floats,
) -> Floats:
    """Gauss-Newton on generalised least squares."""
    for _ in range(MAX_MARGINAL_STEPS):
        r, slopes, weights = _linearise(lines, shifts, sigma_px, mount, state)
        hessian = slopes.T @ weights @ slopes + prior.information
        away = to_pose2(state).minus(to_pose2(prior.mean))
        step = np.linalg.solve(hessian, slopes.T @ weights @ r + prior.information @ away)
        state = state - step
        if np.abs(step).max() < MIN_MARGINAL_STEP:
            break
    return state


def _linearise(
    lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, state: Floats
) -> tuple[Floats, Floats, Floats]:
    """Distances (2n,), their derivatives (2n, 3) by the state, and the inverse of their covariance (2n, 2n)."""
    distances, by_pose, by_mode = compute_displaced_jacobian(lines, shifts, state, mount)
    modes = by_mode.reshape(2 * len(lines), -1)
    weights = np.linalg.inv(sigma_px**2 * np.eye(len(modes)) + modes @ modes.T)
    return distances.reshape(-1), by_pose.reshape(-1, 3), np.asarray(weights, float)


def _explain(lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, state: Floats, near: Mask) -> Floats:
    """(n, 2) what the modes, as the lines ``near`` tell them, leave of each line's distances [px]."""
    distances, _, by_mode = compute_displaced_jacobian(lines, shifts, state, mount)
    modes = by_mode[near].reshape(-1, by_mode.shape[2])
    information = modes.T @ modes / sigma_px**2 + np.eye(by_mode.shape[2])
    amplitudes = np.linalg.solve(information, modes.T @ distances[near].reshape(-1)) / sigma_px**2
    return np.asarray(distances - by_mode @ amplitudes)


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
