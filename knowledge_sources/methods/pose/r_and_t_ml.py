"""R and T with the maximum-likelihood finish: E1 to get there, image distances to end."""

from __future__ import annotations

from typing import Any

import numpy as np

from knowledge_sources.methods.pose.estimate import BEHIND, Array, PoseEstimate
from knowledge_sources.methods.pose.line_set import (
    LandmarkIds,
    LineSet,
    build_line_set,
    check_landmarks,
    checked_sigma,
    matched_arrays,
)
from knowledge_sources.methods.pose.numerics import line_kernels as kernels
from knowledge_sources.methods.pose.numerics.cautious_update import least_move, most_unexplained
from knowledge_sources.methods.pose.numerics.finish import (
    FEW_LINES,
    NOT_BETTER,
    UNDECIDED,
    WEAK_INFORMATION,
    all_kept,
    estimate_at,
    guarded,
    mostly_in_front,
    open_direction,
    prior_estimate,
)
from knowledge_sources.methods.pose.numerics.image_error import OVERLAP_SLACK_PX
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import Descent, invert_information
from knowledge_sources.methods.pose.numerics.line_kernels import IMAGE
from knowledge_sources.methods.pose.numerics.subset_poses import compute_squared_distances
from knowledge_sources.methods.pose.r_and_t import PoseState, compiled_descent, solve_e1
from world_models.camera import Camera
from world_models.frames import Pose

LEAST = np.diag(WEAK_INFORMATION).copy()
"""Knowing less than this in some direction, the lines do not decide the pose."""


def r_and_t_ml(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    prior_covariance: Any = None,
) -> PoseEstimate:
    """The pose under which the observed segment ends are likeliest.

    Minimises the squared distances [px] of the ends to the projected infinite model lines over their variance.
    Started from E1 (§6.2.2), whose basin is wide but whose optimum is not efficient where depths vary.

    With ``prior_covariance`` (6, 6) of the prior's left perturbation the prior is one more measurement. Without it
    the prior only decides what the lines leave open: parallel ones, or three and fewer, move it no further than their
    noise demands.
    """
    if prior_covariance is None:
        found = _explained(model_lines_world, segments_px, camera, prior, landmark_ids, sigma_px)
        if found is not None:
            return found
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    check_landmarks(landmark_ids, len(lines))
    information = prior_information(prior_covariance)
    if not len(lines):
        return prior_estimate(lines, prior, FEW_LINES)
    end, reason = likeliest(lines, prior, information)
    rotation, translation = end.state
    if _chi2(lines, rotation, translation) > _chi2(lines, prior.rotation, prior.translation):
        return prior_estimate(lines, prior, NOT_BETTER)
    covariance = invert_information(end.normal.hessian)
    kept = all_kept(lines, rotation, translation)
    return guarded(
        lines,
        prior,
        estimate_at(lines, rotation, translation, covariance, kept, end.normal.cost, end.iterations, reason),
    )


def likeliest(
    lines: LineSet, prior: Pose, information: Array | None = None, start: PoseState | None = None
) -> tuple[Descent[PoseState], str | None]:
    """Descend to the likeliest pose from ``start`` (E1's optimum if None), and why the prior had to help."""
    if information is not None:
        return ml_descent(lines, start or _best_start(lines, prior), prior, information), None
    if len(lines) < 3:
        return _cautious(lines, prior), FEW_LINES
    end = ml_descent(lines, start or _best_start(lines, prior))
    undecided = open_direction(end.normal.hessian)
    if len(lines) > 3 and not undecided:
        return end, None
    return _cautious(lines, prior), UNDECIDED if undecided else None


def _cautious(lines: LineSet, prior: Pose) -> Descent[PoseState]:
    """See :func:`least_move`. The covariance is that of a weak prior: the pull says nothing of how right it is."""
    here = (prior.rotation, prior.translation)
    state = least_move(
        here,
        lambda weight: ml_descent(lines, here, prior, weight * WEAK_INFORMATION).state,
        lambda state: _chi2(lines, *state),
        most_unexplained(2.0 * len(lines)),
    )
    return compiled_descent(IMAGE, lines, np.ones(len(lines)), state, prior, WEAK_INFORMATION, 0)


def _explained(
    model: Any, segments: Any, camera: Camera, prior: Pose, landmark_ids: LandmarkIds, sigma_px: Any
) -> PoseEstimate | None:
    """The estimate at the foot of the prior's own basin if it explains the lines to their noise: E1 is not asked."""
    model, ends_px = matched_arrays(model, segments)
    n = len(model)
    check_landmarks(landmark_ids, n)
    freedom = 2.0 * n - 6.0
    if freedom < 0.0:
        return None
    fine, rotation, translation, covariance, cost, steps, distances, front = kernels.explained_from(
        model, camera.undistort(ends_px), (camera.fx, camera.fy, camera.cx, camera.cy), checked_sigma(sigma_px, n),
        (np.array(prior.rotation), np.array(prior.translation)), LEAST,
        most_unexplained(freedom), OVERLAP_SLACK_PX,
    )
    if not fine:
        return None
    fronts = front.tolist()
    rejected = (None,) * n if all(fronts) else tuple(None if f else BEHIND for f in fronts)
    return PoseEstimate(Pose(rotation, translation), covariance, front, distances, rejected, cost, steps)


def ml_descent(
    lines: LineSet, start: PoseState, prior: Pose | None = None, information: Array | None = None
) -> Descent[PoseState]:
    """Minimise the squared image distances over their variance, plus the prior's if its information is given."""
    return compiled_descent(IMAGE, lines, np.ones(len(lines)), start, prior, information)


def prior_information(covariance: Any) -> Array | None:
    """The inverse of a (6, 6) covariance, ``None`` for ``None``."""
    if covariance is None:
        return None
    matrix = np.asarray(covariance, float)
    if matrix.shape != (6, 6):
        raise ValueError(f"expected a prior_covariance of shape (6, 6), got {matrix.shape}")
    return np.asarray(np.linalg.inv(matrix))


def _best_start(lines: LineSet, prior: Pose) -> PoseState:
    """E1's optimum, unless it is behind the camera or the image says that the prior is nearer."""
    here = (prior.rotation, prior.translation)
    if len(lines) < 3:
        return here
    e1 = solve_e1(lines, prior, np.ones(len(lines))).state
    if not mostly_in_front(lines, *e1):
        return here
    return e1 if _chi2(lines, *e1) <= _chi2(lines, *here) else here


def _chi2(lines: LineSet, rotation: Array, translation: Array) -> float:
    return float(np.sum(compute_squared_distances(lines, rotation, translation)))
