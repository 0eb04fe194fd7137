"""Robot pose on the floor from matched lines, some of them wrong: truncated loss over pairs of lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.pose import kernels
from knowledge_sources.methods.pose.estimate import (
    BEHIND,
    DISTANCE,
    PlanarEstimate,
    compute_max_chi2,
    find_rejections,
    knows_more,
    solve_near_prior,
)
from knowledge_sources.methods.pose.kernels import FloorArrays
from knowledge_sources.methods.pose.line_set import (
    MAX_BESIDE_PX,
    OUTLIER_SIGMAS,
    LandmarkIds,
    LineSet,
    build_line_set,
    group_by_landmark,
    invert_information,
    measure_lines,
)
from knowledge_sources.methods.pose.planar import (
    FEW,
    MAX_FEW_LINES,
    MAX_FLOOR_ITERATIONS,
    NOT_BETTER,
    PlanarPrior,
    build_planar_prior,
    compute_camera_poses,
    compute_scatter,
    compute_sigmas_px,
    maximise_marginal,
    to_pose2,
    to_rigid_motion,
)
from world_models.building.model_errors import LineErrors
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

FLOOR_WIDENINGS = (4.0, 2.0, 1.0, 1.0)  # factors on the squared bound on inliers in that refinement, round by round
FLOOR_START_ITERATIONS = 8  # levenberg-Marquardt steps on all lines, for a first candidate
FLOOR_SUBSET_LINES = 28  # pairs are formed of this many of the longest segments
FLOOR_PAIR_ITERATIONS = 4  # gauss-Newton steps on each pair
MAX_FLOOR_STEP_M = 2.0  # m; largest move in one Gauss-Newton step: beyond it a pair is nearly degenerate
MAX_FLOOR_STEP_RAD = 0.5  # rad; largest turn in one such step
FLOOR_FINALISTS = 8  # candidates that are refined before one is chosen
MAX_FLOOR_ROUNDS = 8  # rounds in which inliers and pose may still change each other

NO_BOUND = 1e12
"""Bound on squared distances where every line is taken as right; finite, as compiled costs are sums."""


def planar_from_lines(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    camera_from_robot: Pose,
    prior: Pose2,
    *,
    prior_covariance: Any = None,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    robust: bool = True,
    errors: LineErrors | None = None,
) -> PlanarEstimate:
    """Robot pose on the floor of maximum likelihood, robust beyond 50 % of wrong lines.

    Source: §6.2.4 with three unknowns: two lines are enough for a candidate, and a truncated loss with known sigma
    replaces the median. Candidates come from pairs of lines, from the prior and from all lines; the best are refined on
    their inliers.

    Args:
        model_lines_world: (n, 2, 3) [m]. segments_px: (n, 2, 2); several segments may share a model line.
        camera_from_robot: the mount. prior: ``world_from_robot``.
        prior_covariance: (3, 3) of (x, y, heading): the prior is one more measurement. ``None``: it only decides
            directions that the lines leave open; those, and three lines or fewer, move it as little as their noise
            allows.
        landmark_ids: n names; pairs within one landmark are not tried as candidates.
        sigma_px: of the segment ends across the line, one number or (n,).
        robust: False takes every line as right.
        errors: of the model's lines, one row a pair; they are integrated out (:mod:`.planar`), and
            ``sigma_px`` is one number. ``None``: the model is exact.

    Raises:
        ValueError: as :func:`build_line_set`; ids that are not one a line; a covariance of another shape.
    """
    if errors is not None and not errors.is_exact:
        return _solve_inexact(model_lines_world, segments_px, camera, camera_from_robot, prior, prior_covariance,
                              landmark_ids, float(sigma_px), robust, errors)
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    groups = group_by_landmark(landmark_ids, len(lines))
    floor = _Floor(lines, build_planar_prior(prior, prior_covariance), camera_from_robot)
    mean = floor.prior.mean
    bound = 2.0 * OUTLIER_SIGMAS**2
    if not len(lines):
        return _build_estimate(floor, mean, (), bound, FEW)
    if not robust:
        state, _ = floor.minimise(mean, MAX_FLOOR_ITERATIONS)
        return _finish(floor, np.ones(len(lines), bool), state, NO_BOUND)
    candidates = _compute_candidates(floor, groups)
    order = np.argsort(floor.compute_costs(candidates, bound), kind="stable")[: FLOOR_FINALISTS]
    finalists = kernels.refine_floor_states(
        floor.arrays, candidates[order], _max_step(), bound, np.array(FLOOR_WIDENINGS))
    best = int(np.argmin(floor.compute_costs(finalists, bound)))
    state, near = _alternate(floor, finalists[best], bound)
    return _finish(floor, near, state, bound)


def _solve_inexact(
    model_lines_world: Any, segments_px: Any, camera: Camera, camera_from_robot: Pose, prior: Pose2,
    prior_covariance: Any, landmark_ids: LandmarkIds, sigma_px: float, robust: bool, errors: LineErrors,
) -> PlanarEstimate:
    """From lines whose model is inexact: robustly with each line's own error first, then with those that they share."""
    wide_px = np.hypot(sigma_px, compute_sigmas_px(
        np.asarray(model_lines_world, float).reshape(-1, 2, 3), errors, camera, camera_from_robot, prior))
    first = planar_from_lines(
        model_lines_world, segments_px, camera, camera_from_robot, prior, prior_covariance=prior_covariance,
        landmark_ids=landmark_ids, sigma_px=wide_px, robust=robust)
    if first.reason is not None:
        return first
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    belief = build_planar_prior(prior, prior_covariance)
    if not belief.given:
        belief = belief._replace(information=np.zeros((3, 3)))
    found = maximise_marginal(
        lines, errors.displacements, sigma_px, camera_from_robot, belief, first.world_from_robot.vector,
        first.inliers)
    rejected = tuple(None if near else reason or DISTANCE
                     for near, reason in zip(found.near, first.rejected, strict=True))
    return PlanarEstimate(to_pose2(found.state), found.covariance, found.near, found.residuals_px, rejected, found.cost)


@dataclass(frozen=True, slots=True, eq=False)
class _Floor:
    """The data of one call: lines, prior and mount ``camera_from_robot``. A state is (x [m], y [m], heading [rad])."""

    lines: LineSet
    prior: PlanarPrior
    mount: Pose

    def take(self, near: Mask) -> _Floor:
        """With some of the lines only."""
        return replace(self, lines=self.lines.take(near))

    @property
    def arrays(self) -> FloorArrays:
        """As the compiled functions take them."""
        return self.lines.arrays, self.prior.mean, self.prior.information, to_rigid_motion(self.mount)

    def minimise(self, state: Floats, iterations: int) -> tuple[Floats, Floats]:
        """The state (3,) of least squares on all lines, with the prior, from ``state``; and the Hessian (3, 3)."""
        end, hessian, _, _ = kernels.minimise_floor_pose(
            self.arrays, np.ones(len(self.lines)), np.array(state), iterations
        )
        return end, hessian

    def compute_costs(self, states: Floats, bound: float) -> Floats:
        """(k,) truncated squared errors of all lines, plus the prior's share."""
        costs: Floats = kernels.compute_floor_costs(self.arrays, np.array(states), bound)
        return costs

    def measure_lines(self, state: Floats) -> tuple[Floats, Mask, Mask]:
        """See :func:`.line_set.measure_lines`."""
        rotation, translation = compute_camera_poses(state, self.mount)
        return measure_lines(self.lines, rotation, translation, MAX_BESIDE_PX)

    def find_near(self, state: Floats, bound: float) -> Mask:
        """(n,) the lines within the bound, in front of the camera and within the ends of their model line."""
        distances, front, overlap = self.measure_lines(state)
        squares = np.sum((distances / self.lines.sigma_px[:, None]) ** 2, axis=1)
        return np.asarray(front & overlap & (squares <= bound))


def _compute_candidates(floor: _Floor, groups: list[Indices]) -> Floats:
    """States (k, 3): the prior, all lines at once, and each pair of long lines of different landmarks."""
    lines = floor.lines
    group_of = np.empty(len(lines), dtype=np.intp)
    for g, rows in enumerate(groups):
        group_of[rows] = g
    longest = np.sort(np.argsort(-lines.lengths_px, kind="stable")[: FLOOR_SUBSET_LINES])
    pairs = np.array([p for p in combinations(longest, 2) if group_of[p[0]] != group_of[p[1]]], dtype=np.intp)
    whole, _ = floor.minimise(floor.prior.mean, FLOOR_START_ITERATIONS)
    base = np.stack([floor.prior.mean, whole])
    if not len(pairs):
        return base
    states = kernels.solve_floor_pairs(floor.arrays, pairs, _max_step(), FLOOR_PAIR_ITERATIONS)
    return np.concatenate([base, states])


def _max_step() -> Floats:
    return np.array([MAX_FLOOR_STEP_M, MAX_FLOOR_STEP_M, MAX_FLOOR_STEP_RAD])


def _alternate(floor: _Floor, state: Floats, bound: float) -> tuple[Floats, Mask]:
    """Alternate inliers and likelihood until they agree."""
    near = floor.find_near(state, bound)
    for _ in range(MAX_FLOOR_ROUNDS):
        state, _ = floor.take(near).minimise(state, MAX_FLOOR_ITERATIONS)
        again = floor.find_near(state, bound)
        if np.array_equal(again, near):
            break
        near = again
    return state, near


def _finish(floor: _Floor, near: Mask, state: Floats, bound: float) -> PlanarEstimate:
    """Drop a weak prior where the lines know better, and return the prior where no pose fits better."""
    kept = floor.take(near)
    mean = floor.prior.mean
    reason = None
    if not floor.prior.given:
        alone = replace(kept, prior=PlanarPrior(mean, np.zeros((3, 3)), True))
        _, hessian = alone.minimise(state, 0)
        reason = None if knows_more(hessian, floor.prior.information) else FEW
        if reason is None and len(kept.lines) > MAX_FEW_LINES:
            state, _ = alone.minimise(state, MAX_FLOOR_ITERATIONS)
        else:
            state = _solve_near_prior(kept)
    rejected = find_rejections(floor.lines, compute_camera_poses(state, floor.mount), near)
    if bound == NO_BOUND:
        rejected = tuple(r if r == BEHIND else None for r in rejected)
    costs = floor.compute_costs(np.stack([state, mean]), bound)
    if costs[0] > costs[1] + 1.0:
        state, reason = mean, NOT_BETTER
    return _build_estimate(floor, state, rejected, bound, reason)


def _solve_near_prior(floor: _Floor) -> Floats:
    """The state nearest to the prior that explains the lines, see :func:`solve_near_prior`."""
    prior = floor.prior

    def solve(weight: float) -> Floats:
        pulled = replace(floor, prior=prior._replace(information=weight * prior.information))
        return pulled.minimise(prior.mean, MAX_FLOOR_ITERATIONS)[0]

    def compute_chi2(state: Floats) -> float:
        return float(np.sum(kernels.compute_floor_squares(floor.arrays, np.array(state))))

    max_chi2 = compute_max_chi2(2.0 * len(floor.lines))
    return solve_near_prior(prior.mean, solve, compute_chi2, max_chi2)


def _build_estimate(
    floor: _Floor, state: Floats, rejected: tuple[str | None, ...], bound: float, reason: str | None
) -> PlanarEstimate:
    inliers = np.array([r is None for r in rejected], dtype=bool)
    kept = floor.take(inliers)
    _, hessian = kept.minimise(state, 0)
    if not floor.prior.given and reason is None:
        hessian = hessian - floor.prior.information
    distances = floor.measure_lines(state)[0]
    squares = float(np.sum((distances[inliers] / kept.lines.sigma_px[:, None]) ** 2))
    scatter = compute_scatter(squares, 2 * len(kept.lines), bound)
    return PlanarEstimate(
        world_from_robot=to_pose2(state),
        covariance=invert_information(hessian) * scatter,
        inliers=inliers,
        residuals_px=distances,
        rejected=rejected,
        cost=float(floor.compute_costs(state[None], bound)[0]),
        reason=reason,
    )
