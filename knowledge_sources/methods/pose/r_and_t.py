"""Camera poses to which every line counts: R then T (§6.2.1), R and T (§6.2.2), and R and T of maximum likelihood.

Those of the paper are distances of the model lines' ends to the observed projection planes; the likelihood's are
distances in the image. All of them minimise with the compiled Levenberg-Marquardt of `kernels`.
"""

from __future__ import annotations

from typing import Any, Literal

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
from knowledge_sources.methods.pose.kernels import IMAGE, PLANES, SINES, TINY, TURN, RigidMotion
from knowledge_sources.methods.pose.line_set import (
    LandmarkIds,
    LineSet,
    build_line_set,
    check_landmarks,
    check_matched_arrays,
    check_sigma,
    compute_squared_distances,
    cross,
    invert_information,
)
from knowledge_sources.settings import DEFAULT, PoseSettings
from world_models.camera import Camera
from world_models.frames import Pose

Weighting = Literal["unit", "length"]


def r_and_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    objective: Literal["E1", "E2"] = "E1",
    weighting: Weighting = "unit",
    settings: PoseSettings = DEFAULT.pose,
) -> PoseEstimate:
    """Camera pose of least squared distances of the model ends to the observed projection planes.

    Source: §6.2.2, E1 = sum_i sigma_i (n_i . (R p_i + T))^2, and E2, each term over |R p_i + T|^2. E1 is quadratic
    in T, which is eliminated: the basin does not depend on the prior's translation. Every line counts: use
    :func:`med_r_and_t` where some may be matched wrongly.

    Args:
        model_lines_world: (n, 2, 3) [m].
        segments_px: (n, 2, 2) observed, as the lens shows them.
        prior: guess of ``camera_from_world``.
        landmark_ids: checked, not used, as every line counts.
        sigma_px: of the segment ends across the line, one number or (n,); scales the covariance.
        objective: "E1", or "E2" (ends weigh alike whatever their depth), started from E1.
        weighting: the paper's sigma_i: "unit" or by segment "length".

    Raises:
        ValueError: as :func:`build_line_set`; ids that are not one a line; an unknown objective or weighting.
    """
    if objective not in ("E1", "E2"):
        raise ValueError(f'expected objective "E1" or "E2", got {objective!r}')
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    kinds = (PLANES,) if objective == "E1" else (PLANES, SINES)
    return _solve(lines, prior, landmark_ids, weighting, kinds, settings)


def r_then_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    weighting: Weighting = "unit",
    settings: PoseSettings = DEFAULT.pose,
) -> PoseEstimate:
    """Camera pose in two least-squares problems: n_i . R d_i = 0 for R, then n_i . (R p_i + T) = 0 for T.

    Source: §6.2.1 (Liu et al. [27]). Rotation increments are axis-angle vectors, not Liu's Euler angles: the minimum is
    the same, the way to it safer. Arguments and errors as in :func:`r_and_t`, which is more accurate.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    return _solve(lines, prior, landmark_ids, weighting, (TURN,), settings)


def _solve(
    lines: LineSet, prior: Pose, landmark_ids: LandmarkIds, weighting: Weighting, kinds: tuple[int, ...],
    settings: PoseSettings,
) -> PoseEstimate:
    """Minimise what ``kinds`` of `kernels` name, each from where the one before ended."""
    check_landmarks(landmark_ids, len(lines))
    if len(lines) < MIN_LINES:
        return build_prior_estimate(lines, prior, FEW_LINES, settings)
    weights = _compute_line_weights(lines, weighting)
    end = Minimum(prior.rotation, prior.translation, np.zeros((6, 6)), 0.0, 0)
    for kind in kinds:
        again = minimise(kind, lines, end.state, weights=weights)
        end = again._replace(iterations=end.iterations + again.iterations)
    kept = reject_behind(lines, end.state)
    covariance = compute_covariance(lines, end.state, kept, _compute_gain(lines, end, weights, kinds[-1]), settings)
    return build_estimate(lines, end, covariance, kept, settings, prior)


def _compute_line_weights(lines: LineSet, weighting: Weighting) -> Floats:
    """The paper's weights sigma_i (n,): all one, or the segment's length over the mean length."""
    if weighting == "unit":
        return np.ones(len(lines))
    if weighting == "length":
        return np.asarray(lines.lengths_px / max(float(np.mean(lines.lengths_px)), TINY))
    raise ValueError(f'expected weighting "unit" or "length", got {weighting!r}')


def _compute_gain(lines: LineSet, end: Minimum, weights: Floats, kind: int) -> tuple[Floats, Floats]:
    """How the pose of one of the paper's minima moves with the observed ends, see :func:`kernels.compute_gain`.

    None of them is a likelihood, so the inverse Hessian is not the covariance. At a minimum the gradient is zero, and
    stays so: its derivative by the pose, times the pose's move, is minus its derivative by the ends.
    """
    q = lines.points @ end.rotation.T + end.translation
    weigh = np.repeat(weights[:, None], 2, axis=1)
    if kind == SINES:
        weigh = weigh / np.maximum(np.sum(q**2, axis=-1), TINY)
    normals = np.broadcast_to(lines.normals[:, None], q.shape)
    slopes = np.concatenate([cross(q, normals), normals], axis=-1)
    first, second = lines.rays[:, 0], lines.rays[:, 1]
    along = (second - first)[:, :2] * lines.focal_px
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(lines.lengths_px, TINY)[:, None]
    shift = np.concatenate([across / lines.focal_px, np.zeros((len(lines), 1))], axis=1)
    size = np.maximum(np.linalg.norm(cross(first, second), axis=1), TINY)[:, None, None]
    moved = np.stack([cross(shift, second), cross(first, shift)], axis=1) / size  # normals, for each end by one px
    hessian = np.einsum("ik,ika,ikb->ab", weigh, slopes, slopes)
    spread = np.einsum("ik,ika,ikc,iec->aie", weigh, slopes, q, moved)
    if kind == TURN:  # the rotation has conditions of its own
        turned = lines.directions @ end.rotation.T
        about = cross(turned, lines.normals)
        hessian[:3] = np.concatenate([np.einsum("i,ia,ib->ab", weights, about, about), np.zeros((3, 3))], axis=1)
        spread[:3] = np.einsum("i,ia,ic,iec->aie", weights, about, turned, moved)
    least = max(float(np.trace(hessian)) * 1e-15, TINY) * np.eye(6)
    gain = -np.linalg.solve(hessian + least, spread.reshape(6, -1)).reshape(6, len(lines), 2)
    return np.ascontiguousarray(np.moveaxis(gain, 0, 2)), across


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
