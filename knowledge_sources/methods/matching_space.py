"""Matching with all six unknowns of the camera: for errors that perspective makes no 2D motion of the model (§6.1).

:func:`match_lines` moves the projected model rigidly in the image, :func:`match_on_floor` by what a robot on a floor
can do. Here a placement is a change of the camera's pose, linear in the image to first order, so the spatial fit is
again closed and each pair again a matrix; the objective and the local search are those of :func:`match_lines`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.matching_fit import Fits
from knowledge_sources.methods.matching_objective import Terms, likelihood_terms
from knowledge_sources.methods.matching_search import (
    Found,
    PairSpace,
    coverage,
    evaluate,
    fit_of,
    local_search,
    nearest,
)
from knowledge_sources.methods.matching_space_pairs import (
    Array,
    Index,
    Mask,
    SpacePairs,
    SpaceScene,
    away,
    gated_pairs,
    near_pairs,
    pairs_at,
    projected,
    space_scene,
)
from knowledge_sources.methods.matching_space_settle import settled_poses
from world_models.camera import Camera
from world_models.frames import Pose

COVER_CELLS = 48
"""Cells along a model line by which its coverage is counted."""


@dataclass(frozen=True, slots=True, eq=False)
class SpaceMatch:
    """The best correspondence and where it puts the camera.

    Attributes:
        pairs: (p, 2) model index, data index, sorted; many data lines may go to one model line.
        camera_from_world: the pose of the best fit; refine it with :func:`med_r_and_t` or :func:`trunc_r_and_t`.
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


def match_in_space(
    model_lines_world: Any,
    data_px: Any,
    camera: Camera,
    prior: Pose,
    prior_covariance: Any,
    *,
    pair_px: float = 5.0,
    pair_rad: float = 0.15,
    sigma_px: float = 1.5,
    chance_exponent: float = 3.0,
    chance_px: float = 10.0,
) -> SpaceMatch:
    """Match model lines to data lines within what the prior allows.

    Pairs within 3 deviations of the prediction vote by a robust fit from starts all over the prior; the best places
    are searched as :func:`match_lines` does, under its objective "likelihood" with the prior as one more term.

    Args:
        model_lines_world: (m, 2, 3) the pieces visible from about the prior [m]. data_px: (k, 2, 2) as seen.
        prior, prior_covariance: ``camera_from_world`` and (6, 6) of its left perturbation (rotation, translation).
        pair_px, pair_rad: the restricted space round a place. sigma_px: of a data end about its model line.
        chance_exponent, chance_px: see :func:`likelihood_terms`.
    """
    scene = space_scene(model_lines_world, data_px, camera, prior, prior_covariance)
    lengths_px = projected(scene, prior)[1]
    terms = likelihood_terms(lengths_px, len(scene.data), sigma_px, chance_exponent, chance_px, pair_px)
    wide = gated_pairs(scene)
    tries = []
    for pose in settled_poses(scene, wide):
        pairs = pairs_at(scene, pose, wide.model, wide.data)
        pairs = pairs.take(near_pairs(pairs, pair_px, pair_rad))
        space, first = _space(scene, pose, pairs, sigma_px, pair_px)
        found = local_search(space, terms, first, strategy="steepest", replace=True, keep_trace=False)
        tries.append((space, pairs, pose, found))
    space, pairs, pose, found = min(tries, key=lambda tried: tried[3].error)
    return _space_match(space, pairs, pose, found, terms)


def _space(
    scene: SpaceScene, pose: Pose, pairs: SpacePairs, sigma_px: float, pair_px: float
) -> tuple[PairSpace, Mask]:
    """The restricted space at a pose: forms in (its left perturbation, 1), the prior as anchor."""
    rows = np.concatenate([pairs.slopes, pairs.distances[..., None]], axis=-1) / (np.sqrt(2.0) * sigma_px)
    prior = np.concatenate([np.eye(6), away(scene, pose)[:, None]], axis=1)
    cells = (np.arange(COVER_CELLS) + 0.5) / COVER_CELLS * pairs.lengths[:, None]
    space = PairSpace(
        members=np.arange(len(pairs.model)),
        model=pairs.model,
        data=pairs.data,
        forms=np.swapaxes(rows, 1, 2) @ rows,
        masks=(cells >= pairs.along.min(axis=1)[:, None]) & (cells <= pairs.along.max(axis=1)[:, None]),
        lines=len(scene.model),
        anchor=0.5 * prior.T @ scene.information @ prior,
        fit=_space_fits,
    )
    distances = np.sqrt(np.mean(pairs.distances**2, axis=1))
    return space, nearest(pairs.data, distances, distances <= 0.5 * pair_px)


def _space_fits(forms: Array) -> Fits:
    """Minimise k forms (k, 7, 7) over the first six of (perturbation, 1)."""
    hessian, pull = forms[:, :6, :6], forms[:, :6, 6:]
    steps = -np.linalg.solve(hessian, pull)
    errors = forms[:, 6, 6] + np.sum(pull * steps, axis=(1, 2))
    return Fits(np.maximum(errors, 0.0), np.asarray(steps[..., 0], np.float64))


def _space_match(space: PairSpace, pairs: SpacePairs, pose: Pose, found: Found, terms: Terms) -> SpaceMatch:
    fit = fit_of(space, found.chosen)
    step = fit.placements[0]
    chosen = np.flatnonzero(found.chosen)
    chosen = chosen[np.lexsort((space.data[chosen], space.model[chosen]))]
    return SpaceMatch(
        pairs=np.stack([space.model[chosen], space.data[chosen]], axis=1),
        camera_from_world=pose.perturbed(step[:3], step[3:]),
        e_fit=float(fit.errors[0]),
        e_omission=evaluate(space, terms, found.chosen) - float(fit.errors[0]),
        coverage=coverage(space, found.chosen),
        residuals_px=pairs.distances[chosen] + pairs.slopes[chosen] @ step,
    )
