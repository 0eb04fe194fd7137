"""Matching with the floor's own three unknowns: for errors that perspective makes no 2D motion of the model (§6.1).

The paper's matcher moves the projected model rigidly in the image. Close to the camera that is not how it moves: a
pose error of 0.3 m shifts a line at 2 m by 60 px and one at 20 m by 6. Here a placement is a change of (x, y,
heading), linear in the image to first order, so the spatial fit is again closed and each pair again a matrix; the
objective and the local search are those of :func:`match_lines`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.matching_fit import Fits
from knowledge_sources.methods.matching_floor_pairs import (
    Array,
    FloorPairs,
    FloorScene,
    Index,
    Mask,
    floor_scene,
    gated_pairs,
    near_pairs,
    pairs_at,
    projected_lengths,
    taken,
)
from knowledge_sources.methods.matching_floor_settle import settled_places
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
from knowledge_sources.methods.pose.planar import pose2
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

COVER_CELLS = 48
"""Cells along a model line by which its coverage is counted."""


@dataclass(frozen=True, slots=True, eq=False)
class FloorMatch:
    """The best correspondence and where it puts the robot.

    Attributes:
        pairs: (p, 2) model index, data index, sorted; many data lines may go to one model line.
        world_from_robot: the pose of the best fit; refine it with :func:`planar_from_lines`.
        e_fit, e_omission: the two terms of the match error. coverage: (m,) share of each model line accounted for.
        residuals_px: (p, 2) distances of the paired data ends to the model lines at that pose, to first order.
    """

    pairs: Index
    world_from_robot: Pose2
    e_fit: float
    e_omission: float
    coverage: Array
    residuals_px: Array

    @property
    def e_match(self) -> float:
        """The match error: smaller is better."""
        return self.e_fit + self.e_omission


def match_on_floor(
    model_lines_world: Any,
    data_px: Any,
    camera: Camera,
    camera_from_robot: Pose,
    prior: Pose2,
    prior_covariance: Any,
    *,
    pair_px: float = 5.0,
    pair_rad: float = 0.15,
    sigma_px: float = 1.5,
    chance_exponent: float = 3.0,
    chance_px: float = 10.0,
) -> FloorMatch:
    """Match model lines to data lines within what the prior allows.

    Pairs within 3 deviations of the prediction vote by a robust fit from a grid of starts; the best places are
    searched as :func:`match_lines` does, under its objective "likelihood" with the prior as one more term.

    Args:
        model_lines_world: (m, 2, 3) the pieces visible from about the prior [m]. data_px: (k, 2, 2) as seen.
        camera_from_robot: the mount. prior, prior_covariance: ``world_from_robot`` and (3, 3) of (x, y, heading).
        pair_px, pair_rad: the restricted space round a place. sigma_px: of a data end about its model line.
        chance_exponent, chance_px: see :func:`likelihood_terms`.
    """
    scene = floor_scene(model_lines_world, data_px, camera, camera_from_robot, prior, prior_covariance)
    lengths_px, _ = projected_lengths(scene, scene.mean)
    terms = likelihood_terms(lengths_px, len(scene.data), sigma_px, chance_exponent, chance_px, pair_px)
    wide = gated_pairs(scene)
    tries = []
    for state in settled_places(scene, wide):
        pairs = pairs_at(scene, state, wide.model, wide.data)
        pairs = taken(pairs, near_pairs(pairs, pair_px, pair_rad))
        space, first = _space(scene, state, pairs, sigma_px, pair_px)
        found = local_search(space, terms, first, strategy="steepest", replace=True, keep_trace=False)
        tries.append((space, pairs, state, found))
    space, pairs, state, found = min(tries, key=lambda tried: tried[3].error)
    return _floor_match(space, pairs, state, found, terms)


def _space(
    scene: FloorScene, state: Array, pairs: FloorPairs, sigma_px: float, pair_px: float
) -> tuple[PairSpace, Mask]:
    """The restricted space at a state: forms in (dx, dy, dheading, 1), the prior as anchor."""
    rows = np.concatenate([pairs.slopes, pairs.distances[..., None]], axis=-1) / (np.sqrt(2.0) * sigma_px)
    away = (state - scene.mean)[:, None]
    prior = np.concatenate([np.eye(3), away], axis=1)
    cells = (np.arange(COVER_CELLS) + 0.5) / COVER_CELLS * pairs.lengths[:, None]
    space = PairSpace(
        members=np.arange(len(pairs.model)),
        model=pairs.model,
        data=pairs.data,
        forms=np.swapaxes(rows, 1, 2) @ rows,
        masks=(cells >= pairs.along.min(axis=1)[:, None]) & (cells <= pairs.along.max(axis=1)[:, None]),
        lines=len(scene.model),
        anchor=0.5 * prior.T @ scene.information @ prior,
        fit=_floor_fits,
    )
    distances = np.sqrt(np.mean(pairs.distances**2, axis=1))
    return space, nearest(pairs.data, distances, distances <= 0.5 * pair_px)


def _floor_fits(forms: Array) -> Fits:
    """Minimise k forms (k, 4, 4) over the first three of (dx, dy, dheading, 1)."""
    hessian, pull = forms[:, :3, :3], forms[:, :3, 3:]
    steps = -np.linalg.solve(hessian, pull)
    errors = forms[:, 3, 3] + np.sum(pull * steps, axis=(1, 2))
    return Fits(np.maximum(errors, 0.0), np.asarray(steps[..., 0], np.float64))


def _floor_match(space: PairSpace, pairs: FloorPairs, state: Array, found: Found, terms: Terms) -> FloorMatch:
    fit = fit_of(space, found.chosen)
    covered = coverage(space, found.chosen)
    chosen = np.flatnonzero(found.chosen)
    chosen = chosen[np.lexsort((space.data[chosen], space.model[chosen]))]
    return FloorMatch(
        pairs=np.stack([space.model[chosen], space.data[chosen]], axis=1),
        world_from_robot=pose2(state + fit.placements[0]),
        e_fit=float(fit.errors[0]),
        e_omission=evaluate(space, terms, found.chosen) - float(fit.errors[0]),
        coverage=covered,
        residuals_px=pairs.distances[chosen] + pairs.slopes[chosen] @ fit.placements[0],
    )
