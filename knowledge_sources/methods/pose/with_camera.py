"""Robot pose on the floor and the camera's own state from matched lines: maximum a posteriori, the pose marginalised.

Source: §6.2 with the residual in the image; the camera's tilt, roll, height, focal length and principal point are
unknowns besides (x, y, heading), each with a prior. The camera's yaw on the robot is not: one picture cannot tell it
from the robot's heading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.camera_kernel import measure_lines
from knowledge_sources.methods.pose.line_set import check_matched_arrays
from knowledge_sources.methods.pose.planar import to_pose2
from world_models.camera import CAMERA_UNKNOWNS, YAW, Camera, CameraMount
from world_models.frames import Pose2

WIDTHS_PX = (24.0, 12.0, 6.0, 3.0, 1.5)  # widths of the loss by which pose and camera are refined
STEPS_A_WIDTH = 2  # steps of Gauss-Newton at each width
OUTLIER_SIGMAS = 3.0  # a line further off than this is an outlier
MAX_ROUNDS = 8  # most rounds of choosing the lines that agree
MIN_FREEDOM = 6  # fewest degrees of freedom by which the noise is judged
POSE = 3
"""Unknowns of the robot's pose; those of the camera come after them."""
UNKNOWNS = POSE + len(CAMERA_UNKNOWNS)
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
    """

    world_from_robot: Pose2
    pose_covariance: Floats
    pose_slopes: Floats
    step: Floats
    covariance: Floats
    inliers: Mask
    cost: float
    prior_chi2: float


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
) -> CameraEstimate:
    """Estimate the pose of a robot on the floor together with its camera's state.

    From the prior, and from other starts, Gauss-Newton on Geman and McClure's loss with a narrowing width; then least
    squares on the lines within ``outlier_sigmas``.

    Args:
        model_lines_world: (n, 2, 3) [m]. segments_px: (n, 2, 2), rectified. camera: without distortion.
        prior, prior_covariance: ``world_from_robot`` and (3, 3) of (x, y, heading).
        camera_covariance: (7, 7) over :data:`CAMERA_UNKNOWNS`; its yaw is left as it is.
        sigma_px: of the segment ends across the line.

    Raises:
        ValueError: a wrong shape.
    """
    model, segments = check_matched_arrays(model_lines_world, segments_px)
    covariance = np.asarray(camera_covariance, float)
    if covariance.shape != (len(CAMERA_UNKNOWNS),) * 2:
        raise ValueError(f"expected a camera_covariance of shape (7, 7), got {covariance.shape}")
    information = build_information(prior_covariance, covariance)
    problem = _Problem(model, segments, camera, mount, sigma_px, information, prior)
    bound = 2.0 * OUTLIER_SIGMAS**2
    ends = [problem.anneal(problem.start_at(start)) for start in (prior, *starts)]
    state = min(ends, key=lambda end: problem.compute_cost(end, bound))
    for _ in range(MAX_ROUNDS):
        near = problem.find_near(state, bound)
        before, state = state, problem.minimise(state, near.astype(float))
        if np.abs((state - before) / STILL).max() < 1.0 and np.array_equal(near, problem.find_near(state, bound)):
            break
    return _build_estimate(problem, state, covariance, bound)


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """The data of one call. A state is (10,): x [m], y [m], heading [rad], then the step of the camera's unknowns."""

    model: Floats
    segments: Floats
    camera: Camera
    mount: CameraMount
    sigma_px: float
    information: Floats
    prior: Pose2

    def start_at(self, pose: Pose2) -> Floats:
        """The state at a pose with the prior's camera, its heading near the prior's."""
        off = math.remainder(pose.heading_rad - self.prior.heading_rad, math.tau)
        return np.array([pose.x_m, pose.y_m, self.prior.heading_rad + off, *np.zeros(len(CAMERA_UNKNOWNS))])

    def from_prior(self, state: Floats) -> Floats:
        """(10,) the state less the prior's mean."""
        return state - self.start_at(self.prior)

    def measure(self, state: Floats) -> tuple[Floats, Floats]:
        """(n, 2) distances of the segments' ends from the projected infinite model lines, in deviations; and (n, 2, 10)
        their derivatives, 0 by the yaw.
        """
        c, m = self.camera, self.mount
        distances, slopes = measure_lines(
            self.model, self.segments, np.array([c.fx, c.fy, c.cx, c.cy]),
            np.array([m.height_m, m.forward_m, m.tilt_rad, m.roll_rad, m.yaw_rad]), state)
        return distances / self.sigma_px, slopes / self.sigma_px

    def measure_squares(self, state: Floats) -> Floats:
        """(n,) the squared distances of the lines, in variances."""
        return np.asarray(np.sum(self.measure(state)[0] ** 2, axis=1))

    def solve(self, state: Floats, weights: Floats) -> Floats:
        """The state after one Gauss-Newton step with these weights (n,) of the lines."""
        distances, slopes = self.measure(state)
        hessian = np.einsum("n,nea,neb->ab", weights, slopes, slopes) + self.information
        gradient = np.einsum("n,nea,ne->a", weights, slopes, distances) + self.information @ self.from_prior(state)
        moved = state.copy()
        moved[FREE] -= np.linalg.solve(hessian[np.ix_(FREE, FREE)], gradient[FREE])
        return moved

    def minimise(self, state: Floats, weights: Floats, iterations: int = 4) -> Floats:
        """The state of least squares with these weights."""
        for _ in range(iterations):
            before, state = state, self.solve(state, weights)
            if np.abs((state - before) / STILL).max() < 1.0:
                break
        return state

    def anneal(self, state: Floats) -> Floats:
        """The state under a robust loss whose width narrows."""
        for width in WIDTHS_PX:
            for _ in range(STEPS_A_WIDTH):
                squares = 0.5 * self.measure_squares(state) * (self.sigma_px / width) ** 2
                state = self.solve(state, 1.0 / (1.0 + squares) ** 2 * (self.sigma_px / width) ** 2 * 4.0)
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
    problem = _Problem(lines_world[shown], seen[shown], camera, mount, 1.0, np.eye(UNKNOWNS), pose)
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
    lines = np.einsum("nea,neb->ab", slopes, slopes)
    freedom = 2 * int(near.sum()) - len(FREE)
    scatter = max(1.0, float(np.sum(distances**2)) / freedom) if freedom >= MIN_FREEDOM else 1.0
    hessian = (lines / scatter + problem.information)[np.ix_(FREE, FREE)]
    joint = np.linalg.inv(hessian)
    covariance = np.array(camera_covariance)
    camera = FREE[POSE:] - POSE
    covariance[YAW, :] = covariance[:, YAW] = 0.0
    covariance[YAW, YAW] = camera_covariance[YAW, YAW]
    covariance[np.ix_(camera, camera)] = joint[POSE:, POSE:]
    pose_slopes = np.zeros((POSE, len(CAMERA_UNKNOWNS)))
    pose_slopes[:, camera] = -np.linalg.solve(hessian[:POSE, :POSE], hessian[:POSE, POSE:])
    off = problem.from_prior(state)
    off[:POSE] = 0.0
    return CameraEstimate(
        world_from_robot=to_pose2(state[:POSE]),
        pose_covariance=joint[:POSE, :POSE],
        pose_slopes=pose_slopes,
        step=state[POSE:],
        covariance=0.5 * (covariance + covariance.T),
        inliers=near,
        cost=problem.compute_cost(state, bound),
        prior_chi2=float(off @ problem.information @ off),
    )
