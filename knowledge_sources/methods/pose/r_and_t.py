"""The camera pose of maximum likelihood, to which every line counts; started from the paper's R and T (E1, §6.2.2)."""

from __future__ import annotations

from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose import kernels
from knowledge_sources.methods.pose.estimate import (
    BEHIND,
    FEW_LINES,
    MAX_ITERATIONS,
    MIN_LINES,
    NOT_BETTER,
    UNDECIDED,
    Minimum,
    PoseEstimate,
    build_estimate,
    build_prior_estimate,
    compute_covariance,
    compute_max_chi2,
    compute_weak_information,
    find_doubt,
    is_mostly_in_front,
    knows_more,
    minimise,
    reject_behind,
    solve_near_prior,
)
from knowledge_sources.methods.pose.kernels import IMAGE, PLANES, RigidMotion
from knowledge_sources.methods.pose.line_set import (
    LandmarkIds,
    LineSet,
    build_line_set,
    check_landmarks,
    check_matched_arrays,
    check_sigma,
    compute_squared_distances,
    invert_information,
)
from knowledge_sources.settings import DEFAULT, PoseSettings
from world_models.camera import Camera
from world_models.frames import Pose


def r_and_t_ml(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    prior_covariance: Any = None,
    settings: PoseSettings = DEFAULT.pose,
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
    if prior_covariance is None:
        estimate = _solve_in_prior_basin(
            model_lines_world, segments_px, camera, prior, landmark_ids, sigma_px, settings
        )
        if estimate is not None:
            return estimate
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    check_landmarks(landmark_ids, len(lines))
    information, known = invert_covariance(prior_covariance)
    if not len(lines):
        return build_prior_estimate(lines, prior, FEW_LINES, settings, known)
    end, reason = find_likeliest(lines, prior, information, settings)
    if _compute_chi2(lines, end.state) > _compute_chi2(lines, (prior.rotation, prior.translation)):
        return build_prior_estimate(lines, prior, NOT_BETTER, settings, known)
    kept = reject_behind(lines, end.state)
    covariance = compute_likeliest_covariance(lines, end, np.ones(len(lines)), kept, settings)
    return build_estimate(lines, end, covariance, kept, settings, prior, known, reason)


def compute_likeliest_covariance(
    lines: LineSet, end: Minimum, weights: Floats, rejected: tuple[str | None, ...], settings: PoseSettings,
    bound: float | None = None, doubtful: Mask | None = None,
) -> Floats:
    """(6, 6) covariance of the likeliest pose: what the prior knew, and :func:`compute_covariance`.

    Args:
        end: where the minimisation over the lines with ``weights`` (n,) ended; its Hessian has the prior's information.
    """
    inverse = invert_information(end.hessian)
    gain = kernels.compute_gain(lines.arrays, weights, np.array(end.rotation), np.array(end.translation), inverse)
    scaled = gain[0].reshape(-1, 6) * np.repeat(lines.sigma_px, 2)[:, None]
    return inverse - scaled.T @ scaled + compute_covariance(
        lines, end.state, rejected, gain, settings, bound, doubtful)


def find_likeliest(
    lines: LineSet, prior: Pose, information: Floats | None, settings: PoseSettings, start: RigidMotion | None = None
) -> tuple[Minimum, str | None]:
    """The likeliest pose from ``start`` (``None``: E1's minimum), and why the prior had to help.

    ``information`` (6, 6) is the prior's, ``None`` if it does not count.
    """
    if information is None and len(lines) < MIN_LINES:
        return _solve_near_prior(lines, prior, settings), FEW_LINES
    end = minimise(IMAGE, lines, start or _find_start(lines, prior), prior, information)
    if information is not None:
        return end, None
    undecided = not knows_more(end.hessian, compute_weak_information())
    if len(lines) > MIN_LINES and not undecided:
        return end, None
    return _solve_near_prior(lines, prior, settings), UNDECIDED if undecided else None


def _solve_near_prior(lines: LineSet, prior: Pose, settings: PoseSettings) -> Minimum:
    """See :func:`solve_near_prior`. The covariance is that of a weak prior, as nobody stated how good the prior is."""
    here = (prior.rotation, prior.translation)
    weak = compute_weak_information()
    state = solve_near_prior(
        here,
        lambda weight: minimise(IMAGE, lines, here, prior, weight * weak).state,
        lambda state: _compute_chi2(lines, state),
        compute_max_chi2(2.0 * len(lines), settings),
    )
    return minimise(IMAGE, lines, state, prior, weak, iterations=0)


def _solve_in_prior_basin(
    model_lines: Any, segments: Any, camera: Camera, prior: Pose, landmark_ids: LandmarkIds, sigma_px: Any,
    settings: PoseSettings,
) -> PoseEstimate | None:
    """The estimate at the minimum of the prior's own basin, without E1, if it explains the lines to their noise."""
    model, ends_px = check_matched_arrays(model_lines, segments)
    n = len(model)
    check_landmarks(landmark_ids, n)
    freedom = 2.0 * n - 6.0
    if freedom < 0.0:
        return None
    sigma = check_sigma(sigma_px, n)
    fine, rotation, translation, covariance, cost, steps, distances, front = kernels.solve_from_prior(
        model, camera.undistort(ends_px), (camera.fx, camera.fy, camera.cx, camera.cy), sigma,
        (np.array(prior.rotation), np.array(prior.translation)), np.array(compute_weak_information()),
        compute_max_chi2(freedom, settings), settings.max_beside_px, MAX_ITERATIONS, settings.shared_px,
    )
    if not fine:
        return None
    fronts = front.tolist()
    rejected = tuple(None if f else BEHIND for f in fronts)
    doubt = None if all(fronts) else find_doubt(distances / sigma[:, None], rejected, settings)
    return PoseEstimate(Pose(rotation, translation), covariance, front, distances, rejected, cost, steps, doubt)


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
