"""Matching with the floor's own three unknowns: for errors that perspective makes no 2D motion of the model (§6.1).

The paper's matcher moves the projected model rigidly in the image. Close to the camera that is not how it moves: a
pose error of 0.3 m shifts a line at 2 m by 60 px and one at 20 m by 6. Here a placement is a change of (x, y,
heading), linear in the image to first order, so the spatial fit is again closed and each pair again a matrix; the
objective and the local search are those of :func:`match_lines`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.matching_fit import Fits
from knowledge_sources.methods.matching_hough import undirected
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
from knowledge_sources.methods.pose.lines import LineSet, line_set
from knowledge_sources.methods.pose.planar import camera_states, line_jacobian, planar_prior, pose2
from world_models.camera import NEAR_M, Camera
from world_models.frames import Pose, Pose2

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

GATE_SIGMAS = 3.0
GATE_PX = 3.0
GATE_RAD = 0.12
"""Beyond what the prior allows, a pair may be off by this much: the segment's own error."""
GRID = (-2.0, -1.0, 0.0, 1.0, 2.0)
"""Starts along each axis of the prior, in its deviations."""
FIRST_WIDTHS_PX = (16.0, 12.0, 8.0)
LATER_WIDTHS_PX = (6.0, 4.0, 3.0, 2.0)
CLOSE_PX = 40.0
"""Pairs further than this from a place are left out when it is settled exactly."""
FINALISTS = 8
SEARCHED = 3
COVER_CELLS = 48


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


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """The call's givens: model and data lines, camera, mount and prior."""

    model: Array
    data: Array
    data_lines: LineSet
    camera: Camera
    mount: Pose
    mean: Array
    information: Array
    root: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """p pairs at a state: distances (p, 2) [px], slopes (p, 2, 3), along (p, 2) from 0 to ``lengths`` (p,) [px]."""

    model: Index
    data: Index
    distances: Array
    slopes: Array
    along: Array
    lengths: Array
    angles: Array
    shares: Array


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
    scene = _scene(model_lines_world, data_px, camera, camera_from_robot, prior, prior_covariance)
    lengths_px, _ = _projected_lengths(scene, scene.mean)
    terms = likelihood_terms(lengths_px, len(scene.data), sigma_px, chance_exponent, chance_px, pair_px)
    wide = _gated_pairs(scene)
    tries = []
    for state in _places(scene, wide):
        pairs = _pairs_at(scene, state, wide.model, wide.data)
        pairs = _take(pairs, _near(pairs, pair_px, pair_rad))
        space, first = _space(scene, state, pairs, sigma_px, pair_px)
        tries.append((space, pairs, state, local_search(space, terms, first, strategy="steepest", replace=True,
                                                         keep_trace=False)))
    space, pairs, state, found = min(tries, key=lambda tried: tried[3].error)
    return _floor_match(space, pairs, state, found, terms)


def _scene(model: Any, data: Any, camera: Camera, mount: Pose, prior: Pose2, covariance: Any) -> _Scene:
    belief = planar_prior(prior, covariance)
    data = np.asarray(data, float).reshape(-1, 2, 2)
    model = np.asarray(model, float).reshape(-1, 2, 3)
    if not len(model):
        raise ValueError("expected at least one model line, got none")
    data_lines = line_set(np.broadcast_to(model[:1], (len(data), 2, 3)), data, camera, 1.0)
    root = np.linalg.cholesky(np.linalg.inv(belief.information))
    pinhole = replace(camera, distortion=None)
    return _Scene(
        model, camera.undistort(data), data_lines, pinhole, mount, belief.mean, belief.information, root
    )


def _model_lines(scene: _Scene, rows: Index, columns: Index) -> LineSet:
    """Model lines ``rows`` paired with the data lines ``columns``."""
    span = scene.model[:, 1] - scene.model[:, 0]
    directions = span / np.linalg.norm(span, axis=1, keepdims=True)
    moments = np.cross(scene.model[:, 0], directions)
    seen = scene.data_lines.take(columns)
    return replace(seen, points=scene.model[rows], directions=directions[rows], moments=moments[rows])


def _projected(scene: _Scene, state: Array) -> tuple[Array, Mask]:
    """(m, 2, 2) model lines in the image plane, cut at the near plane but not at the border; whether any is left."""
    p = scene.model @ (turn := camera_states(state, scene.mount))[0].T + turn[1]
    z = p[..., 2]
    drop = np.where(np.abs(z[:, 1] - z[:, 0]) < 1e-9, 1.0, z[:, 1] - z[:, 0])
    cut = p[:, 0] + ((NEAR_M - z[:, 0]) / drop)[:, None] * (p[:, 1] - p[:, 0])
    behind = z < NEAR_M
    p = np.where(behind[..., None], cut[:, None, :], p)
    visible = ~behind.all(axis=1)
    p[~visible] = (0.0, 0.0, 1.0)
    return scene.camera.project(p), visible


def _projected_lengths(scene: _Scene, state: Array) -> tuple[Array, Mask]:
    px, visible = _projected(scene, state)
    return np.maximum(np.linalg.norm(px[:, 1] - px[:, 0], axis=1), 1.0), visible


def _gated_pairs(scene: _Scene) -> _Pairs:
    """Pairs within 3 deviations of the prediction, in offset at both ends and in angle."""
    px, visible = _projected(scene, scene.mean)
    span = px[:, 1] - px[:, 0]
    lengths = np.maximum(np.linalg.norm(span, axis=1), 1.0)
    angles = np.arctan2(span[:, 1], span[:, 0])
    data_span = scene.data[:, 1] - scene.data[:, 0]
    data_angles = np.arctan2(data_span[:, 1], data_span[:, 0])
    turn = np.abs(undirected(data_angles[None] - angles[:, None]))
    i, k = np.nonzero((turn <= 0.6) & visible[:, None])
    pairs = _pairs_at(scene, scene.mean, i, k)
    moved = pairs.slopes @ scene.root
    spread = np.sqrt(np.sum(moved**2, axis=-1))
    data_lengths = np.linalg.norm(data_span, axis=1)[k]
    turned = np.sqrt(np.sum((moved[:, 1] - moved[:, 0]) ** 2, axis=-1)) / np.maximum(data_lengths, 1.0)
    near = np.all(np.abs(pairs.distances) <= GATE_SIGMAS * spread + GATE_PX, axis=1)
    near &= turn[i, k] <= GATE_SIGMAS * turned + GATE_RAD
    reach = GATE_SIGMAS * spread.max(axis=1) + 30.0
    near &= (pairs.along.max(axis=1) >= -reach) & (pairs.along.min(axis=1) <= lengths[i] + reach)
    return _take(pairs, near)


def _pairs_at(scene: _Scene, state: Array, i: Index, k: Index) -> _Pairs:
    lines = _model_lines(scene, i, k)
    distances, slopes = line_jacobian(lines.points[:, 0], lines.directions, lines, state, scene.mount)
    px, _ = _projected(scene, state)
    span = px[:, 1] - px[:, 0]
    lengths = np.maximum(np.linalg.norm(span, axis=1), 1.0)
    units = span / lengths[:, None]
    along = np.sum((scene.data[k] - px[i, 0][:, None, :]) * units[i][:, None, :], axis=-1)
    data_span = scene.data[k, 1] - scene.data[k, 0]
    angles = undirected(np.arctan2(data_span[:, 1], data_span[:, 0]) - np.arctan2(units[i, 1], units[i, 0]))
    shares = np.minimum(np.linalg.norm(data_span, axis=1), lengths[i])
    return _Pairs(i, k, distances, slopes, along, lengths[i], angles, shares)


def _take(pairs: _Pairs, chosen: Mask) -> _Pairs:
    return _Pairs(*(getattr(pairs, name)[chosen] for name in _Pairs.__slots__))


def _near(pairs: _Pairs, pair_px: float, pair_rad: float) -> Mask:
    near = (np.abs(pairs.distances).max(axis=1) <= pair_px) & (np.abs(pairs.angles) <= pair_rad)
    beside = (pairs.along.max(axis=1) < -pair_px) | (pairs.along.min(axis=1) > pairs.lengths + pair_px)
    return np.asarray(near & ~beside)


def _places(scene: _Scene, wide: _Pairs) -> list[Array]:
    """States to search from: a grid over the prior, settled, the best settled again at their own places."""
    axes = np.stack(np.meshgrid(GRID, GRID, GRID, indexing="ij"), axis=-1).reshape(-1, 3)
    if not len(wide.model):
        return [scene.mean]
    steps, support = _settled(wide, axes @ scene.root.T, scene.information, np.zeros(3), FIRST_WIDTHS_PX)
    steps = steps[_distinct(steps, support, FINALISTS, scene)]
    places, scores = [], []
    for step in steps:
        state = scene.mean + step
        close = np.abs(wide.distances + wide.slopes @ step).max(axis=1) < CLOSE_PX
        for widths in (LATER_WIDTHS_PX, LATER_WIDTHS_PX[-2:]):
            pairs = _pairs_at(scene, state, wide.model[close], wide.data[close])
            more, score = _settled(pairs, np.zeros((1, 3)), scene.information, state - scene.mean, widths)
            state = state + more[0]
        places.append(state)
        scores.append(float(score[0]))
    states = np.stack(places)
    return [states[i] for i in _distinct(states, np.array(scores), SEARCHED, scene)]


def _distinct(states: Array, scores: Array, count: int, scene: _Scene) -> list[int]:
    """The best ``count`` that differ by more than a twentieth of the prior's deviation."""
    whitened = states @ np.linalg.inv(scene.root).T
    kept: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        if all(np.abs(whitened[i] - whitened[j]).max() > 0.05 for j in kept):
            kept.append(int(i))
        if len(kept) == count:
            break
    return kept


def _settled(
    pairs: _Pairs, steps: Array, information: Array, offset: Array, widths: tuple[float, ...]
) -> tuple[Array, Array]:
    """Steps (s, 3) moved to where close pairs agree, to first order, and their support (s,) [px of model line]."""
    slopes = pairs.slopes.reshape(-1, 3)
    rests = pairs.distances.reshape(-1)
    squares = np.einsum("pea,peb->pab", pairs.slopes, pairs.slopes).reshape(-1, 9)
    pulls = np.einsum("pea,pe->pa", pairs.slopes, pairs.distances)
    for width in widths:
        closeness = _closeness(steps @ slopes.T + rests, width)
        weights = closeness**2 * (pairs.shares / 20.0) / width**2
        hessian = (weights @ squares).reshape(-1, 3, 3) + information
        gradient = weights @ pulls + information @ offset
        steps = -np.linalg.solve(hessian, gradient[..., None])[..., 0]
    closeness = _closeness(steps @ slopes.T + rests, widths[-1])
    beside = (pairs.along.max(axis=1) < -20.0) | (pairs.along.min(axis=1) > pairs.lengths + 20.0)
    return steps, _support(pairs, np.where(beside, 0.0, closeness) * pairs.shares)


def _closeness(distances: Array, width: float) -> Array:
    """(s, p) from 1, on the model line, to 0; distances (s, 2 p)."""
    square = distances * distances
    return np.asarray(1.0 / (1.0 + (square[:, 0::2] + square[:, 1::2]) * (0.5 / width**2)))


def _support(pairs: _Pairs, found: Array) -> Array:
    """(s,) model length that close data account for, each model line at most its own."""
    count = int(pairs.model.max(initial=0)) + 1
    belongs = np.zeros((len(pairs.model), count))
    belongs[np.arange(len(pairs.model)), pairs.model] = 1.0
    full = np.zeros(count)
    full[pairs.model] = pairs.lengths
    return np.asarray(np.minimum(found @ belongs, full).sum(axis=1))


def _space(scene: _Scene, state: Array, pairs: _Pairs, sigma_px: float, pair_px: float) -> tuple[PairSpace, Mask]:
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
    return Fits(np.maximum(errors, 0.0), steps[..., 0])


def _floor_match(space: PairSpace, pairs: _Pairs, state: Array, found: Found, terms: Terms) -> FloorMatch:
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
