"""Trunc R and T: a truncated loss with known noise over the subsets of Med R and T, beyond 50 % outliers."""

from __future__ import annotations

from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.estimate import PoseEstimate
from knowledge_sources.methods.pose.line_set import LandmarkIds, LineSet, build_line_set
from knowledge_sources.methods.pose.med_r_and_t import SUBSET_SIZE, compute_candidates, keep_possible, refine_on_inliers
from knowledge_sources.methods.pose.numerics import kernels
from knowledge_sources.methods.pose.numerics.finish import compute_weak_information
from knowledge_sources.methods.pose.numerics.subsets import compute_squared_distances, concentrate
from knowledge_sources.methods.pose.r_and_t import NO_INFORMATION, PoseState
from knowledge_sources.methods.pose.r_and_t_ml import r_and_t_ml
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.pose import PoseSettings
from world_models.camera import Camera
from world_models.frames import Pose


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
    outlier_part = settings.trunc_drawn_outlier_part
    candidates = compute_candidates(lines, prior, landmark_ids, probability, outlier_part, rng, settings)
    if candidates is None:
        return r_and_t_ml(
            model_lines_world, segments_px, camera, prior, sigma_px=sigma_px, prior_covariance=prior_covariance,
            settings=settings,
        )
    bound = 2.0 * settings.outlier_sigmas**2
    rotations, translations = _add_concentrated(lines, *candidates, bound, settings)
    rotations, translations = keep_possible(lines, prior, prior_covariance, rotations, translations)
    costs = _compute_costs(lines, rotations, translations, bound)
    order = np.argsort(costs, kind="stable")[: settings.trunc_finalists].tolist()
    information = NO_INFORMATION
    if prior_covariance is not None:
        information, order = np.linalg.inv(prior_covariance), [*order, len(rotations) - 1]
    refined = [_refine(lines, prior, information, (rotations[i], translations[i]), bound, settings) for i in order]
    state, _ = min(refined, key=lambda end: end[1])
    near = _find_near(lines, state, bound, settings)
    return refine_on_inliers(lines, prior, prior_covariance, landmark_ids, state, near, bound, settings)


def _add_concentrated(
    lines: LineSet, rotations: Floats, translations: Floats, bound: float, settings: PoseSettings
) -> tuple[Floats, Floats]:
    """The candidates, and the best of them solved again on the few lines that fit them best."""
    costs = _compute_costs(lines, rotations, translations, bound)
    few = np.argsort(costs, kind="stable")[: settings.trunc_candidates]
    keep = max(SUBSET_SIZE + 1, int(len(lines) * settings.trunc_inlier_part))
    more = concentrate(lines, rotations[few], translations[few], keep, settings)
    return np.concatenate([rotations, more[0]]), np.concatenate([translations, more[1]])


def _compute_costs(lines: LineSet, rotations: Floats, translations: Floats, bound: float) -> Floats:
    return np.asarray(np.minimum(compute_squared_distances(lines, rotations, translations), bound).sum(axis=1))


def _refine(
    lines: LineSet, prior: Pose, information: Floats, state: PoseState, bound: float, settings: PoseSettings
) -> tuple[PoseState, float]:
    """Alternate inliers and likelihood until they agree; the state and its truncated cost, with the prior's share."""
    rotation, translation, cost = kernels.refine_truncated(
        lines.arrays, (np.array(state[0]), np.array(state[1])), (np.array(prior.rotation), np.array(prior.translation)),
        np.array(information), np.array(compute_weak_information(settings)), bound, settings.max_beside_px, SUBSET_SIZE,
        settings.trunc_rounds, settings.max_iterations,
    )
    return (rotation, translation), cost


def _find_near(lines: LineSet, state: PoseState, bound: float, settings: PoseSettings) -> Mask:
    costs = kernels.compute_truncated_costs(
        lines.arrays, np.array(state[0]), np.array(state[1]), bound, settings.max_beside_px
    )
    return np.asarray(costs < bound)
