"""Robust poses from subsets of 3 lines or landmarks: least median of squares (§6.2.4), or a truncated loss."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.pose import kernels
from knowledge_sources.methods.pose.estimate import (
    MIN_LENGTH_PX,
    NO_SUBSET,
    PoseEstimate,
    build_estimate,
    build_prior_estimate,
    check_in_front,
    compute_weak_information,
    find_rejections,
)
from knowledge_sources.methods.pose.levenberg_marquardt import invert_information
from knowledge_sources.methods.pose.line_set import (
    LandmarkIds,
    LineSet,
    build_line_set,
    compute_image_jacobian,
    compute_squared_distances,
    group_by_landmark,
)
from knowledge_sources.methods.pose.r_and_t import MAX_ITERATIONS, NO_INFORMATION, PoseState
from knowledge_sources.methods.pose.r_and_t_ml import (
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
TRUNC_DRAWN_OUTLIER_PART = 0.7  # share of wrong lines for which enough subsets are drawn (experiment table3)
TRUNC_CANDIDATES = 24  # candidates of least loss that are solved again
TRUNC_INLIER_PART = 0.35  # share of the lines that they are solved again on
TRUNC_FINALISTS = 5  # candidates that are refined before one is chosen
TRUNC_ROUNDS = 6  # rounds of inliers and pose in that refinement

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
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    outlier_part = MED_DRAWN_OUTLIER_PART
    candidates = compute_candidates(lines, prior, landmark_ids, probability, outlier_part, rng)
    if candidates is None:
        return r_and_t_ml(
            model_lines_world, segments_px, camera, prior, sigma_px=sigma_px, prior_covariance=prior_covariance,
            settings=settings,
        )
    rotations, translations = _add_concentrated(lines, *candidates)
    rotations, translations = keep_possible(lines, prior, prior_covariance, rotations, translations)
    errors = compute_squared_distances(lines, rotations, translations)
    medians = np.median(errors, axis=1)
    least = float(medians.min())
    bound = 2.0 * (settings.outlier_sigmas * _compute_robust_scale(least, len(lines))) ** 2
    tied = np.flatnonzero(medians <= max(least, _compute_tied_median()))
    best = int(tied[np.argmin(np.minimum(errors[tied], bound).sum(axis=1))])
    start = rotations[best], translations[best]
    near = errors[best] <= bound
    return refine_on_inliers(lines, prior, prior_covariance, landmark_ids, start, near, bound, settings)


def compute_candidates(
    lines: LineSet,
    prior: Pose,
    landmark_ids: LandmarkIds,
    probability: float | None,
    outlier_part: float,
    rng: np.random.Generator | None,
) -> tuple[Floats, Floats] | None:
    """Poses (k, 3, 3), (k, 3) of the subsets, or ``None`` if there are fewer than 4 lines."""
    groups = group_by_landmark(landmark_ids, len(lines))
    if len(groups) < SUBSET_SIZE:
        groups = group_by_landmark(None, len(lines))
    if len(lines) <= SUBSET_SIZE:
        return None
    needed = None if probability is None else count_subsets(SUBSET_SIZE, outlier_part, probability)
    rows, real = pad_rows(groups, list_subsets(len(groups), SUBSET_SIZE, needed, rng))
    return solve_subsets(lines, rows, real, prior)


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
    moves = np.concatenate([Rotation.from_matrix(turns).as_rotvec(), translations - turns @ prior.translation], axis=1)
    squares = np.sum(moves * np.linalg.solve(spread, moves.T).T, axis=1)
    possible = squares <= MAX_CHI2_6
    return rotations[possible], translations[possible]


def find_doubtful(landmark_ids: LandmarkIds, kept: Mask) -> Mask:
    """(n,) the kept lines of landmarks of which no more are kept than left out.

    A landmark is matched wrongly as a whole: a line of it may be near its model line by chance.
    """
    out = np.zeros(len(kept), bool)
    for rows in group_by_landmark(landmark_ids, len(kept)):
        out[rows] = kept[rows] & (2 * np.count_nonzero(kept[rows]) <= len(rows))
    return out


def refine_on_inliers(
    lines: LineSet, prior: Pose, prior_covariance: Any, landmark_ids: LandmarkIds, start: PoseState, near: Mask,
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
    for _ in range(max(MAX_REFINEMENTS, 1)):
        end, reason = find_likeliest(lines.take(near), prior, information, settings, start)
        start = rotation, translation = end.state
        fine = compute_squared_distances(lines, rotation, translation) <= bound
        rejected = find_rejections(lines, rotation, translation, fine, settings)
        again = np.array([r is None for r in rejected], bool)
        if np.array_equal(again, near) or int(np.count_nonzero(again)) < SUBSET_SIZE:
            break
        near = again
    doubtful = find_doubtful(landmark_ids, near)
    covariance = compute_likeliest_covariance(lines, end, near.astype(float), rejected, settings, bound, doubtful)
    estimate = build_estimate(
        lines, rotation, translation, covariance, rejected, end.normal.cost, end.iterations, reason, settings,
        bound
    )
    return check_in_front(lines, prior, estimate, settings, near, known)


def _add_concentrated(
    lines: LineSet, rotations: Floats, translations: Floats
) -> tuple[Floats, Floats]:
    """The candidates, and those of least median solved again on the better half of all lines."""
    medians = np.median(compute_squared_distances(lines, rotations, translations), axis=1)
    few = np.argsort(medians, kind="stable")[: MED_CANDIDATES]
    half = (len(lines) + SUBSET_SIZE) // 2
    more = concentrate(lines, rotations[few], translations[few], half)
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


def trunc_r_and_t(
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
    """Camera pose of least truncated loss (MSAC): holds beyond 50 % of wrong lines, if ``sigma_px`` is true.

    The loss is the sum of squared errors over their variance, each line's at most ``2 outlier_sigmas^2``. Candidates
    and arguments are those of :func:`med_r_and_t`; the prior's share is part of the loss if its covariance is given.
    The best candidates are refined on their own inliers, and a line that matches only beside its model line's ends, or
    behind the camera, counts as an outlier.

    Raises:
        ValueError: as :func:`med_r_and_t`.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    outlier_part = TRUNC_DRAWN_OUTLIER_PART
    candidates = compute_candidates(lines, prior, landmark_ids, probability, outlier_part, rng)
    if candidates is None:
        return r_and_t_ml(
            model_lines_world, segments_px, camera, prior, sigma_px=sigma_px, prior_covariance=prior_covariance,
            settings=settings,
        )
    bound = 2.0 * settings.outlier_sigmas**2
    rotations, translations = _add_concentrated_by_loss(lines, *candidates, bound)
    rotations, translations = keep_possible(lines, prior, prior_covariance, rotations, translations)
    costs = _compute_costs(lines, rotations, translations, bound)
    order = np.argsort(costs, kind="stable")[: TRUNC_FINALISTS].tolist()
    information = NO_INFORMATION
    if prior_covariance is not None:
        information, order = np.linalg.inv(prior_covariance), [*order, len(rotations) - 1]
    refined = [_refine(lines, prior, information, (rotations[i], translations[i]), bound, settings) for i in order]
    state, _ = min(refined, key=lambda end: end[1])
    near = _find_near(lines, state, bound, settings)
    return refine_on_inliers(lines, prior, prior_covariance, landmark_ids, state, near, bound, settings)


def _add_concentrated_by_loss(
    lines: LineSet, rotations: Floats, translations: Floats, bound: float
) -> tuple[Floats, Floats]:
    """The candidates, and the best of them solved again on the few lines that fit them best."""
    costs = _compute_costs(lines, rotations, translations, bound)
    few = np.argsort(costs, kind="stable")[: TRUNC_CANDIDATES]
    keep = max(SUBSET_SIZE + 1, int(len(lines) * TRUNC_INLIER_PART))
    more = concentrate(lines, rotations[few], translations[few], keep)
    return np.concatenate([rotations, more[0]]), np.concatenate([translations, more[1]])


def _compute_costs(lines: LineSet, rotations: Floats, translations: Floats, bound: float) -> Floats:
    return np.asarray(np.minimum(compute_squared_distances(lines, rotations, translations), bound).sum(axis=1))


def _refine(
    lines: LineSet, prior: Pose, information: Floats, state: PoseState, bound: float, settings: PoseSettings
) -> tuple[PoseState, float]:
    """Alternate inliers and likelihood until they agree; the state and its truncated cost, with the prior's share."""
    rotation, translation, cost = kernels.refine_truncated(
        lines.arrays, (np.array(state[0]), np.array(state[1])), (np.array(prior.rotation), np.array(prior.translation)),
        np.array(information), np.array(compute_weak_information()), bound, settings.max_beside_px, SUBSET_SIZE,
        TRUNC_ROUNDS, MAX_ITERATIONS,
    )
    return (rotation, translation), cost


def _find_near(lines: LineSet, state: PoseState, bound: float, settings: PoseSettings) -> Mask:
    costs = kernels.compute_truncated_costs(
        lines.arrays, np.array(state[0]), np.array(state[1]), bound, settings.max_beside_px
    )
    return np.asarray(costs < bound)


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


def pad_rows(groups: list[Indices], subsets: Indices) -> tuple[Indices, Floats]:
    """Line indices (k, w) of each subset of groups, padded with 0, and weights (k, w) that are 0 on the padding."""
    width = max((len(g) for g in groups), default=0)
    table = np.zeros((len(groups), width), dtype=np.intp)
    real = np.zeros((len(groups), width))
    for i, rows in enumerate(groups):
        table[i, : len(rows)] = rows
        real[i, : len(rows)] = 1.0
    return table[subsets].reshape(len(subsets), -1), real[subsets].reshape(len(subsets), -1)


def solve_subsets(lines: LineSet, rows: Indices, real: Floats, start: Pose) -> tuple[Floats, Floats]:
    """Poses (k, 3, 3), (k, 3) of least E1 on k padded subsets ``rows`` (k, w), weights ``real``, all from ``start``."""
    rotations = np.tile(start.rotation, (len(rows), 1, 1))
    translations = np.tile(start.translation, (len(rows), 1))
    poses: tuple[Floats, Floats] = kernels.solve_subsets(
        lines.arrays, rows, real, rotations, translations, SUBSET_ITERATIONS
    )
    return poses


def concentrate(lines: LineSet, rotations: Floats, translations: Floats, keep: int) -> tuple[Floats, Floats]:
    """Poses (k, 3, 3), (k, 3), each solved again, round by round, on the ``keep`` lines that fit it best.

    Rousseeuw's concentration steps: a minimal subset amplifies the noise; half of all lines do not.
    """
    for _ in range(CONCENTRATION_ROUNDS):
        errors = compute_squared_distances(lines, rotations, translations)
        rows = np.ascontiguousarray(np.argsort(errors, axis=1, kind="stable")[:, :keep])
        rotations, translations = kernels.solve_subsets(
            lines.arrays, rows, np.ones(rows.shape), rotations, translations, CONCENTRATION_ITERATIONS
        )
    return rotations, translations
