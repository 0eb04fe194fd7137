"""Camera poses (six unknowns, §6.2): R and T of maximum likelihood, and Med R and T, its least median of squares.

To the likelihood every line counts; it is started from the paper's R and T (E1, §6.2.2). Med R and T draws subsets of 3
lines or landmarks, and holds where some are matched wrongly (§6.2.4).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.pose import kernels
from knowledge_sources.methods.pose.estimate import (
    FEW_LINES,
    MIN_LENGTH_PX,
    MIN_LINES,
    NO_SUBSET,
    NOT_BETTER,
    SHARED_PX,
    UNDECIDED,
    Minimum,
    PoseEstimate,
    build_estimate,
    build_prior_estimate,
    compute_covariance,
    compute_gain,
    compute_max_chi2,
    compute_weak_information,
    find_rejections,
    is_mostly_in_front,
    knows_more,
    minimise,
    reject_behind,
    solve_near_prior,
)
from knowledge_sources.methods.pose.kernels import IMAGE, PLANES, RigidMotion
from knowledge_sources.methods.pose.line_set import (
    OUTLIER_SIGMAS,
    LandmarkIds,
    LineSet,
    build_line_set,
    check_landmarks,
    compute_image_jacobian,
    compute_squared_distances,
    group_by_landmark,
    invert_information,
)
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


def r_and_t_ml(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    prior_covariance: Any = None,
    shared_px: float = SHARED_PX,
) -> PoseEstimate:
    """Camera pose of maximum likelihood: the smallest error, where every line is matched rightly.

    Minimises the squared distances [px] of the observed ends to the projected infinite model lines over their variance.
    Started from E1 (§6.2.2), whose basin is wide but whose minimum is not efficient where depths vary.

    Args:
        model_lines_world: (n, 2, 3) [m]. segments_px: (n, 2, 2) observed, as the lens shows them.
        prior: guess of ``camera_from_world``.
        landmark_ids: checked, not used, as every line counts.
        sigma_px: standard deviation of the segment ends across the line, one number or (n,).
        prior_covariance: (6, 6) of the prior's left perturbation: the prior is one more measurement. ``None``: the
            prior only decides what the lines leave open; parallel lines, or three and fewer, move it no further than
            their noise demands.

    Raises:
        ValueError: as :func:`build_line_set`; ids that are not one a line; a covariance of another shape.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    check_landmarks(landmark_ids, len(lines))
    information, known = invert_covariance(prior_covariance)
    if not len(lines):
        return build_prior_estimate(lines, prior, FEW_LINES, known)
    end, reason = find_likeliest(lines, prior, information)
    if _compute_chi2(lines, end.state) > _compute_chi2(lines, (prior.rotation, prior.translation)):
        return build_prior_estimate(lines, prior, NOT_BETTER, known)
    kept = reject_behind(lines, end.state)
    covariance = compute_likeliest_covariance(lines, end, np.ones(len(lines)), kept, shared_px)
    return build_estimate(lines, end, covariance, kept, prior, known, reason)


def compute_likeliest_covariance(
    lines: LineSet, end: Minimum, weights: Floats, rejected: tuple[str | None, ...], shared_px: float,
    bound: float | None = None, doubtful: Mask | None = None,
) -> Floats:
    """(6, 6) covariance of the likeliest pose: what the prior knew, and :func:`compute_covariance`.

    Args:
        end: where the minimisation over the lines with ``weights`` (n,) ended; its Hessian has the prior's information.
    """
    inverse = invert_information(end.hessian)
    gain = compute_gain(lines, weights, end.state, inverse)
    scaled = gain[0].reshape(-1, 6) * np.repeat(lines.sigma_px, 2)[:, None]
    return inverse - scaled.T @ scaled + compute_covariance(
        lines, end.state, rejected, gain, shared_px, bound, doubtful)


def find_likeliest(
    lines: LineSet, prior: Pose, information: Floats | None, start: RigidMotion | None = None
) -> tuple[Minimum, str | None]:
    """The likeliest pose from ``start``, and why the prior had to help.

    Without ``start`` it is the prior's own basin, if that explains the lines to their noise, else E1's minimum.

    ``information`` (6, 6) is the prior's, ``None`` if it does not count.
    """
    if information is None and len(lines) < MIN_LINES:
        return _solve_near_prior(lines, prior), FEW_LINES
    if information is None and start is None:
        end = minimise(IMAGE, lines, (prior.rotation, prior.translation))
        explains = end.cost <= compute_max_chi2(2.0 * len(lines) - 6.0)
        if explains and is_mostly_in_front(lines, end.state) and knows_more(end.hessian, compute_weak_information()):
            return end, None
    end = minimise(IMAGE, lines, start or _find_start(lines, prior), prior, information)
    if information is not None:
        return end, None
    undecided = not knows_more(end.hessian, compute_weak_information())
    if len(lines) > MIN_LINES and not undecided:
        return end, None
    return _solve_near_prior(lines, prior), UNDECIDED if undecided else None


def _solve_near_prior(lines: LineSet, prior: Pose) -> Minimum:
    """See :func:`solve_near_prior`. The covariance is that of a weak prior, as nobody stated how good the prior is."""
    here = (prior.rotation, prior.translation)
    weak = compute_weak_information()
    state = solve_near_prior(
        here,
        lambda weight: minimise(IMAGE, lines, here, prior, weight * weak).state,
        lambda state: _compute_chi2(lines, state),
        compute_max_chi2(2.0 * len(lines)),
    )
    return minimise(IMAGE, lines, state, prior, weak, iterations=0)


def invert_covariance(covariance: Any) -> tuple[Floats | None, Floats | None]:
    """The inverse of a (6, 6) covariance and itself, ``None`` for ``None``."""
    if covariance is None:
        return None, None
    matrix = np.asarray(covariance, float)
    if matrix.shape != (6, 6):
        raise ValueError(f"expected a prior_covariance of shape (6, 6), got {matrix.shape}")
    return np.asarray(np.linalg.inv(matrix)), matrix


def _find_start(lines: LineSet, prior: Pose) -> RigidMotion:
    """E1's minimum, unless it is behind the camera or the prior fits the image better."""
    here = (prior.rotation, prior.translation)
    if len(lines) < MIN_LINES:
        return here
    e1 = minimise(PLANES, lines, here).state
    is_better = is_mostly_in_front(lines, e1) and _compute_chi2(lines, e1) <= _compute_chi2(lines, here)
    return e1 if is_better else here


def _compute_chi2(lines: LineSet, state: RigidMotion) -> float:
    return float(np.sum(compute_squared_distances(lines, *state)))


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
    shared_px: float = SHARED_PX,
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
        bound = 2.0 * (OUTLIER_SIGMAS * _compute_robust_scale(least, len(lines))) ** 2
        tied = np.flatnonzero(medians <= max(least, _compute_tied_median()))
        best = int(tied[np.argmin(np.minimum(errors[tied], bound).sum(axis=1))])
        return (rotations[best], translations[best]), errors[best] <= bound, bound

    return solve_from_subsets(model_lines_world, segments_px, camera, prior, landmark_ids, sigma_px, probability,
                              MED_DRAWN_OUTLIER_PART, rng, prior_covariance, shared_px, choose)


Choose = Callable[[LineSet, Floats, Floats], tuple[RigidMotion, Mask, float]]


def solve_from_subsets(
    model_lines_world: Any, segments_px: Any, camera: Camera, prior: Pose, landmark_ids: LandmarkIds, sigma_px: Any,
    probability: float | None, outlier_part: float, rng: np.random.Generator | None, prior_covariance: Any,
    shared_px: float, choose: Choose,
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
            shared_px=shared_px,
        )
    needed = None if probability is None else count_subsets(SUBSET_SIZE, outlier_part, probability)
    rows, real = _pad_rows(groups, list_subsets(len(groups), SUBSET_SIZE, needed, rng))
    starts = np.tile(prior.rotation, (len(rows), 1, 1)), np.tile(prior.translation, (len(rows), 1))
    candidates = kernels.solve_subsets(lines.arrays, rows, real, *starts, SUBSET_ITERATIONS)
    return _refine_on_inliers(lines, prior, prior_covariance, landmark_ids, *choose(lines, *candidates), shared_px)


def keep_possible(
    lines: LineSet, prior: Pose, prior_covariance: Any, rotations: Floats, translations: Floats
) -> tuple[Floats, Floats]:
    """The candidates (k, 3, 3), (k, 3) that the prior does not exclude, and the prior itself; all if it is unknown.

    A candidate has the noise of its subset: about that of all lines, over the subset's share of them.
    """
    if prior_covariance is None:
        return rotations, translations
    from scipy.spatial.transform import Rotation  # loaded when first used: missions start without it

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
    bound: float, shared_px: float,
) -> PoseEstimate:
    """The likeliest pose of the lines kept, with reasons for the others (§6.2.4, steps 3 and 4).

    Repeated while the new pose keeps other lines: a line that a subset's noise had put too far may come back.

    Args:
        near: (n,) the lines kept at ``start``. bound: of a line's squared distance over its variance.
    """
    information, known = invert_covariance(prior_covariance)
    near = near & (lines.lengths_px > MIN_LENGTH_PX)
    if int(np.count_nonzero(near)) < SUBSET_SIZE:
        return build_prior_estimate(lines, prior, NO_SUBSET, known)
    for _ in range(MAX_REFINEMENTS):
        end, reason = find_likeliest(lines.take(near), prior, information, start)
        start = end.state
        fine = compute_squared_distances(lines, *start) <= bound
        rejected = find_rejections(lines, start, fine)
        again = np.array([r is None for r in rejected], bool)
        if np.array_equal(again, near) or int(np.count_nonzero(again)) < SUBSET_SIZE:
            break
        near = again
    doubtful = _find_doubtful(landmark_ids, near)
    covariance = compute_likeliest_covariance(lines, end, near.astype(float), rejected, shared_px, bound, doubtful)
    return build_estimate(lines, end, covariance, rejected, prior, known, reason, bound, near)


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
