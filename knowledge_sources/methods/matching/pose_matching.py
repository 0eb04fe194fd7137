"""Matching with a camera's own unknowns: for errors that perspective does not show as a 2D motion (§6.1).

The paper's matcher moves the projected model rigidly in the image. Close to the camera that is not how it moves: a
pose error of 0.3 m shifts a line at 2 m by 60 px and one at 20 m by 6. Here a placement is a change of the camera's
pose, linear in the image to first order, so that the spatial fit is again in closed form and each pair again a matrix.
The objective and the local search are those of :func:`match_lines`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.matching.fit import POSE_STEP
from knowledge_sources.methods.matching.objective import Terms, build_likelihood_terms
from knowledge_sources.methods.matching.pose_pairs import (
    LineScene,
    PosePairs,
    build_scene,
    find_allowed_pairs,
    find_near_pairs,
    keep_longest,
    linearise_pairs,
    project_model,
)
from knowledge_sources.methods.matching.pose_parameters import (
    PoseParameters,
    build_camera_parameters,
    build_floor_parameters,
)
from knowledge_sources.methods.matching.pose_starts import find_start_poses
from knowledge_sources.methods.matching.search import (
    PairSpace,
    SearchResult,
    build_masks,
    choose_nearest,
    compute_coverage,
    evaluate_state,
    fit_state,
    list_pairs,
    search_pairs,
)
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.matching import MatchingSettings
from world_models.camera import Camera
from world_models.frames import Pose, Pose2


@dataclass(frozen=True, slots=True, eq=False)
class PoseMatch:
    """The best correspondence and the camera pose that it gives.

    Attributes:
        pairs: (p, 2) model index, data index, sorted; many data lines may go to one model line.
        camera_from_world: the pose of the best fit; a pose solver refines it.
        e_fit, e_omission: the two terms of the match error. coverage: (m,) share of each model line that data cover.
        residuals_px: (p, 2) distances of the paired data ends to the model lines at that pose, to first order.
    """

    pairs: Indices
    camera_from_world: Pose
    e_fit: float
    e_omission: float
    coverage: Floats
    residuals_px: Floats

    @property
    def e_match(self) -> float:
        """The match error: smaller is better."""
        return self.e_fit + self.e_omission


@dataclass(frozen=True, slots=True, eq=False)
class FloorMatch(PoseMatch):
    """The best correspondence and the robot pose ``world_from_robot`` that it gives; a planar solver refines it."""

    world_from_robot: Pose2


def match_on_floor(
    model_lines_world: Any,
    data_px: Any,
    camera: Camera,
    camera_from_robot: Pose,
    prior: Pose2,
    prior_covariance: Any,
    settings: MatchingSettings = DEFAULT.matching,
) -> FloorMatch:
    """Match model lines to data lines within what the prior of a robot on the floor allows.

    Args:
        model_lines_world: (m, 2, 3) the pieces visible from about the prior [m].
        data_px: (k, 2, 2) as the lens shows them.
        camera_from_robot: the mount. prior, prior_covariance: ``world_from_robot`` and (3, 3) of (x, y, heading).

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    parameters = build_floor_parameters(camera_from_robot, prior, prior_covariance)
    match = _match(
        model_lines_world, data_px, camera, parameters, settings.max_pose_pair_px, settings.pose_sigma_px, settings
    )
    return FloorMatch(
        match.pairs, match.camera_from_world, match.e_fit, match.e_omission, match.coverage, match.residuals_px,
        parameters.compute_robot_pose(match.camera_from_world),
    )


def match_in_space(
    model_lines_world: Any,
    data_px: Any,
    camera: Camera,
    prior: Pose,
    prior_covariance: Any,
    settings: MatchingSettings = DEFAULT.matching,
    *,
    pair_px: float | None = None,
    sigma_px: float | None = None,
) -> PoseMatch:
    """Match model lines to data lines within what the prior of a camera with six unknowns allows.

    Args:
        model_lines_world: (m, 2, 3) the pieces visible from about the prior [m].
        data_px: (k, 2, 2) as the lens shows them.
        prior, prior_covariance: ``camera_from_world`` and (6, 6) of its left perturbation (rotation, translation).
        pair_px, sigma_px: in place of ``settings.max_pose_pair_px`` and ``settings.pose_sigma_px``.

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    parameters = build_camera_parameters(prior, prior_covariance)
    pair_px = settings.max_pose_pair_px if pair_px is None else pair_px
    sigma_px = settings.pose_sigma_px if sigma_px is None else sigma_px
    return _match(model_lines_world, data_px, camera, parameters, pair_px, sigma_px, settings)


def _match(
    model_lines_world: Any, data_px: Any, camera: Camera, parameters: PoseParameters, pair_px: float,
    sigma_px: float, settings: MatchingSettings,
) -> PoseMatch:
    """Match model lines (m, 2, 3) to data lines (k, 2, 2).

    Pairs that the prior allows vote by a robust fit from starts all over the prior; the best poses are searched as
    :func:`match_lines` does, under its objective "likelihood" with the prior as one more term.
    """
    scene = build_scene(model_lines_world, data_px, camera, parameters)
    lengths = project_model(scene, parameters.prior)[1]
    terms = build_likelihood_terms(lengths, len(scene.data), sigma_px, pair_px, settings)
    wide = keep_longest(find_allowed_pairs(scene, settings), settings.max_allowed_pairs)
    tries = []
    for pose in find_start_poses(scene, keep_longest(wide, settings.max_start_pairs), settings):
        pairs = linearise_pairs(scene, pose, wide.model, wide.data)
        pairs = pairs.take(find_near_pairs(pairs, pair_px, settings.max_pose_pair_rad))
        pairs = keep_longest(pairs, settings.max_near_pairs)
        space, first = _build_space(scene, pose, pairs, pair_px, sigma_px, settings)
        result = search_pairs(space, terms, first, settings, strategy="steepest", exchange=True, keep_trace=False)
        tries.append((space, pairs, pose, result))
    space, pairs, pose, result = min(tries, key=lambda tried: tried[3].error)
    return _build_match(scene, space, pairs, pose, result, terms)


def _build_space(
    scene: LineScene, pose: Pose, pairs: PosePairs, pair_px: float, sigma_px: float, settings: MatchingSettings
) -> tuple[PairSpace, Mask]:
    """The restricted space at a pose, forms in (step, 1), the prior as anchor; and the state to start from."""
    parameters = scene.parameters
    rows = np.concatenate([pairs.slopes, pairs.distances[..., None]], axis=-1) / (np.sqrt(2.0) * sigma_px)
    prior = np.concatenate([np.eye(len(parameters.root)), parameters.compute_step(pose)[:, None]], axis=1)
    space = PairSpace(
        members=np.arange(len(pairs.model)),
        model=pairs.model,
        data=pairs.data,
        forms=np.swapaxes(rows, 1, 2) @ rows,
        masks=build_masks(pairs.along, pairs.lengths, settings.coverage_cells),
        lines=len(scene.model),
        anchor=0.5 * prior.T @ parameters.information @ prior,
        fitting=POSE_STEP,
    )
    distances = np.sqrt(np.mean(pairs.distances**2, axis=1))
    return space, choose_nearest(pairs.data, distances, distances <= 0.5 * pair_px)


def _build_match(
    scene: LineScene, space: PairSpace, pairs: PosePairs, pose: Pose, result: SearchResult, terms: Terms
) -> PoseMatch:
    fit = fit_state(space, result.chosen)
    step = fit.placements[0]
    rows, chosen = list_pairs(space, result.chosen)
    return PoseMatch(
        pairs=chosen,
        camera_from_world=scene.parameters.move(pose, step),
        e_fit=float(fit.errors[0]),
        e_omission=evaluate_state(space, terms, result.chosen) - float(fit.errors[0]),
        coverage=compute_coverage(space, result.chosen),
        residuals_px=pairs.distances[rows] + pairs.slopes[rows] @ step,
    )
