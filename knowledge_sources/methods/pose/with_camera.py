"""Robot pose on the floor and the camera's own state from matched lines: maximum a posteriori, the pose marginalised.

Source: §6.2 with the residual in the image; the camera's tilt, roll, height, focal length and principal point are
unknowns besides (x, y, heading), each with a prior. The camera's yaw on the robot is not: one picture cannot tell it
from the robot's heading. So are the amplitudes of the model's modes (:mod:`world_models.building.model_errors`): walls
that stand elsewhere look like another lens, and are integrated out. What is likelier is told by the marginal
likelihood, over all that is not known (Laplace; MacKay, Information theory, inference and learning algorithms, 2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.line_set import check_matched_arrays
from knowledge_sources.methods.pose.planar import to_pose2
from world_models.building.model_errors import LineErrors
from world_models.camera import CAMERA_UNKNOWNS, YAW, Camera, CameraMount
from world_models.compiled import compiled
from world_models.frames import Pose2

WIDTHS_PX = (24.0, 12.0, 6.0, 3.0, 1.5)  # widths of the loss by which pose and camera are refined
STEPS_A_WIDTH = 2  # steps of Gauss-Newton at each width
OUTLIER_SIGMAS = 3.0  # a line further off than this is an outlier
MAX_ROUNDS = 8  # most rounds of choosing the lines that agree
MIN_FREEDOM = 6  # fewest degrees of freedom by which the noise is judged
POSE = 3
"""Unknowns of the robot's pose; those of the camera come after them."""
UNKNOWNS = POSE + len(CAMERA_UNKNOWNS)
HEADING, TILT, ROLL, UNKNOWN_YAW, HEIGHT, FOCAL, CX, CY = range(2, UNKNOWNS)
MOVING = 7
"""So many of the first unknowns move the lines before the camera."""
TINY = 1e-12
STILL = np.array([1e-5, 1e-5, 1e-6, 1e-6, 1e-6, 1e-6, 1e-5, 1e-6, 1e-3, 1e-3])
"""A state that changes by less than this stands still, in the unknowns' units."""
FREE = np.array([i for i in range(UNKNOWNS) if i != POSE + YAW])


@dataclass(frozen=True, slots=True, eq=False)
class CameraEstimate:
    """A pose, and the camera with which it was found.

    Attributes:
        world_from_robot: the pose.
        pose_covariance: (3, 3) over (x, y, heading), the camera's uncertainty included.
        pose_slopes: (3, 7) by how much the pose moves with the camera's unknowns, as the lines hold.
        step: (7,) from the prior's camera to this one, :data:`CAMERA_UNKNOWNS`.
        covariance: (7, 7) of it.
        inliers: (n,) which lines agree.
        cost: truncated squared residuals over their variance, with the priors' shares.
        prior_chi2: squared distance of the step from the prior.
        log_likelihood: marginal, up to what all estimates from the same lines share.
    """

    world_from_robot: Pose2
    pose_covariance: Floats
    pose_slopes: Floats
    step: Floats
    covariance: Floats
    inliers: Mask
    cost: float
    prior_chi2: float
    log_likelihood: float


def estimate_camera_and_pose(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    mount: CameraMount,
    prior: Pose2,
    prior_covariance: Any,
    camera_covariance: Any,
    *,
    starts: tuple[Pose2, ...] = (),
    sigma_px: float = 0.5,
    errors: LineErrors | None = None,
) -> CameraEstimate:
    """Estimate the pose of a robot on the floor together with its camera's state.

    From the prior, and from other starts, Gauss-Newton on Geman and McClure's loss with a narrowing width; then least
    squares on the lines within ``outlier_sigmas``.

    Args:
        model_lines_world: (n, 2, 3) [m]. segments_px: (n, 2, 2), rectified. camera: without distortion.
        prior, prior_covariance: ``world_from_robot`` and (3, 3) of (x, y, heading).
        camera_covariance: (7, 7) over :data:`CAMERA_UNKNOWNS`; its yaw is left as it is.
        sigma_px: of the segment ends across the line.
        errors: of the model's lines, one row a pair. ``None``: they are where the model says.

    Raises:
        ValueError: a wrong shape.
    """
    model, segments = check_matched_arrays(model_lines_world, segments_px)
    covariance = np.asarray(camera_covariance, float)
    if covariance.shape != (len(CAMERA_UNKNOWNS),) * 2:
        raise ValueError(f"expected a camera_covariance of shape (7, 7), got {covariance.shape}")
    shifts = np.zeros((0, len(model), 3)) if errors is None else errors.displacements
    shifts = shifts[np.any(shifts != 0.0, axis=(1, 2))]
    information = np.eye(UNKNOWNS + len(shifts))
    information[:UNKNOWNS, :UNKNOWNS] = build_information(prior_covariance, covariance)
    problem = _Problem(model, segments, camera, mount, sigma_px, information, prior, shifts)
    bound = 2.0 * OUTLIER_SIGMAS**2
    ends = [problem.anneal(problem.start_at(start)) for start in (prior, *starts)]
    state = min(ends, key=lambda end: problem.compute_cost(end, bound))
    for _ in range(MAX_ROUNDS):
        near = problem.find_near(state, bound)
        before, state = state, problem.minimise(state, near.astype(float))
        if problem.stands(state - before) and np.array_equal(near, problem.find_near(state, bound)):
            break
    return _build_estimate(problem, state, covariance, bound)


@dataclass(frozen=True, eq=False)
class _Problem:
    """The data of one call. A state is (10 + k,): x [m], y [m], heading [rad], step of the camera's unknowns, modes.

    Attributes:
        shifts: (k, n, 3) by how much a standard deviation of each mode displaces each line [m, world].
    """

    model: Floats
    segments: Floats
    camera: Camera
    mount: CameraMount
    sigma_px: float
    information: Floats
    prior: Pose2
    shifts: Floats

    @cached_property
    def free(self) -> Floats:
        """The unknowns that are estimated."""
        return np.append(FREE, np.arange(UNKNOWNS, UNKNOWNS + len(self.shifts)))

    def start_at(self, pose: Pose2) -> Floats:
        """The state at a pose with the prior's camera, its heading near the prior's."""
        off = math.remainder(pose.heading_rad - self.prior.heading_rad, math.tau)
        return np.array([pose.x_m, pose.y_m, self.prior.heading_rad + off, *np.zeros(len(self.information) - POSE)])

    def stands(self, moved: Floats) -> bool:
        """Whether a state that moves by this stands still."""
        return bool(np.abs(moved[:UNKNOWNS] / STILL).max() < 1.0)

    def from_prior(self, state: Floats) -> Floats:
        """(10 + k,) the state less the prior's mean."""
        return state - self.start_at(self.prior)

    def measure(self, state: Floats) -> tuple[Floats, Floats]:
        """(n, 2) distances of the segments' ends from the projected infinite model lines, in deviations;
        and (n, 2, 10 + k) their derivatives, 0 by the yaw.
        """
        c, m, moved = self.camera, self.mount, self.model
        if len(self.shifts):
            moved = moved + np.tensordot(state[UNKNOWNS:], self.shifts, axes=1)[:, None]
        distances, slopes = measure_lines(
            moved, self.segments, np.array([c.fx, c.fy, c.cx, c.cy]),
            np.array([m.height_m, m.forward_m, m.tilt_rad, m.roll_rad, m.yaw_rad]), state[:UNKNOWNS])
        if len(self.shifts):  # lines go there, or the camera goes back
            x, y, z = self.shifts.T[:, :, None]  # each (n, 1, k); written out, as einsum takes eight times as long
            by_modes = slopes[..., :1] * x + slopes[..., 1:2] * y + slopes[..., HEIGHT, None] * z
            slopes = np.concatenate([slopes, -by_modes], axis=2)
        return distances / self.sigma_px, slopes / self.sigma_px

    def measure_squares(self, state: Floats) -> Floats:
        """(n,) the squared distances of the lines, in variances."""
        return np.asarray(np.sum(self.measure(state)[0] ** 2, axis=1))

    def solve(self, state: Floats, measured: tuple[Floats, Floats], weights: Floats) -> Floats:
        """The state after one Gauss-Newton step with what it measures and these weights (n,) of the lines."""
        distances, slopes = measured
        weighted, free = slopes * weights[:, None, None], self.free
        hessian = np.tensordot(weighted, slopes, axes=((0, 1), (0, 1))) + self.information
        gradient = np.einsum("nea,ne->a", weighted, distances)
        gradient = gradient + self.information @ self.from_prior(state)
        moved = state.copy()
        moved[free] -= np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
        return moved

    def minimise(self, state: Floats, weights: Floats, iterations: int = 4) -> Floats:
        """The state of least squares with these weights."""
        for _ in range(iterations):
            before, state = state, self.solve(state, self.measure(state), weights)
            if self.stands(state - before):
                break
        return state

    def anneal(self, state: Floats) -> Floats:
        """The state under a robust loss whose width narrows."""
        for width in WIDTHS_PX:
            for _ in range(STEPS_A_WIDTH):
                measured = self.measure(state)
                squares = 0.5 * np.sum(measured[0] ** 2, axis=1) * (self.sigma_px / width) ** 2
                state = self.solve(state, measured, 1.0 / (1.0 + squares) ** 2 * (self.sigma_px / width) ** 2 * 4.0)
        return state

    def find_near(self, state: Floats, bound: float) -> Mask:
        """(n,) the lines within the bound."""
        return np.asarray(self.measure_squares(state) <= bound)

    def compute_cost(self, state: Floats, bound: float) -> float:
        """The truncated squared errors of the lines, and the priors' shares."""
        off = self.from_prior(state)
        return float(np.minimum(self.measure_squares(state), bound).sum() + off @ self.information @ off)


def compute_pose_slopes(lines_world: Floats, camera: Camera, mount: CameraMount, pose: Pose2) -> Floats:
    """(3, 7) by how much a pose moves with the camera's unknowns, if lines (n, 2, 3) stay where they are seen."""
    seen, _ = camera.project_segments(lines_world, mount.camera_from_robot @ pose.lifted().inverse())
    shown = np.isfinite(seen).all(axis=(1, 2))
    problem = _Problem(lines_world[shown], seen[shown], camera, mount, 1.0, np.eye(UNKNOWNS), pose,
                       np.zeros((0, int(shown.sum()), 3)))
    slopes = problem.measure(problem.start_at(pose))[1].reshape(-1, UNKNOWNS)
    return np.asarray(np.linalg.lstsq(slopes[:, :POSE], -slopes[:, POSE:])[0])


def build_information(pose_covariance: Any, camera_covariance: Floats) -> Floats:
    """(10, 10) of both priors, 0 for the yaw, which is not estimated."""
    information = np.zeros((UNKNOWNS, UNKNOWNS))
    information[:POSE, :POSE] = np.linalg.inv(np.asarray(pose_covariance, float))
    camera = FREE[POSE:]
    information[np.ix_(camera, camera)] = np.linalg.inv(camera_covariance[np.ix_(camera - POSE, camera - POSE)])
    return information


def _build_estimate(
    problem: _Problem, state: Floats, camera_covariance: Floats, bound: float
) -> CameraEstimate:
    near = problem.find_near(state, bound)
    distances, slopes = (measured[near] for measured in problem.measure(state))
    lines, free = np.tensordot(slopes, slopes, axes=((0, 1), (0, 1))), problem.free
    freedom = 2 * int(near.sum()) - len(FREE)
    scatter = max(1.0, float(np.sum(distances**2)) / freedom) if freedom >= MIN_FREEDOM else 1.0
    hessian, prior = (matrix[np.ix_(free, free)] for matrix in (lines / scatter + problem.information,
                                                                  problem.information))
    joint = np.asarray(np.linalg.inv(hessian)[:len(FREE), :len(FREE)], float)
    cost = problem.compute_cost(state, bound)
    covariance = np.array(camera_covariance)
    camera = FREE[POSE:] - POSE
    covariance[YAW, :] = covariance[:, YAW] = 0.0
    covariance[YAW, YAW] = camera_covariance[YAW, YAW]
    covariance[np.ix_(camera, camera)] = joint[POSE:, POSE:]
    pose_slopes = np.zeros((POSE, len(CAMERA_UNKNOWNS)))
    pose_slopes[:, camera] = joint[:POSE, POSE:] @ np.linalg.inv(joint[POSE:, POSE:])
    off = problem.from_prior(state)
    off[:POSE] = off[UNKNOWNS:] = 0.0
    return CameraEstimate(
        world_from_robot=to_pose2(state[:POSE]),
        pose_covariance=joint[:POSE, :POSE],
        pose_slopes=pose_slopes,
        step=state[POSE:UNKNOWNS],
        covariance=0.5 * (covariance + covariance.T),
        inliers=near,
        cost=cost,
        prior_chi2=float(off @ problem.information @ off),
        log_likelihood=0.5 * float(np.linalg.slogdet(prior)[1] - np.linalg.slogdet(hessian)[1] - cost),
    )


@compiled
def measure_lines(
    model: Floats, segments: Floats, lens: Floats, mount: Floats, state: Floats
) -> tuple[Floats, Floats]:  # pragma: no cover
    """Distances (n, 2) [px] of the segments' ends from the projected infinite model lines, and (n, 2, 10) derivatives.

    Those by the yaw are 0: it is not estimated.

    Args:
        model: (n, 2, 3) [m, world]. segments: (n, 2, 2) [px].
        lens: (4,) fx, fy, cx, cy. mount: (5,) height, forward [m], tilt, roll, yaw [rad]; both before the step.
        state: (10,).
    """
    distances, slopes = np.zeros((len(model), 2)), np.zeros((len(model), 2, UNKNOWNS))
    grown = 1.0 + state[FOCAL]
    fx, fy, cx, cy = lens[0] * grown, lens[1] * grown, lens[2] + state[CX], lens[3] + state[CY]
    ends, moved = np.zeros((2, 3)), np.zeros((2, MOVING, 3))
    for i in range(len(model)):
        for k in range(2):
            _place(model[i, k], mount, state, ends[k], moved[k])
        normal = _cross(ends[0], ends[1])
        a, b = normal[0] / fx, normal[1] / fy
        c = normal[2] - cx * a - cy * b
        reach = math.hypot(a, b) + TINY
        for k in range(2):
            distances[i, k] = (segments[i, k, 0] * a + segments[i, k, 1] * b + c) / reach
        for u in range(UNKNOWNS):
            if u == UNKNOWN_YAW:
                continue
            da, db, dc = 0.0, 0.0, 0.0
            if u < MOVING:
                one, other = _cross(moved[0, u], ends[1]), _cross(ends[0], moved[1, u])
                da, db = (one[0] + other[0]) / fx, (one[1] + other[1]) / fy
                dc = one[2] + other[2] - cx * da - cy * db
            elif u == FOCAL:
                da, db = -a / grown, -b / grown
                dc = -cx * da - cy * db
            else:
                dc = -a if u == CX else -b
            grows = (a * da + b * db) / reach
            for k in range(2):
                away = segments[i, k, 0] * da + segments[i, k, 1] * db + dc
                slopes[i, k, u] = (away - distances[i, k] * grows) / reach
    return distances, slopes


@compiled
def _place(point: Floats, mount: Floats, state: Floats, there: Floats, moved: Floats) -> None:  # pragma: no cover
    """Write a world point in the camera's frame, and its derivatives (7, 3) by what moves the camera."""
    c, s = math.cos(state[HEADING]), math.sin(state[HEADING])
    dx, dy = point[0] - state[0], point[1] - state[1]
    ahead, left = c * dx + s * dy, c * dy - s * dx
    turned = mount[2] + state[TILT], mount[3] + state[ROLL], mount[4] + state[UNKNOWN_YAW]
    x, y, z = _turn(ahead - mount[1], left, point[2] - mount[0] - state[HEIGHT], turned)
    there[0], there[1], there[2] = x, y, z
    moved[0, 0], moved[0, 1], moved[0, 2] = _turn(-c, s, 0.0, turned)
    moved[1, 0], moved[1, 1], moved[1, 2] = _turn(-s, -c, 0.0, turned)
    moved[HEADING, 0], moved[HEADING, 1], moved[HEADING, 2] = _turn(left, -ahead, 0.0, turned)
    moved[HEIGHT, 0], moved[HEIGHT, 1], moved[HEIGHT, 2] = _turn(0.0, 0.0, -1.0, turned)
    cr, sr = math.cos(turned[1]), math.sin(turned[1])
    down = sr * x + cr * y  # before the roll; the tilt turns it and the depth about the camera's right side
    moved[TILT, 0], moved[TILT, 1], moved[TILT, 2] = -sr * z, -cr * z, down
    moved[ROLL, 0], moved[ROLL, 1], moved[ROLL, 2] = y, -x, 0.0


@compiled
def _turn(
    ahead: float, left: float, up: float, turned: tuple[float, float, float]
) -> tuple[float, float, float]:  # pragma: no cover
    """A vector of the robot's frame in the camera's (right, down, forward), by tilt, roll and yaw [rad]."""
    ct, st = math.cos(turned[0]), math.sin(turned[0])
    cr, sr = math.cos(turned[1]), math.sin(turned[1])
    cy, sy = math.cos(turned[2]), math.sin(turned[2])
    front, side = cy * ahead + sy * left, cy * left - sy * ahead
    right, down = -side, -st * front - ct * up
    return cr * right + sr * down, cr * down - sr * right, ct * front - st * up


@compiled
def _cross(a: Floats, b: Floats) -> tuple[float, float, float]:  # pragma: no cover
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
