"""R and T with the maximum-likelihood finish: E1 to get there, image distances to end."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from knowledge_sources.methods.pose.descent import Descent, Normal, descend, information_inverse, normal_equations
from knowledge_sources.methods.pose.estimate import Array, PoseEstimate
from knowledge_sources.methods.pose.guard import (
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
from knowledge_sources.methods.pose.image_error import image_distances, image_jacobian
from knowledge_sources.methods.pose.lines import LandmarkIds, LineSet, landmark_groups, line_set
from knowledge_sources.methods.pose.r_and_t import PoseState, moved, solve_e1
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
) -> PoseEstimate:
    """The pose under which the observed segment ends are likeliest.

    Minimises the squared distances [px] of the ends to the projected infinite model lines over their variance.
    Started from E1 (§6.2.2), whose basin is wide but whose optimum is not efficient where depths vary.

    With ``prior_covariance`` (6, 6) of the prior's left perturbation the prior is one more measurement. Without it
    the prior only decides directions that the lines leave open (fewer than 3 lines, or parallel ones).
    """
    lines = line_set(model_lines_world, segments_px, camera, sigma_px)
    landmark_groups(landmark_ids, len(lines))
    information = prior_information(prior_covariance)
    if not len(lines):
        return prior_estimate(lines, prior, FEW_LINES)
    end, reason = likeliest(lines, prior, information)
    rotation, translation = end.state
    if _chi2(lines, rotation, translation) > _chi2(lines, prior.rotation, prior.translation):
        return prior_estimate(lines, prior, NOT_BETTER)
    covariance = information_inverse(end.normal.hessian)
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
    if len(lines) >= 3:
        end = ml_descent(lines, start or _best_start(lines, prior))
        if not open_direction(end.normal.hessian):
            return end, None
    reason = FEW_LINES if len(lines) < 3 else UNDECIDED
    return ml_descent(lines, (prior.rotation, prior.translation), prior, WEAK_INFORMATION), reason


def ml_descent(
    lines: LineSet, start: PoseState, prior: Pose | None = None, information: Array | None = None
) -> Descent[PoseState]:
    """Minimise the squared image distances over their variance, plus the prior's if its information is given."""
    scale = 1.0 / lines.sigma_px[:, None]

    def linearise(state: PoseState) -> Normal:
        distances, jacobian = image_jacobian(lines, *state)
        normal = normal_equations(distances * scale, jacobian * scale[..., None])
        return normal if prior is None or information is None else _with_prior(normal, state, prior, information)

    return descend(start, linearise, moved)


def prior_information(covariance: Any) -> Array | None:
    """The inverse of a (6, 6) covariance, ``None`` for ``None``."""
    if covariance is None:
        return None
    matrix = np.asarray(covariance, float)
    if matrix.shape != (6, 6):
        raise ValueError(f"expected a prior_covariance of shape (6, 6), got {matrix.shape}")
    return np.asarray(np.linalg.inv(matrix))


def _with_prior(normal: Normal, state: PoseState, prior: Pose, information: Array) -> Normal:
    turn = state[0] @ prior.rotation.T
    away = np.concatenate([Rotation.from_matrix(turn).as_rotvec(), state[1] - turn @ prior.translation])
    pull = information @ away
    return Normal(normal.cost + float(away @ pull), normal.hessian + information, normal.gradient + pull)


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
    return float(np.sum((image_distances(lines, rotation, translation) / lines.sigma_px[:, None]) ** 2))
