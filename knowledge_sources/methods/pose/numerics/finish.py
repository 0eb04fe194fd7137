"""The last steps of every solver: sign of the depths, rejections, and the prior where it is better."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.estimate import BEHIND, DISTANCE, NO_LENGTH, NO_OVERLAP, PoseEstimate
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.numerics import kernels
from knowledge_sources.methods.pose.numerics.discrepancy_principle import compute_max_chi2
from knowledge_sources.methods.pose.numerics.image_error import compute_image_jacobian, find_in_front, measure_lines
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import orthonormalise
from knowledge_sources.methods.pose.numerics.trimmed_noise import compute_mean_square, compute_spread
from knowledge_sources.settings.pose import PoseSettings
from world_models.frames import Pose, frozen

FEW_LINES = "fewer than 3 lines: the prior decides the rest"
UNDECIDED = "the lines leave a direction open: the prior decides it"
NOT_BETTER = "no pose fits better than the prior"
ALL_BEHIND = "every pose found lies behind the camera: the prior is returned"
FEW_INLIERS = "fewer than 3 lines fit the pose"
MINORITY = "most lines do not fit the pose"
FAR_LINES = "the lines lie further from the pose than their noise allows"
NO_SUBSET = "no subset of lines agrees: the prior is returned"

MIN_INLIERS = 3
"""Three lines decide six unknowns."""
MIN_LENGTH_PX = 1e-9
"""A shorter segment has no direction."""


def compute_weak_information(settings: PoseSettings) -> Floats:
    """(6, 6) information of a prior without a covariance: too little to move a pose that lines decide. Read-only."""
    return _compute_weak_information(settings.weak_rotation_rad, settings.weak_translation_m)


@lru_cache(maxsize=8)
def _compute_weak_information(rotation_rad: float, translation_m: float) -> Floats:
    return frozen(np.diag([rotation_rad**-2] * 3 + [translation_m**-2] * 3))


def has_open_direction(hessian: Floats, settings: PoseSettings) -> bool:
    """Whether, in some direction, the lines know less than a weak prior."""
    scale = 1.0 / np.sqrt(np.diag(compute_weak_information(settings)))
    return bool(np.linalg.eigvalsh(hessian * scale[:, None] * scale)[0] < 1.0)


def is_mostly_in_front(lines: LineSet, rotation: Floats, translation: Floats) -> bool:
    """Whether more than half of the lines pass in front of the camera."""
    return len(lines) == 0 or 2 * int(np.count_nonzero(find_in_front(lines, rotation, translation))) > len(lines)


def find_rejections(
    lines: LineSet, rotation: Floats, translation: Floats, near: Mask, settings: PoseSettings
) -> tuple[str | None, ...]:
    """Why each line is no inlier (n); ``near`` (n,) says which are near enough to their model line."""
    _, front, overlap = measure_lines(lines, rotation, translation, settings.max_beside_px)
    tests = (
        (lines.lengths_px <= MIN_LENGTH_PX, NO_LENGTH), (~near, DISTANCE), (~front, BEHIND), (~overlap, NO_OVERLAP)
    )
    out: list[str | None] = [None] * len(lines)
    for mask, reason in tests:
        for i in np.flatnonzero(mask):
            out[i] = out[i] or reason
    return tuple(out)


def reject_behind(lines: LineSet, rotation: Floats, translation: Floats) -> tuple[str | None, ...]:
    """Reasons of a solver that rejects only what lies behind the camera."""
    return tuple(None if f else BEHIND for f in find_in_front(lines, rotation, translation))


def build_estimate(
    lines: LineSet,
    rotation: Floats,
    translation: Floats,
    covariance: Floats,
    rejected: tuple[str | None, ...],
    cost: float,
    iterations: int,
    reason: str | None,
    settings: PoseSettings,
    bound: float = math.inf,
) -> PoseEstimate:
    """The estimate at a pose, with its residuals; its reason, if there is none yet, is :func:`find_doubt`'s."""
    residuals = measure_lines(lines, rotation, translation)[0]
    return PoseEstimate(
        camera_from_world=Pose(orthonormalise(rotation), translation),
        covariance=0.5 * (covariance + covariance.T),
        inliers=np.array([r is None for r in rejected], dtype=bool),
        residuals_px=residuals,
        rejected=rejected,
        cost=cost,
        iterations=iterations,
        reason=reason or find_doubt(residuals / lines.sigma_px[:, None], rejected, settings, bound),
    )


def find_doubt(
    whitened: Floats, rejected: tuple[str | None, ...], settings: PoseSettings, bound: float = math.inf
) -> str | None:
    """Why a pose has not earned to be called decided by its lines, ``None`` if it has.

    ``whitened`` (n, 2) are the residuals over their deviations. A few gross outliers among the lines that count make
    the mean square large, whether the pose is right or not: the solver does not know. Lines of a squared distance
    beyond ``bound`` are left out, and what is kept scatters the less.
    """
    kept = np.array([r is None for r in rejected], bool)
    count = int(np.count_nonzero(kept))
    if count < MIN_INLIERS:
        return FEW_INLIERS
    if 2 * count < len(rejected):
        return MINORITY
    freedom = 2.0 * count
    limit = compute_mean_square(settings.max_residual_sigmas**2, bound) * compute_max_chi2(freedom, settings)
    return FAR_LINES if float(np.sum(whitened[kept] ** 2)) > limit else None


def compute_covariance(
    lines: LineSet, rotation: Floats, translation: Floats, rejected: tuple[str | None, ...],
    gain: tuple[Floats, Floats], settings: PoseSettings, bound: float | None = None, doubtful: Mask | None = None,
) -> Floats:
    """(6, 6) covariance from how the pose moves with the ends of the lines, see :func:`kernels.spread_errors`.

    The lines' own errors may be larger than stated. Lines of which only the best part is kept, those within ``bound``
    (squared distance over variance), scatter more than that part shows. Lines that scatter more than their noise
    allows have more noise. And ``doubtful`` ones (n,) may be wrong by as much as an inlier can be.
    """
    kept = np.array([r is None for r in rejected], bool)
    noise = measure_scatter(lines.take(kept), rotation, translation, settings)
    if bound is not None:
        mean = noise if noise > 1.0 else compute_mean_square(1.0, bound)
        noise = compute_spread(mean, bound, settings.max_scatter)
    arrays = lines.arrays
    if bound is not None and doubtful is not None:
        arrays = (*arrays[:6], lines.sigma_px * np.where(doubtful, math.sqrt(max(0.5 * bound, 1.0)), 1.0), arrays[7])
    covariance: Floats = kernels.spread_errors(arrays, *gain, noise, settings.shared_px)
    return covariance


def measure_scatter(lines: LineSet, rotation: Floats, translation: Floats, settings: PoseSettings) -> float:
    """The lines' variance over the stated one, if that does not allow it; else 1.

    From what is left of the residuals when the pose, and the error that all lines share, are fitted to them: a pose
    that is not the likeliest one has larger residuals without more noise.
    """
    freedom = 2.0 * len(lines) - 6.0
    distances = measure_lines(lines, rotation, translation)[0]
    chi2 = float(np.sum((distances / lines.sigma_px[:, None]) ** 2))
    if freedom < settings.min_scatter_freedom or chi2 <= compute_max_chi2(freedom, settings):
        return 1.0
    residuals, slopes = compute_image_jacobian(lines, rotation, translation)
    normals_px = kernels.compute_gain(
        lines.arrays, np.zeros(len(lines)), np.array(rotation), np.array(translation), np.eye(6))[1]
    places = np.concatenate([np.ones((*lines.rays.shape[:2], 1)), lines.rays[..., :2]], axis=2)
    shared = np.einsum("ia,iec->ieac", normals_px, places).reshape(len(lines), 2, 6) * (settings.shared_px > 0.0)
    sigma = np.repeat(lines.sigma_px, 2)
    columns = np.concatenate([slopes, shared], axis=2).reshape(-1, 12) / sigma[:, None]
    whitened = residuals.reshape(-1) / sigma
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    basis = basis[:, sizes > 1e-9 * sizes[0]]
    freedom = len(whitened) - basis.shape[1]
    left = float(np.sum((whitened - basis @ (basis.T @ whitened)) ** 2))
    is_more = freedom >= settings.min_scatter_freedom and left > compute_max_chi2(freedom, settings)
    return left / freedom if is_more else 1.0


def build_prior_estimate(
    lines: LineSet, prior: Pose, reason: str, settings: PoseSettings, covariance: Floats | None = None
) -> PoseEstimate:
    """The prior unchanged, with the reason why and its ``covariance`` (6, 6); lines behind it are no inliers."""
    rejected = reject_behind(lines, prior.rotation, prior.translation)
    if covariance is None:
        covariance = np.asarray(np.linalg.inv(compute_weak_information(settings)), float)
    return build_estimate(
        lines, prior.rotation, prior.translation, covariance, rejected, float("inf"), 0, reason, settings
    )


def check_in_front(
    lines: LineSet, prior: Pose, estimate: PoseEstimate, settings: PoseSettings, kept: Mask | None = None,
    covariance: Floats | None = None,
) -> PoseEstimate:
    """The estimate if most of its lines (those ``kept``) lie in front of the camera, else the prior."""
    pose = estimate.camera_from_world
    if is_mostly_in_front(lines if kept is None else lines.take(kept), pose.rotation, pose.translation):
        return estimate
    return replace(build_prior_estimate(lines, prior, ALL_BEHIND, settings, covariance), iterations=estimate.iterations)
