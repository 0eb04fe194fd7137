"""Where is the robot on the floor, from matched lines, some of them wrong?"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from knowledge_sources.methods.pose.estimate import BEHIND, Array, Mask, PlanarEstimate
from knowledge_sources.methods.pose.line_set import LandmarkIds, LineSet, build_line_set, landmark_groups
from knowledge_sources.methods.pose.numerics import line_kernels as kernels
from knowledge_sources.methods.pose.numerics.cautious_update import least_move, most_unexplained
from knowledge_sources.methods.pose.numerics.finish import reasons
from knowledge_sources.methods.pose.numerics.image_error import aspects
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import Descent, Normal, invert_information
from knowledge_sources.methods.pose.planar import (
    FEW,
    NOT_BETTER,
    PlanarPrior,
    build_planar_prior,
    compute_camera_poses,
    mounted,
    pose2,
)
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

SUBSET_LINES = 28
"""Pairs are formed of so many of the longest segments (378 pairs)."""
LONGEST_STEP = np.array([2.0, 2.0, 0.5])
"""A pair that asks for more (m, m, rad) at once is nearly degenerate: it goes there by degrees or not at all."""
LONGEST_STEP.setflags(write=False)
FINALISTS = 8
WIDENING = (4.0, 2.0, 1.0, 1.0)
"""In the polish of the finalists, round by round, by how much the squared bound on inliers is wider."""
ROUNDS = 8
FEW_LINES = 3
"""So many leave their noise hardly any freedom to show itself: without a stated covariance they go warily."""


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
    cutoff: float = 3.0,
) -> PlanarEstimate:
    """The floor pose under which the observed segment ends are likeliest.

    Source: §6.2.4 with three unknowns: two lines are enough for a candidate, and a truncated loss with known sigma
    takes the median's place (it holds beyond 50 % outliers). Candidates from pairs of lines, the prior and all
    lines; the best are polished on their inliers.

    Args:
        model_lines_world: (n, 2, 3) [m]. segments_px: (n, 2, 2); several segments may share a model line.
        camera_from_robot: the mount. prior: ``world_from_robot``.
        prior_covariance: (3, 3) of (x, y, heading): the prior is one more measurement. ``None``: it only decides
            directions that the lines leave open; those, and three lines or
            fewer, move it as little as their noise allows.
        landmark_ids: n names; pairs within one landmark are not tried as candidates.
        sigma_px: of the segment ends across the line, one number or (n,).
        robust: False takes every line as right.
        cutoff: a line beyond this many standard deviations is an outlier.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    groups = landmark_groups(landmark_ids, len(lines))
    belief = build_planar_prior(prior, prior_covariance)
    bound = 2.0 * cutoff**2
    if not len(lines):
        return _estimate(lines, belief.mean, belief, camera_from_robot, (), bound, FEW)
    if not robust:
        end = _descend(lines, belief.mean, belief, camera_from_robot)
        everything = np.ones(len(lines), bool)
        return _settled(lines, everything, end.state, belief, camera_from_robot, np.inf)
    candidates = _candidates(lines, groups, belief, camera_from_robot)
    costs = _costs(lines, candidates, belief, camera_from_robot, bound)
    order = np.argsort(costs, kind="stable")[:FINALISTS]
    finalists = _polished(lines, candidates[order], belief, camera_from_robot, bound)
    best = int(np.argmin(_costs(lines, finalists, belief, camera_from_robot, bound)))
    state, near = _agreed(lines, finalists[best], belief, camera_from_robot, bound)
    return _settled(lines, near, state, belief, camera_from_robot, bound)


def _candidates(lines: LineSet, groups: list[Any], belief: PlanarPrior, mount: Pose) -> Array:
    """States (k, 3): the prior, all lines at once, and each pair of long lines of different landmarks."""
    group_of = np.empty(len(lines), dtype=np.intp)
    for g, rows in enumerate(groups):
        group_of[rows] = g
    longest = np.sort(np.argsort(-lines.lengths_px, kind="stable")[:SUBSET_LINES])
    pairs = np.array([p for p in combinations(longest, 2) if group_of[p[0]] != group_of[p[1]]], dtype=np.intp)
    whole = _descend(lines, belief.mean, belief, mount, iterations=8).state
    base = np.stack([belief.mean, whole])
    if not len(pairs):
        return base
    return np.concatenate([base, _pair_states(lines, pairs, belief, mount)])


def _pair_states(lines: LineSet, pairs: Any, belief: PlanarPrior, mount: Pose, iterations: int = 4) -> Array:
    """Gauss-Newton on each pair (k, 2) with the prior, all at once: (k, 3)."""
    states: Array = kernels.floor_pairs(
        lines.arrays, pairs, *belief.arrays, mounted(mount), np.array(LONGEST_STEP), iterations
    )
    return states


def _costs(lines: LineSet, states: Array, belief: PlanarPrior, mount: Pose, bound: float) -> Array:
    """(k,) truncated squared errors of all lines, plus the prior's share."""
    costs: Array = kernels.floor_costs(lines.arrays, np.array(states), *belief.arrays, mounted(mount), bound)
    return costs


def _polished(lines: LineSet, states: Array, belief: PlanarPrior, mount: Pose, bound: float) -> Array:
    """States (k, 3) moved by Gauss-Newton on each one's own inliers, all at once; the first rounds let more in."""
    moved: Array = kernels.floor_polished(
        lines.arrays, states, *belief.arrays, mounted(mount), np.array(LONGEST_STEP), bound, np.array(WIDENING)
    )
    return moved


def _agreed(lines: LineSet, state: Array, belief: PlanarPrior, mount: Pose, bound: float) -> tuple[Array, Mask]:
    """Alternate inliers and likelihood until they agree."""
    near = _near(lines, state, mount, bound)
    for _ in range(ROUNDS):
        state = _descend(lines.take(near), state, belief, mount).state
        again = _near(lines, state, mount, bound)
        if np.array_equal(again, near):
            break
        near = again
    return state, near


def _near(lines: LineSet, state: Array, mount: Pose, bound: float) -> Mask:
    rotation, translation = compute_camera_poses(state, mount)
    distances, front, over = aspects(lines, rotation, translation)
    squares = np.sum((distances / lines.sigma_px[:, None]) ** 2, axis=1)
    return np.asarray(front & over & (squares <= bound))


def _descend(
    lines: LineSet, state: Array, belief: PlanarPrior, mount: Pose, iterations: int = 20
) -> Descent[Array]:
    """Least squares on the lines given, with the prior."""
    at, hessian, cost, steps = kernels.floor_descend(
        lines.arrays, np.ones(len(lines)), np.array(state), *belief.arrays, mounted(mount), iterations
    )
    return Descent(at, Normal(cost, hessian, np.zeros(3)), steps)


def _settled(
    lines: LineSet, near: Mask, state: Array, belief: PlanarPrior, mount: Pose, bound: float
) -> PlanarEstimate:
    """Drop a weak prior where the lines know better, and check against the prior itself."""
    kept = lines.take(near)
    reason = None
    if not belief.given:
        alone = PlanarPrior(belief.mean, np.zeros((3, 3)), True)
        hessian = _descend(kept, state, alone, mount, iterations=0).normal.hessian
        reason = None if _decided(hessian, belief) else FEW
        if reason is None and len(kept) > FEW_LINES:
            state = _descend(kept, state, alone, mount).state
        else:
            state = _cautious(kept, belief, mount)
    rotation, translation = compute_camera_poses(state, mount)
    rejected = reasons(lines, rotation, translation, near)
    if np.isinf(bound):
        rejected = tuple(r if r == BEHIND else None for r in rejected)
    cost_bound = 1e12 if np.isinf(bound) else bound
    costs = _costs(lines, np.stack([state, belief.mean]), belief, mount, cost_bound)
    if costs[0] > costs[1] + 1.0:
        state, reason = belief.mean, NOT_BETTER
    return _estimate(lines, state, belief, mount, rejected, cost_bound, reason)


def _cautious(lines: LineSet, belief: PlanarPrior, mount: Pose) -> Array:
    """The state nearest to the prior that explains the lines, see :func:`least_move`."""

    def pulled(weight: float) -> Array:
        return _descend(lines, belief.mean, replace(belief, information=weight * belief.information), mount).state

    def unexplained(state: Array) -> float:
        return float(np.sum(kernels.floor_squares(lines.arrays, np.array(state), mounted(mount))))

    return least_move(belief.mean, pulled, unexplained, most_unexplained(2.0 * len(lines)))


def _decided(hessian: Array, belief: PlanarPrior) -> bool:
    """Whether in every direction the lines know more than the weak prior."""
    scale = 1.0 / np.sqrt(np.diag(belief.information))
    return bool(np.linalg.eigvalsh(hessian * scale[:, None] * scale)[0] >= 1.0)


def _estimate(
    lines: LineSet,
    state: Array,
    belief: PlanarPrior,
    mount: Pose,
    rejected: tuple[str | None, ...],
    bound: float,
    reason: str | None,
) -> PlanarEstimate:
    inliers = np.array([r is None for r in rejected], dtype=bool)
    kept = lines.take(inliers)
    normal = _descend(kept, state, belief, mount, iterations=0).normal
    weak = not belief.given and reason is None
    hessian = normal.hessian - belief.information if weak else normal.hessian
    distances = aspects(lines, *compute_camera_poses(state, mount))[0]
    return PlanarEstimate(
        world_from_robot=pose2(state),
        covariance=invert_information(hessian) * _excess(kept, distances[inliers]),
        inliers=inliers,
        residuals_px=distances,
        rejected=rejected,
        cost=float(_costs(lines, state[None], belief, mount, bound)[0]),
        reason=reason,
    )


def _excess(lines: LineSet, distances: Array) -> float:
    """By how much the inliers scatter more than sigma says (a variance ratio, never below 1)."""
    freedom = distances.size - 3
    if freedom < 6:
        return 1.0
    return max(1.0, float(np.sum((distances / lines.sigma_px[:, None]) ** 2)) / freedom)
