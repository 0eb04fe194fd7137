"""Matching with a camera's own unknowns: for errors that perspective makes no 2D motion of the model (§6.1).

The paper's matcher moves the projected model rigidly in the image. Close to the camera that is not how it moves: a
pose error of 0.3 m shifts a line at 2 m by 60 px and one at 20 m by 6. Here a placement is a change of the camera's
pose, linear in the image to first order, so the spatial fit is again closed and each pair again a matrix; the objective
and the local search are those of :func:`match_lines`. How the pose may change is a :class:`PoseParameters`:
:func:`match_on_floor` and :func:`match_in_space` give one each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.matching.fit import STEPS
from knowledge_sources.methods.matching.objective import Terms, likelihood_terms
from knowledge_sources.methods.matching.pose_pairs import (
    Index,
    LineScene,
    Mask,
    PosePairs,
    build_scene,
    gated_pairs,
    linearise_pairs,
    near_pairs,
    projected,
)
from knowledge_sources.methods.matching.pose_parameters import (
    Array,
    PoseParameters,
    build_camera_parameters,
    build_floor_parameters,
)
from knowledge_sources.methods.matching.pose_starts import settled_poses
from knowledge_sources.methods.matching.search import (
    Found,
    PairSpace,
    coverage,
    evaluate,
    fit_of,
    local_search,
    nearest,
)
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

COVER_CELLS = 48
"""Cells along a model line by which its coverage is counted."""


@dataclass(frozen=True, slots=True)
class Tuning:
    """What the matcher is told of the lines.

    Attributes:
        pair_px, pair_rad: the restricted space round a place. sigma_px: of a data end about its model line.
        chance_exponent, chance_px: see :func:`likelihood_terms`.
    """

    pair_px: float = 5.0
    pair_rad: float = 0.15
    sigma_px: float = 1.5
    chance_exponent: float = 3.0
    chance_px: float = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class PoseMatch:
    """The best correspondence and where it puts the camera.

    Attributes:
        pairs: (p, 2) model index, data index, sorted; many data lines may go to one model line.
        camera_from_world: the pose of the best fit; a pose solver refines it.
        e_fit, e_omission: the two terms of the match error. coverage: (m,) share of each model line accounted for.
        residuals_px: (p, 2) distances of the paired data ends to the model lines at that pose, to first order.
    """

    pairs: Index
    camera_from_world: Pose
    e_fit: float
    e_omission: float
    coverage: Array
    residuals_px: Array

    @property
    def e_match(self) -> float:
        """The match error: smaller is better."""
        return self.e_fit + self.e_omission


@dataclass(frozen=True, slots=True, eq=False)
class FloorMatch(PoseMatch):
    """The best correspondence and where it puts the robot, ``world_from_robot``: refine it with a planar solver."""

    world_from_robot: Pose2


def match_on_floor(
    model_lines_world: Any,
    data_px: Any,
    camera: Camera,
    camera_from_robot: Pose,
    prior: Pose2,
    prior_covariance: Any,
    **tuning: float,
) -> FloorMatch:
    """Match model lines to data lines within what the prior allows; see :func:`match_posed`.

    Args:
        model_lines_world: (m, 2, 3) the pieces visible from about the prior [m]. data_px: (k, 2, 2) as seen.
        camera_from_robot: the mount. prior, prior_covariance: ``world_from_robot`` and (3, 3) of (x, y, heading).
        tuning: see :class:`Tuning`.

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    freedom = build_floor_parameters(camera_from_robot, prior, prior_covariance)
    found = match_posed(model_lines_world, data_px, camera, freedom, Tuning(**tuning))
    return FloorMatch(
        found.pairs, found.camera_from_world, found.e_fit, found.e_omission, found.coverage, found.residuals_px,
        freedom.robot(found.camera_from_world),
    )


def match_in_space(
    model_lines_world: Any,
    data_px: Any,
    camera: Camera,
    prior: Pose,
    prior_covariance: Any,
    **tuning: float,
) -> PoseMatch:
    """Match model lines to data lines within what the prior allows; see :func:`match_posed`.

    Args:
        model_lines_world: (m, 2, 3) the pieces visible from about the prior [m]. data_px: (k, 2, 2) as seen.
        prior, prior_covariance: ``camera_from_world`` and (6, 6) of its left perturbation (rotation, translation).
        tuning: see :class:`Tuning`.

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    freedom = build_camera_parameters(prior, prior_covariance)
    return match_posed(model_lines_world, data_px, camera, freedom, Tuning(**tuning))


def match_posed(
    model_lines_world: Any, data_px: Any, camera: Camera, freedom: PoseParameters, tuning: Tuning
) -> PoseMatch:
    """Match model lines (m, 2, 3) to data lines (k, 2, 2) within what the prior allows.

    Pairs within 3 deviations of the prediction vote by a robust fit from starts all over the prior; the best places
    are searched as :func:`match_lines` does, under its objective "likelihood" with the prior as one more term.
    """
    scene = build_scene(model_lines_world, data_px, camera, freedom)
    terms = likelihood_terms(
        projected(scene, freedom.prior)[1], len(scene.data), tuning.sigma_px, tuning.chance_exponent, tuning.chance_px,
        tuning.pair_px,
    )
    wide = gated_pairs(scene)
    tries = []
    for pose in settled_poses(scene, wide):
        pairs = linearise_pairs(scene, pose, wide.model, wide.data)
        pairs = pairs.take(near_pairs(pairs, tuning.pair_px, tuning.pair_rad))
        space, first = _space(scene, pose, pairs, tuning)
        found = local_search(space, terms, first, strategy="steepest", replace=True, keep_trace=False)
        tries.append((space, pairs, pose, found))
    space, pairs, pose, found = min(tries, key=lambda tried: tried[3].error)
    return _match(scene, space, pairs, pose, found, terms)


def _space(scene: LineScene, pose: Pose, pairs: PosePairs, tuning: Tuning) -> tuple[PairSpace, Mask]:
    """The restricted space at a pose: forms in (step, 1), the prior as anchor."""
    freedom = scene.freedom
    rows = np.concatenate([pairs.slopes, pairs.distances[..., None]], axis=-1) / (np.sqrt(2.0) * tuning.sigma_px)
    prior = np.concatenate([np.eye(len(freedom.root)), freedom.away(pose)[:, None]], axis=1)
    cells = (np.arange(COVER_CELLS) + 0.5) / COVER_CELLS * pairs.lengths[:, None]
    space = PairSpace(
        members=np.arange(len(pairs.model)),
        model=pairs.model,
        data=pairs.data,
        forms=np.swapaxes(rows, 1, 2) @ rows,
        masks=(cells >= pairs.along.min(axis=1)[:, None]) & (cells <= pairs.along.max(axis=1)[:, None]),
        lines=len(scene.model),
        anchor=0.5 * prior.T @ freedom.information @ prior,
        fitting=STEPS,
    )
    distances = np.sqrt(np.mean(pairs.distances**2, axis=1))
    return space, nearest(pairs.data, distances, distances <= 0.5 * tuning.pair_px)


def _match(
    scene: LineScene, space: PairSpace, pairs: PosePairs, pose: Pose, found: Found, terms: Terms
) -> PoseMatch:
    fit = fit_of(space, found.chosen)
    step = fit.placements[0]
    chosen = np.flatnonzero(found.chosen)
    chosen = chosen[np.lexsort((space.data[chosen], space.model[chosen]))]
    return PoseMatch(
        pairs=np.stack([space.model[chosen], space.data[chosen]], axis=1),
        camera_from_world=scene.freedom.moved(pose, step),
        e_fit=float(fit.errors[0]),
        e_omission=evaluate(space, terms, found.chosen) - float(fit.errors[0]),
        coverage=coverage(space, found.chosen),
        residuals_px=pairs.distances[chosen] + pairs.slopes[chosen] @ step,
    )
