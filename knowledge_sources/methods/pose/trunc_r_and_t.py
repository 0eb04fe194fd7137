"""A truncated loss with known sigma over the subsets of Med R and T: beyond 50 % outliers."""

from __future__ import annotations

from typing import Any

import numpy as np

from knowledge_sources.methods.pose.estimate import Array, Mask, PoseEstimate
from knowledge_sources.methods.pose.line_set import LandmarkIds, LineSet, build_line_set
from knowledge_sources.methods.pose.med_r_and_t import SUBSET, refined_on, subset_candidates
from knowledge_sources.methods.pose.numerics import line_kernels as kernels
from knowledge_sources.methods.pose.numerics.finish import WEAK_INFORMATION
from knowledge_sources.methods.pose.numerics.image_error import OVERLAP_SLACK_PX
from knowledge_sources.methods.pose.numerics.subset_poses import compute_squared_distances, concentrated
from knowledge_sources.methods.pose.r_and_t import PoseState
from knowledge_sources.methods.pose.r_and_t_ml import r_and_t_ml
from world_models.camera import Camera
from world_models.frames import Pose

FINALISTS = 5
"""So many of the best subsets are polished before the choice is made."""
ROUNDS = 6
CONCENTRATED = 24
SHARE = 0.35
"""Of the lines, so many are believed when the best candidates are solved again."""


def trunc_r_and_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    probability: float | None = None,
    outliers: float = 0.7,
    rng: np.random.Generator | None = None,
    cutoff: float = 3.0,
) -> PoseEstimate:
    """The pose with the least sum of squared errors, each line's at most ``2 cutoff^2``; needs a true ``sigma_px``.

    Candidates are those of :func:`med_r_and_t` (arguments as there); the best are polished on their own inliers,
    and a line that matches only beside its model line's ends, or behind the camera, counts as an outlier.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    candidates = subset_candidates(lines, prior, landmark_ids, probability, outliers, rng)
    if candidates is None:
        return r_and_t_ml(model_lines_world, segments_px, camera, prior, sigma_px=sigma_px)
    bound = 2.0 * cutoff**2
    turns, shifts = _with_concentrated(lines, *candidates, bound)
    order = np.argsort(_costs(lines, turns, shifts, bound), kind="stable")[:FINALISTS]
    polished = [_polished(lines, prior, (turns[i], shifts[i]), bound) for i in order]
    state, _ = min(polished, key=lambda found: found[1])
    return refined_on(lines, prior, state, _near(lines, state, bound), bound)


def _with_concentrated(lines: LineSet, turns: Array, shifts: Array, bound: float) -> tuple[Array, Array]:
    """The candidates and, besides, the best solved again on the few lines that fit them best."""
    few = np.argsort(_costs(lines, turns, shifts, bound), kind="stable")[:CONCENTRATED]
    more = concentrated(lines, turns[few], shifts[few], max(SUBSET + 1, int(len(lines) * SHARE)))
    return np.concatenate([turns, more[0]]), np.concatenate([shifts, more[1]])


def _costs(lines: LineSet, turns: Array, shifts: Array, bound: float) -> Array:
    return np.asarray(np.minimum(compute_squared_distances(lines, turns, shifts), bound).sum(axis=1))


def _polished(lines: LineSet, prior: Pose, state: PoseState, bound: float) -> tuple[PoseState, float]:
    """Alternate inliers and likelihood until they agree; the state and its truncated cost."""
    rotation, translation, cost = kernels.polished(
        lines.arrays, (np.array(state[0]), np.array(state[1])), (np.array(prior.rotation), np.array(prior.translation)),
        np.array(WEAK_INFORMATION), np.diag(WEAK_INFORMATION).copy(), bound, OVERLAP_SLACK_PX, SUBSET, ROUNDS,
    )
    return (rotation, translation), cost


def _near(lines: LineSet, state: PoseState, bound: float) -> Mask:
    costs = kernels.truncated(lines.arrays, np.array(state[0]), np.array(state[1]), bound, OVERLAP_SLACK_PX)
    return np.asarray(costs < bound)
