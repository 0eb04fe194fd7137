"""Med R and T: least median of squares over 3-line or 3-landmark subsets (§6.2.4)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from knowledge_sources.methods.pose.estimate import Array, Mask, PoseEstimate
from knowledge_sources.methods.pose.line_set import LandmarkIds, LineSet, build_line_set, landmark_groups
from knowledge_sources.methods.pose.numerics.finish import NO_SUBSET, estimate_at, guarded, prior_estimate, reasons
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import invert_information
from knowledge_sources.methods.pose.numerics.subset_poses import compute_squared_distances, concentrated, subset_poses
from knowledge_sources.methods.pose.numerics.subsets import count_subsets, list_subsets, padded_rows
from knowledge_sources.methods.pose.r_and_t import PoseState
from knowledge_sources.methods.pose.r_and_t_ml import likeliest, r_and_t_ml
from world_models.camera import Camera
from world_models.frames import Pose

MEDIAN_CHI2_2 = 1.386
"""Median of the chi-squared law with two degrees of freedom: a line has two residuals."""
MOST_WRONG = 0.45
"""Share of wrong lines up to which the median is to hold."""
TIE = -2.0 * math.log(1.0 - 0.5 / (1.0 - MOST_WRONG))
"""Medians up to this are no evidence either way: where so many lines are wrong, the median of all is a high quantile of
the right ones' chi-squared law (1 - exp(-x / 2))."""
SUBSET = 3
CONCENTRATED = 16
"""So many of the best candidates are solved again on the lines that fit them best."""
ROUNDS = 6
"""So often, at most, lines are taken out or back and the pose is solved for again."""
LEAST_SCALE = 0.3
"""Lines that agree better than this share of ``sigma_px`` do not make others outliers."""


def med_r_and_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    probability: float | None = None,
    outliers: float = 0.5,
    rng: np.random.Generator | None = None,
    cutoff: float = 3.0,
) -> PoseEstimate:
    """The pose of the subset with the least median squared error, then the rest without the outliers.

    Source: §6.2.4, E_m, steps 1-4. Each subset is solved by R and T; the errors whose median is taken are measured
    in the image, in units of ``sigma_px``, where they are alike for near and far lines. Medians that this noise cannot
    tell apart are ties, and step 3's threshold decides between them: the pose under which more lines stay. Holds to
    about 45 % outliers.

    Args:
        landmark_ids: n hashable names: the landmark version (3-landmark subsets). ``None``: the line version.
        probability: ``None`` tries every subset; else so many are drawn (with ``rng``) that one is free of outliers
            with this probability when the share ``outliers`` of the groups is wrong.
        cutoff: lines beyond this many standard deviations, estimated from the median, are outliers.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    candidates = subset_candidates(lines, prior, landmark_ids, probability, outliers, rng)
    if candidates is None:
        return r_and_t_ml(model_lines_world, segments_px, camera, prior, sigma_px=sigma_px)
    turns, shifts = with_concentrated(lines, *candidates)
    errors = compute_squared_distances(lines, turns, shifts)
    medians = np.median(errors, axis=1)
    least = float(medians.min())
    bound = 2.0 * (cutoff * _robust_scale(least, len(lines))) ** 2
    tied = np.flatnonzero(medians <= max(least, TIE))
    best = int(tied[np.argmin(np.minimum(errors[tied], bound).sum(axis=1))])
    return refined_on(lines, prior, (turns[best], shifts[best]), errors[best] <= bound, bound)


def with_concentrated(lines: LineSet, turns: Array, shifts: Array) -> tuple[Array, Array]:
    """The candidates and, besides, those of least median solved again on the better half of all lines."""
    medians = np.median(compute_squared_distances(lines, turns, shifts), axis=1)
    few = np.argsort(medians, kind="stable")[:CONCENTRATED]
    more = concentrated(lines, turns[few], shifts[few], (len(lines) + SUBSET) // 2)
    return np.concatenate([turns, more[0]]), np.concatenate([shifts, more[1]])


def subset_candidates(
    lines: LineSet,
    prior: Pose,
    landmark_ids: LandmarkIds,
    probability: float | None,
    outliers: float,
    rng: np.random.Generator | None,
) -> tuple[Array, Array] | None:
    """Poses (k, 3, 3), (k, 3) of the 3-group subsets, or ``None`` if there are fewer than 4 lines or 3 groups."""
    groups = landmark_groups(landmark_ids, len(lines))
    if len(groups) < SUBSET:
        groups = landmark_groups(None, len(lines))
    if len(lines) <= SUBSET:
        return None
    needed = None if probability is None else count_subsets(SUBSET, outliers, probability)
    rows, real = padded_rows(groups, list_subsets(len(groups), SUBSET, needed, rng))
    return subset_poses(lines, rows, real, prior)


def refined_on(lines: LineSet, prior: Pose, start: PoseState, near: Mask, bound: float) -> PoseEstimate:
    """R and T, with the likelihood's finish, on the lines kept; reasons for the others (§6.2.4, steps 3 and 4).

    Both steps again while the pose so found keeps other lines: what a subset's noise had put too far may come back.
    """
    near = near & (lines.lengths_px > 1e-9)
    if int(np.count_nonzero(near)) < SUBSET:
        return prior_estimate(lines, prior, NO_SUBSET)
    for _ in range(ROUNDS):
        end, reason = likeliest(lines.take(near), prior, start=start)
        start = rotation, translation = end.state
        fine = compute_squared_distances(lines, rotation, translation) <= bound
        rejected = reasons(lines, rotation, translation, fine)
        again = np.array([r is None for r in rejected], bool)
        if np.array_equal(again, near) or int(np.count_nonzero(again)) < SUBSET:
            break
        near = again
    covariance = invert_information(end.normal.hessian)
    estimate = estimate_at(
        lines, rotation, translation, covariance, rejected, end.normal.cost, end.iterations, reason
    )
    return guarded(lines, prior, estimate, near)


def _robust_scale(median_squared: float, n: int) -> float:
    """Standard deviation of one residual from the median over n lines, with the small-sample factor."""
    scale = (1.0 + 5.0 / max(n - SUBSET, 1)) * float(np.sqrt(median_squared / MEDIAN_CHI2_2))
    return max(scale, LEAST_SCALE)
