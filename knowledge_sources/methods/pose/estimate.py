"""The results of the pose solvers, and the last steps of every solver.

These are the sign of the depths, rejections, the covariance by how much the lines scatter, and the prior where it is
better or where few lines leave it much to say.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.pose import kernels
from knowledge_sources.methods.pose.kernels import TINY, RigidMotion
from knowledge_sources.methods.pose.line_set import (
    MAX_BESIDE_PX,
    LineSet,
    compute_image_jacobian,
    compute_normals_px,
    measure_lines,
)
from world_models.frames import Pose, Pose2, frozen

MAX_RESIDUAL_SIGMAS = 1.5
"""Lines whose noise is this many times the stated one no longer decide a pose (of six unknowns) (experiment
covariance)."""
SHARED_PX = 0.3
"""Error shared by all lines of a picture: of calibration and survey (six unknowns) (experiment covariance)."""
MAX_CHI2_SIGMAS = 3.0
"""How far a sum of squares may exceed its mean where a pose explains its lines, in deviations (Morozov's discrepancy
principle)."""
WEAK_ROTATION_RAD = 0.3  # rad; standard deviation of a camera's rotation where none is given
WEAK_TRANSLATION_M = 3.0  # m; standard deviation of a camera's translation where none is given
MAX_PRIOR_WEIGHT_LOG10 = 10.0  # largest weight of a weak prior that is tried, as a power of ten
PRIOR_WEIGHT_STEP_LOG10 = 0.1  # how closely the weight of a weak prior is found, as a power of ten
MIN_SCATTER_FREEDOM = 6  # degrees of freedom from which a larger scatter of the inliers widens the covariance
# largest ratio of the noise's variance to the stated one that is estimated from the inliers' scatter (engineering
# judgement: four times the noise; then the cut on inliers hides the rest)
MAX_SCATTER = 16.0
MAX_ITERATIONS = 30  # levenberg-Marquardt steps for the six unknowns of a camera

DISTANCE = "too far from the model line"
BEHIND = "behind the camera"
NO_OVERLAP = "beside the model line's ends"
NO_LENGTH = "segment without length"


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """A camera pose from n matched lines.

    Attributes:
        camera_from_world: the pose.
        covariance: (6, 6) of the left perturbation (rotation [rad], translation [m]) of :meth:`Pose.perturbed`.
        inliers: (n,) the lines that decided the pose.
        residuals_px: (n, 2) signed distances of the (undistorted) segment ends to the projected model line [px].
        rejected: n reasons, ``None`` for an inlier.
        cost: the solver's own objective at the pose.
        iterations: Levenberg-Marquardt steps taken.
        reason: ``None`` if the lines decided the pose; else why the prior did, wholly or in part.
    """

    camera_from_world: Pose
    covariance: Floats
    inliers: Mask
    residuals_px: Floats
    rejected: tuple[str | None, ...]
    cost: float = 0.0
    iterations: int = 0
    reason: str | None = None

    @property
    def ok(self) -> bool:
        """Whether the lines alone decided the pose."""
        return self.reason is None


@dataclass(frozen=True, slots=True, eq=False)
class PlanarEstimate:
    """A robot pose on the floor from n matched lines or points.

    Attributes:
        world_from_robot: the pose.
        covariance: (3, 3) of (x [m], y [m], heading [rad]).
        inliers: (n,) the lines or points that decided the pose.
        residuals_px: (n, 2) signed; lines: distances of both segment ends to the projected model line,
            points: u and v [px].
        rejected: n reasons, ``None`` for an inlier.
        cost: squared residuals over their variance, each at most the rejection bound, plus the prior's share.
        reason: ``None`` if the image decided the pose; else why the prior did, wholly or in part.
    """

    world_from_robot: Pose2
    covariance: Floats
    inliers: Mask
    residuals_px: Floats
    rejected: tuple[str | None, ...]
    cost: float = 0.0
    reason: str | None = None

    @property
    def ok(self) -> bool:
        """Whether the image alone (with the prior covariance, if one was given) decided the pose."""
        return self.reason is None


def compute_mean_square(variance: float, bound: float) -> float:
    """Mean square of a residual of the normal law in pairs of which those beyond ``bound`` (sum of squares) are cut."""
    if math.isinf(bound):
        return variance
    half = 0.5 * bound / variance
    outside = math.exp(-half)
    return variance * (1.0 - outside * (1.0 + half)) / (1.0 - outside)


def compute_spread(mean: float, bound: float, most: float) -> float:
    """Factor on the covariance of the kept ones' Hessian, by their mean square over the stated variance.

    Args:
        mean: of the squared residuals; below what noise as stated leaves, the noise is as stated.
        bound: of a pair's squared residuals over their stated variance; infinite where none is cut.
        most: the largest variance that is looked for: the mean hardly tells larger ones apart.
    """
    if mean <= compute_mean_square(1.0, bound):
        variance = 1.0
    elif mean >= compute_mean_square(most, bound):
        variance = max(most, mean)
    else:
        from scipy.optimize import brentq  # loaded when first used: most missions start without it

        variance = float(brentq(lambda s: compute_mean_square(s, bound) - mean, 1.0, most))
    return variance * variance / compute_mean_square(variance, bound)


State = TypeVar("State")


def compute_max_chi2(freedom: float) -> float:
    """The largest sum of squares, over their variance, that noise of so many degrees of freedom leaves."""
    return freedom + MAX_CHI2_SIGMAS * math.sqrt(2.0 * freedom)


def solve_near_prior(
    prior: State,
    solve: Callable[[float], State],
    compute_chi2: Callable[[State], float],
    max_chi2: float,
) -> State:
    """The state nearest to the prior that explains the lines to their noise, by Morozov's discrepancy principle.

    Many poses fit few lines, and in directions of which they say little their noise would move the pose far. Nobody
    stated how good the prior is; so its weight is the largest one under which the lines are still explained, or fitted
    as well as any state near the prior does. The weight is found by bisection.

    Args:
        solve: the likeliest state where the prior weighs this many weak ones.
        compute_chi2: a state's sum of squared residuals over their variance.
        max_chi2: up to this the lines are explained.
    """
    if compute_chi2(prior) <= max_chi2:
        return prior
    best, low = solve(1.0), 0.0
    high = MAX_PRIOR_WEIGHT_LOG10 if compute_chi2(best) <= max_chi2 else low
    while high - low > PRIOR_WEIGHT_STEP_LOG10:
        middle = 0.5 * (low + high)
        trial = solve(10.0**middle)
        if compute_chi2(trial) <= max_chi2:
            best, low = trial, middle
        else:
            high = middle
    return best


FEW_LINES = "fewer than 3 lines: the prior decides the rest"
UNDECIDED = "the lines leave a direction open: the prior decides it"
NOT_BETTER = "no pose fits better than the prior"
ALL_BEHIND = "every pose found lies behind the camera: the prior is returned"
FEW_INLIERS = "fewer than 3 lines fit the pose"
MINORITY = "most lines do not fit the pose"
FAR_LINES = "the lines lie further from the pose than their noise allows"
NO_SUBSET = "no subset of lines agrees: the prior is returned"

MIN_LINES = 3
"""Three lines decide six unknowns."""
MIN_LENGTH_PX = 1e-9
"""A shorter segment has no direction."""


@lru_cache(maxsize=1)
def compute_weak_information() -> Floats:
    """(6, 6) information of a prior without a covariance: too little to move a pose that lines decide. Read-only."""
    return frozen(np.diag([WEAK_ROTATION_RAD**-2] * 3 + [WEAK_TRANSLATION_M**-2] * 3))


def knows_more(hessian: Floats, information: Floats) -> bool:
    """Whether, in every direction, the lines of this ``hessian`` know more than the diagonal of ``information``."""
    scale = 1.0 / np.sqrt(np.diag(information))
    return bool(np.linalg.eigvalsh(hessian * scale[:, None] * scale)[0] >= 1.0)


class Minimum(NamedTuple):
    """Where a minimisation ended: R (3, 3), T (3,), the Hessian (6, 6), the cost, and the steps taken."""

    rotation: Floats
    translation: Floats
    hessian: Floats
    cost: float
    iterations: int

    @property
    def state(self) -> RigidMotion:
        """R, T."""
        return self.rotation, self.translation


def minimise(
    kind: int, lines: LineSet, start: RigidMotion, prior: Pose | None = None, information: Floats | None = None,
    weights: Floats | None = None, iterations: int = MAX_ITERATIONS,
) -> Minimum:
    """:func:`kernels.minimise_pose`; the prior counts if its information (6, 6) is given, and lines count alike.

    Arrays that may be read-only are copied: numba compiles a function again for each kind of argument.
    """
    begin = np.array(start[0]), np.array(start[1])
    towards = begin if prior is None else (np.array(prior.rotation), np.array(prior.translation))
    known = np.zeros((6, 6)) if information is None or prior is None else np.array(information)
    weights = np.ones(len(lines)) if weights is None else weights
    return Minimum(*kernels.minimise_pose(kind, lines.arrays, weights, begin, towards, known, iterations))


def is_mostly_in_front(lines: LineSet, state: RigidMotion) -> bool:
    """Whether more than half of the lines pass in front of the camera."""
    return len(lines) == 0 or 2 * int(np.count_nonzero(measure_lines(lines, *state)[1])) > len(lines)


def find_rejections(
    lines: LineSet, state: RigidMotion, near: Mask
) -> tuple[str | None, ...]:
    """Why each line is no inlier (n); ``near`` (n,) says which are near enough to their model line."""
    _, front, overlap = measure_lines(lines, *state, MAX_BESIDE_PX)
    tests = (
        (lines.lengths_px <= MIN_LENGTH_PX, NO_LENGTH), (~near, DISTANCE), (~front, BEHIND), (~overlap, NO_OVERLAP)
    )
    out: list[str | None] = [None] * len(lines)
    for mask, reason in tests:
        for i in np.flatnonzero(mask):
            out[i] = out[i] or reason
    return tuple(out)


def reject_behind(lines: LineSet, state: RigidMotion) -> tuple[str | None, ...]:
    """Reasons of a solver that rejects only what lies behind the camera."""
    return tuple(None if f else BEHIND for f in measure_lines(lines, *state)[1])


def build_estimate(
    lines: LineSet, end: Minimum, covariance: Floats, rejected: tuple[str | None, ...],
    prior: Pose | None = None, known: Floats | None = None, reason: str | None = None, bound: float = math.inf,
    kept: Mask | None = None,
) -> PoseEstimate:
    """The estimate at a pose, with its residuals; its reason, if there is none yet, is :func:`find_doubt`'s.

    Where most of its lines (those ``kept``) lie behind the camera it is the ``prior``, of covariance ``known`` (6, 6).
    """
    rotation = orthonormalise(end.rotation)
    if prior is not None and not is_mostly_in_front(
        lines if kept is None else lines.take(kept), (rotation, end.translation)
    ):
        instead = build_prior_estimate(lines, prior, ALL_BEHIND, known)
        return replace(instead, iterations=end.iterations)
    residuals = measure_lines(lines, *end.state)[0]
    return PoseEstimate(
        camera_from_world=Pose(rotation, end.translation),
        covariance=0.5 * (covariance + covariance.T),
        inliers=np.array([r is None for r in rejected], dtype=bool),
        residuals_px=residuals,
        rejected=rejected,
        cost=end.cost,
        iterations=end.iterations,
        reason=reason or find_doubt(residuals / lines.sigma_px[:, None], rejected, bound),
    )


def build_prior_estimate(
    lines: LineSet, prior: Pose, reason: str, covariance: Floats | None = None
) -> PoseEstimate:
    """The prior unchanged, with the reason why and its ``covariance`` (6, 6); lines behind it are no inliers."""
    if covariance is None:
        covariance = np.asarray(np.linalg.inv(compute_weak_information()), float)
    end = Minimum(prior.rotation, prior.translation, np.zeros((6, 6)), math.inf, 0)
    return build_estimate(lines, end, covariance, reject_behind(lines, end.state), reason=reason)


def orthonormalise(rotation: Floats) -> Floats:
    """The rotation nearest to an almost orthonormal matrix (3, 3)."""
    u, _, vt = np.linalg.svd(rotation)
    return np.asarray(u @ vt)


def find_doubt(
    whitened: Floats, rejected: tuple[str | None, ...], bound: float = math.inf
) -> str | None:
    """Why a pose has not earned to be called decided by its lines, ``None`` if it has.

    ``whitened`` (n, 2) are the residuals over their deviations. A few gross outliers among the lines that count make
    the mean square large, whether the pose is right or not: the solver does not know. Lines of a squared distance
    beyond ``bound`` are left out, and what is kept scatters the less.
    """
    kept = np.array([r is None for r in rejected], bool)
    count = int(np.count_nonzero(kept))
    if count < MIN_LINES:
        return FEW_INLIERS
    if 2 * count < len(rejected):
        return MINORITY
    freedom = 2.0 * count
    limit = compute_mean_square(MAX_RESIDUAL_SIGMAS**2, bound) * compute_max_chi2(freedom)
    return FAR_LINES if float(np.sum(whitened[kept] ** 2)) > limit else None


def compute_covariance(
    lines: LineSet, state: RigidMotion, rejected: tuple[str | None, ...], gain: tuple[Floats, Floats],
    shared_px: float, bound: float | None = None, doubtful: Mask | None = None,
) -> Floats:
    """(6, 6) covariance from how the pose moves with the ends of the lines, see :func:`spread_errors`.

    The lines' own errors may be larger than stated. Lines of which only the best part is kept, those within ``bound``
    (squared distance over variance), scatter more than that part shows. Lines that scatter more than their noise
    allows have more noise. And ``doubtful`` ones (n,) may be wrong by as much as an inlier can be.
    """
    kept = np.array([r is None for r in rejected], bool)
    noise = _measure_scatter(lines.take(kept), state, shared_px)
    if bound is not None:
        mean = noise if noise > 1.0 else compute_mean_square(1.0, bound)
        noise = compute_spread(mean, bound, MAX_SCATTER)
    if bound is not None and doubtful is not None:
        wide = np.where(doubtful, math.sqrt(max(0.5 * bound, 1.0)), 1.0)
        lines = replace(lines, sigma_px=lines.sigma_px * wide)
    return spread_errors(lines, *gain, noise, shared_px)


def compute_gain(lines: LineSet, weights: Floats, state: RigidMotion, covariance: Floats) -> tuple[Floats, Floats]:
    """How the likeliest pose moves when the observed ends do.

    Args:
        weights: (n,) of the lines. covariance: (6, 6) inverse of the cost's Hessian.

    Returns:
        (n, 2, 6) left perturbation of the pose for each px that an end moves along its line's normal, and those
        normals (n, 2) in the picture.
    """
    _, slopes = compute_image_jacobian(lines, *state)
    return -(weights / lines.sigma_px**2)[:, None, None] * slopes @ covariance, compute_normals_px(lines, *state)


def spread_errors(lines: LineSet, gain: Floats, normals_px: Floats, noise: float, shared_px: float) -> Floats:
    """(6, 6) covariance of a pose from the errors of the observed ends.

    A line's own error moves its two ends independently; its fragments (equal model lines) are parts of one line, and
    move with it: they count once. The shared error moves all lines alike: at (x, y) = ray / z the picture is displaced
    by A (1, x, y), each element of A (2, 3) having the deviation ``shared_px``: as a wrong principal point, focal
    length, skew or mounting does.

    Args:
        gain, normals_px: see :func:`compute_gain`. noise: factor on the variance of the lines' own errors.
    """
    first, group = _group_fragments(lines.points)
    along = (np.stack([-normals_px[:, 1], normals_px[:, 0]], axis=1) * lines.focal_px)[first][group]
    places = np.sum(lines.rays[..., :2] * along[:, None], axis=2)
    counts = np.any(gain != 0.0, axis=(1, 2))
    low, high = np.full(len(first), math.inf), np.full(len(first), -math.inf)
    np.minimum.at(low, group[counts], places[counts].min(axis=1))
    np.maximum.at(high, group[counts], places[counts].max(axis=1))
    many = np.bincount(group[counts], minlength=len(first)) > 1
    low, size = np.where(many, low, 0.0), np.where(many, np.maximum(high - low, TINY), 1.0)
    part = np.where(many[group][:, None], (places - low[group][:, None]) / size[group][:, None], (0.0, 1.0))
    side = np.where(np.sum(normals_px * normals_px[first][group], axis=1) >= 0.0, lines.sigma_px, -lines.sigma_px)
    moved = side[:, None, None] * gain
    ends = np.zeros((2, len(first), 6))
    for end, share in zip(ends, (1.0 - part, part), strict=True):
        np.add.at(end, group, np.sum(share[..., None] * moved, axis=1))
    out = noise * np.einsum("ega,egb->ab", ends, ends)
    shared = np.einsum("ia,iec,ief->acf", normals_px, _list_places(lines), gain).reshape(6, 6)
    return np.asarray(out + shared_px**2 * shared.T @ shared)


def _group_fragments(points: Floats) -> tuple[Indices, Indices]:
    """The first line (g,) of each model line of (n, 2, 3), ends in either order, and the group (n,) of each line."""
    apart = points[:, 0] - points[:, 1]
    is_turned = apart[np.arange(len(points)), np.argmax(apart != 0.0, axis=1)] > 0.0
    ordered = np.where(is_turned[:, None, None], points[:, ::-1], points).reshape(-1, 6)
    _, first, group = np.unique(ordered, axis=0, return_index=True, return_inverse=True)
    return first, group.reshape(-1)


def _list_places(lines: LineSet) -> Floats:
    """(n, 2, 3) 1, x, y of the observed ends, (x, y) = ray / z."""
    return np.concatenate([np.ones((*lines.rays.shape[:2], 1)), lines.rays[..., :2]], axis=2)


def _measure_scatter(lines: LineSet, state: RigidMotion, shared_px: float) -> float:
    """The lines' variance over the stated one, if that does not allow it; else 1.

    From what is left of the residuals when the pose, and the error that all lines share, are fitted to them: a pose
    that is not the likeliest one has larger residuals without more noise.
    """
    freedom = 2.0 * len(lines) - 6.0
    distances = measure_lines(lines, *state)[0]
    chi2 = float(np.sum((distances / lines.sigma_px[:, None]) ** 2))
    if freedom < MIN_SCATTER_FREEDOM or chi2 <= compute_max_chi2(freedom):
        return 1.0
    residuals, slopes = compute_image_jacobian(lines, *state)
    shared = np.einsum("ia,iec->ieac", compute_normals_px(lines, *state), _list_places(lines))
    shared = shared.reshape(len(lines), 2, 6) * (shared_px > 0.0)
    sigma = np.repeat(lines.sigma_px, 2)
    columns = np.concatenate([slopes, shared], axis=2).reshape(-1, 12) / sigma[:, None]
    whitened = residuals.reshape(-1) / sigma
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    basis = basis[:, sizes > 1e-9 * sizes[0]]
    freedom = len(whitened) - basis.shape[1]
    left = float(np.sum((whitened - basis @ (basis.T @ whitened)) ** 2))
    is_more = freedom >= MIN_SCATTER_FREEDOM and left > compute_max_chi2(freedom)
    return left / freedom if is_more else 1.0
