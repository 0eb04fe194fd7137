"""Robust poses from subsets of 3 lines or landmarks: least median of squares (§6.2.4)."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.pose import kernels
from knowledge_sources.methods.pose.estimate import (
    MIN_LENGTH_PX,
    NO_SUBSET,
    PoseEstimate,
    build_estimate,
    build_prior_estimate,
    find_rejections,
)
from knowledge_sources.methods.pose.kernels import RigidMotion
from knowledge_sources.methods.pose.line_set import (
    LandmarkIds,
    LineSet,
    build_line_set,
    compute_image_jacobian,
    compute_squared_distances,
    group_by_landmark,
    invert_information,
)
from knowledge_sources.methods.pose.r_and_t import (
    compute_likeliest_covariance,
    find_likeliest,
    invert_covariance,
    r_and_t_ml,
)
from knowledge_sources.settings import DEFAULT, PoseSettings
from world_models.camera import Camera
from world_models.frames import Pose

SUBSET_ITERATIONS = 4  # gauss-Newton steps on a subset (§6.2.4)
# how often the best candidates are solved again on the lines that fit them best (Rousseeuw's concentration steps)
CONCENTRATION_ROUNDS = 3
CONCENTRATION_ITERATIONS = 2  # gauss-Newton steps in each of these rounds
MAX_REFINEMENTS = 6  # rounds in which inliers and pose may still change each other (§6.2.4, steps 3 and 4)
MAX_OUTLIER_PART = 0.45  # share of wrong lines up to which the median is to hold (§6.2.4, Table 3)
MED_DRAWN_OUTLIER_PART = 0.5  # share of wrong lines for which enough subsets are drawn (§6.2.4)
MED_CANDIDATES = 16  # candidates of least median that are solved again
MIN_NOISE_PART = 0.3  # smallest estimate of the noise, in parts of the stated one

MEDIAN_CHI2_2 = 1.386
"""Median of the chi-squared law with two degrees of freedom: a line has two residuals."""
MAX_CHI2_6 = 27.86
"""Of the chi-squared law with six degrees of freedom, 99.99 % is below."""
SUBSET_SIZE = 3
"""Lines or landmarks in a subset: three lines decide six unknowns."""


def med_r_and_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    probability: float | None = None,
    rng: np.random.Generator | None = None,
    prior_covariance: Any = None,
    settings: PoseSettings = DEFAULT.pose,
) -> PoseEstimate:
    """Camera pose by least median of squares: holds up to about 45 % of wrong lines.

    Source: §6.2.4, E_m, steps 1 to 4. R and T solves each subset. The errors whose median is taken are measured in the
    image, over ``sigma_px``, where they are alike for near and far lines. Medians that this noise cannot tell apart are
    ties, and the threshold of step 3 decides between them: the pose under which more lines stay.

    Args:
        model_lines_world: (n, 2, 3) [m]. segments_px: (n, 2, 2) observed, as the lens shows them.
        prior: guess of ``camera_from_world``; every subset starts from it.
        landmark_ids: n hashable names: 3-landmark subsets. ``None``: 3-line subsets.
        sigma_px: standard deviation of the segment ends across the line, one number or (n,).
        probability: ``None`` tries every subset; else so many are drawn (with ``rng``) that one is free of outliers
            with this probability.
        prior_covariance: (6, 6) of the prior's left perturbation: the prior is one more measurement, and candidates
            that it excludes are not looked at. ``None``: see :func:`r_and_t_ml`.

    Raises:
        ValueError: as :func:`build_line_set`; ids that are not one a line; subsets must be drawn without ``rng``; a
            covariance of another shape.
    """
    def choose(lines: LineSet, rotations: Floats, translations: Floats) -> tuple[RigidMotion, Mask, float]:
        def rank(errors: Floats) -> Floats:
            return np.median(errors, axis=1)

        half = (len(lines) + SUBSET_SIZE) // 2
        rotations, translations = add_concentrated(lines, rotations, translations, rank, MED_CANDIDATES, half)
        rotations, translations = keep_possible(lines, prior, prior_covariance, rotations, translations)
        errors = compute_squared_distances(lines, rotations, translations)
        medians = rank(errors)
        least = float(medians.min())
        bound = 2.0 * (settings.outlier_sigmas * _compute_robust_scale(least, len(lines))) ** 2
        tied = np.flatnonzero(medians <= max(least, _compute_tied_median()))
        best = int(tied[np.argmin(np.minimum(errors[tied], bound).sum(axis=1))])
        return (rotations[best], translations[best]), errors[best] <= bound, bound

    return solve_from_subsets(model_lines_world, segments_px, camera, prior, landmark_ids, sigma_px, probability,
                              MED_DRAWN_OUTLIER_PART, rng, prior_covariance, settings, choose)


Choose = Callable[[LineSet, Floats, Floats], tuple[RigidMotion, Mask, float]]


def solve_from_subsets(
    model_lines_world: Any, segments_px: Any, camera: Camera, prior: Pose, landmark_ids: LandmarkIds, sigma_px: Any,
    probability: float | None, outlier_part: float, rng: np.random.Generator | None, prior_covariance: Any,
    settings: PoseSettings, choose: Choose,
) -> PoseEstimate:
    """The likeliest pose from the candidate that ``choose`` takes; of all lines, where they are 3 or fewer.

    Args:
        choose: from the lines and the poses (k, 3, 3), (k, 3) of the subsets: a pose, the lines (n,) near it, and the
            bound on their squared distances over their variance.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    groups = group_by_landmark(landmark_ids, len(lines))
    if len(groups) < SUBSET_SIZE:
        groups = group_by_landmark(None, len(lines))
    if len(lines) <= SUBSET_SIZE:
        return r_and_t_ml(
            model_lines_world, segments_px, camera, prior, sigma_px=sigma_px, prior_covariance=prior_covariance,
            settings=settings,
        )
    needed = None if probability is None else count_subsets(SUBSET_SIZE, outlier_part, probability)
    rows, real = _pad_rows(groups, list_subsets(len(groups), SUBSET_SIZE, needed, rng))
    starts = np.tile(prior.rotation, (len(rows), 1, 1)), np.tile(prior.translation, (len(rows), 1))
    candidates = kernels.solve_subsets(lines.arrays, rows, real, *starts, SUBSET_ITERATIONS)
    return _refine_on_inliers(lines, prior, prior_covariance, landmark_ids, *choose(lines, *candidates), settings)


def keep_possible(
    lines: LineSet, prior: Pose, prior_covariance: Any, rotations: Floats, translations: Floats
) -> tuple[Floats, Floats]:
    """The candidates (k, 3, 3), (k, 3) that the prior does not exclude, and the prior itself; all if it is unknown.

    A candidate has the noise of its subset: about that of all lines, over the subset's share of them.
    """
    if prior_covariance is None:
        return rotations, translations
    rotations = np.concatenate([rotations, prior.rotation[None]])
    translations = np.concatenate([translations, prior.translation[None]])
    slopes = compute_image_jacobian(lines, prior.rotation, prior.translation)[1] / lines.sigma_px[:, None, None]
    slopes = slopes.reshape(-1, 6) * np.sqrt(SUBSET_SIZE / len(lines))
    spread = np.asarray(prior_covariance, float) + invert_information(slopes.T @ slopes)
    turns = rotations @ prior.rotation.T
    moves = np.concatenate([kernels.find_rotation_vectors(turns), translations - turns @ prior.translation], axis=1)
    squares = np.sum(moves * np.linalg.solve(spread, moves.T).T, axis=1)
    possible = squares <= MAX_CHI2_6
    return rotations[possible], translations[possible]


def _find_doubtful(landmark_ids: LandmarkIds, kept: Mask) -> Mask:
    """(n,) the kept lines of landmarks of which no more are kept than left out.

    A landmark is matched wrongly as a whole: a line of it may be near its model line by chance.
    """
    out = np.zeros(len(kept), bool)
    for rows in group_by_landmark(landmark_ids, len(kept)):
        out[rows] = kept[rows] & (2 * np.count_nonzero(kept[rows]) <= len(rows))
    return out


def _refine_on_inliers(
    lines: LineSet, prior: Pose, prior_covariance: Any, landmark_ids: LandmarkIds, start: RigidMotion, near: Mask,
    bound: float, settings: PoseSettings,
) -> PoseEstimate:
    """The likeliest pose of the lines kept, with reasons for the others (§6.2.4, steps 3 and 4).

    Repeated while the new pose keeps other lines: a line that a subset's noise had put too far may come back.

    Args:
        near: (n,) the lines kept at ``start``. bound: of a line's squared distance over its variance.
    """
    information, known = invert_covariance(prior_covariance)
    near = near & (lines.lengths_px > MIN_LENGTH_PX)
    if int(np.count_nonzero(near)) < SUBSET_SIZE:
        return build_prior_estimate(lines, prior, NO_SUBSET, settings, known)
    for _ in range(MAX_REFINEMENTS):
        end, reason = find_likeliest(lines.take(near), prior, information, settings, start)
        start = end.state
        fine = compute_squared_distances(lines, *start) <= bound
        rejected = find_rejections(lines, start, fine, settings)
        again = np.array([r is None for r in rejected], bool)
        if np.array_equal(again, near) or int(np.count_nonzero(again)) < SUBSET_SIZE:
            break
        near = again
    doubtful = _find_doubtful(landmark_ids, near)
    covariance = compute_likeliest_covariance(lines, end, near.astype(float), rejected, settings, bound, doubtful)
    return build_estimate(lines, end, covariance, rejected, settings, prior, known, reason, bound, near)


def add_concentrated(
    lines: LineSet, rotations: Floats, translations: Floats, rank: Callable[[Floats], Floats], count: int, keep: int
) -> tuple[Floats, Floats]:
    """The candidates, and the best ``count`` solved again, round by round, on the ``keep`` lines that fit each best.

    Rousseeuw's concentration steps: a minimal subset amplifies the noise; half of all lines do not.

    Args:
        rank: of squared distances (k, n) over their variance, (k,), less is better.
    """
    errors = compute_squared_distances(lines, rotations, translations)
    best = np.argsort(rank(errors), kind="stable")[:count]
    more = rotations[best], translations[best]
    for _ in range(CONCENTRATION_ROUNDS):
        rows = np.argsort(compute_squared_distances(lines, *more), axis=1, kind="stable")[:, :keep]
        more = kernels.solve_subsets(
            lines.arrays, np.ascontiguousarray(rows), np.ones(rows.shape), *more, CONCENTRATION_ITERATIONS
        )
    return np.concatenate([rotations, more[0]]), np.concatenate([translations, more[1]])


def _compute_tied_median() -> float:
    """Medians of squared errors up to this are ties: with the most wrong lines, noise alone gives as much.

    The median of all lines is then the quantile 0.5 / (1 - outliers) of the right ones' chi-squared law with two
    degrees of freedom, 1 - exp(-x / 2).
    """
    return -2.0 * math.log(1.0 - 0.5 / (1.0 - MAX_OUTLIER_PART))


def _compute_robust_scale(median_squared: float, n: int) -> float:
    """Standard deviation of one residual from the median over n lines, with Rousseeuw's small-sample factor."""
    scale = (1.0 + 5.0 / max(n - SUBSET_SIZE, 1)) * float(np.sqrt(median_squared / MEDIAN_CHI2_2))
    return max(scale, MIN_NOISE_PART)


def count_subsets(size: int, outliers: float, probability: float) -> int:
    """Random subsets to draw so that one is free of outliers with the stated probability (RANSAC's count).

    Raises:
        ValueError: ``outliers`` is not in [0, 1), or ``probability`` not in (0, 1).
    """
    if not (0.0 <= outliers < 1.0 and 0.0 < probability < 1.0):
        raise ValueError(f"expected outliers in [0, 1) and probability in (0, 1), got {outliers} and {probability}")
    clean = (1.0 - outliers) ** size
    return 1 if clean >= 1.0 else max(1, math.ceil(math.log1p(-probability) / math.log1p(-clean)))


def list_subsets(
    count: int, size: int, needed: int | None = None, rng: np.random.Generator | None = None
) -> Indices:
    """Subsets (k, size) of ``count`` groups: all of them, or ``needed`` different ones drawn with ``rng``.

    Raises:
        ValueError: subsets must be drawn and there is no ``rng``.
    """
    total = math.comb(count, size)
    if needed is None or needed >= total:
        return np.array(list(combinations(range(count), size)), dtype=np.intp).reshape(-1, size)
    if rng is None:
        raise ValueError(f"expected an rng to draw {needed} of {total} subsets, got None")
    keys = rng.random((needed, count))
    drawn = np.sort(np.argpartition(keys, size - 1, axis=1)[:, :size], axis=1)
    return np.unique(drawn, axis=0).astype(np.intp)


def _pad_rows(groups: list[Indices], subsets: Indices) -> tuple[Indices, Floats]:
    """Line indices (k, w) of each subset of groups, padded with 0, and weights (k, w) that are 0 on the padding."""
    width = max((len(g) for g in groups), default=0)
    table = np.zeros((len(groups), width), dtype=np.intp)
    real = np.zeros((len(groups), width))
    for i, rows in enumerate(groups):
        table[i, : len(rows)] = rows
        real[i, : len(rows)] = 1.0
    return table[subsets].reshape(len(subsets), -1), real[subsets].reshape(len(subsets), -1)
