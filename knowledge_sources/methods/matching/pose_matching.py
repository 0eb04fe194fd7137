"""Matching with a camera's own unknowns: for errors that perspective does not show as a 2D motion (§6.1).

The paper's matcher moves the projected model rigidly in the image. Close to the camera that is not how it moves: a
pose error of 0.3 m shifts a line at 2 m by 60 px and one at 20 m by 6. Here a placement is a change of the camera's
pose, linear in the image to first order, so that the spatial fit is again in closed form and each pair again a matrix.
The objective and the local search are those of :func:`match_lines`. Starts lie all over the prior, refined by a robust
loss.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.matching.image_matching import COVERAGE_CELLS
from knowledge_sources.methods.matching.pose_pairs import (
    LineScene,
    PosePairs,
    PoseParameters,
    Widths,
    build_camera_parameters,
    build_floor_parameters,
    build_scene,
    find_allowed_pairs,
    find_near_pairs,
    keep_longest,
    linearise_pairs,
    project_model,
)
from knowledge_sources.methods.matching.search import (
    POSE_STEP,
    PairSpace,
    SearchResult,
    Terms,
    build_likelihood_terms,
    build_masks,
    choose_nearest,
    compute_coverage,
    evaluate_state,
    fit_state,
    list_pairs,
    search_pairs,
)
from knowledge_sources.settings import DEFAULT, MatchingSettings
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

MAX_POSE_PAIR_PX = 5.0  # px; largest distance of a data end from its model line at a pose
MAX_POSE_PAIR_RAD = 0.15  # rad; largest angle between a data line and its model line at a pose
POSE_SIGMA_PX = 1.5  # px; standard deviation of a data end across its model line
LAST_WIDTHS_PX = (6.0, 4.0, 3.0, 2.0)  # px; widths by which the best of them are refined at their own poses
MAX_WIDTH_RATIO = 5.0  # pairs further than this many widths (root mean square) do not pull
MAX_REFINED_PAIR_PX = 40.0  # px; pairs further than this from a pose are left out when it is refined
UNIT_LENGTH_PX = 20.0  # px; a pair of this length weighs like one measurement
MAX_BESIDE_PX = 20.0  # px; a data line further than this beyond a model line's end supports nothing
POSE_FINALISTS = 8  # starts that are refined at their own poses
MAX_POSE_STARTS = 4  # poses that are searched from
MIN_POSE_DIFFERENCE_SIGMAS = 0.05  # poses nearer to each other than this, in the prior's deviations, are one


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
        model_lines_world, data_px, camera, parameters, MAX_POSE_PAIR_PX, POSE_SIGMA_PX, settings
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
        pair_px, sigma_px: in place of ``MAX_POSE_PAIR_PX`` and ``POSE_SIGMA_PX``.

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    parameters = build_camera_parameters(prior, prior_covariance)
    pair_px = MAX_POSE_PAIR_PX if pair_px is None else pair_px
    sigma_px = POSE_SIGMA_PX if sigma_px is None else sigma_px
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
    wide = keep_longest(find_allowed_pairs(scene), settings.max_allowed_pairs)
    tries = []
    for pose in find_start_poses(scene, keep_longest(wide, settings.max_start_pairs)):
        pairs = linearise_pairs(scene, pose, wide.model, wide.data)
        pairs = pairs.take(find_near_pairs(pairs, pair_px, MAX_POSE_PAIR_RAD))
        pairs = keep_longest(pairs, settings.max_near_pairs)
        space, first = _build_space(scene, pose, pairs, pair_px, sigma_px)
        result = search_pairs(space, terms, first, settings, strategy="steepest", exchange=True, keep_trace=False)
        tries.append((space, pairs, pose, result))
    space, pairs, pose, result = min(tries, key=lambda tried: tried[3].error)
    return _build_match(scene, space, pairs, pose, result, terms)


def _build_space(
    scene: LineScene, pose: Pose, pairs: PosePairs, pair_px: float, sigma_px: float
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
        masks=build_masks(pairs.along, pairs.lengths, COVERAGE_CELLS),
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


compiled = njit(cache=True, error_model="numpy")


def find_start_poses(scene: LineScene, wide: PosePairs) -> list[Pose]:
    """Poses to search from, best supported first.

    Starts all over the prior are refined to first order, by iteratively reweighted least squares on Geman and
    McClure's loss with a narrowing width (graduated non-convexity); the best, linearised at their own poses, again.

    Args:
        wide: the pairs that the prior allows, linearised at the prior.
    """
    parameters = scene.parameters
    if not len(wide.model):
        return [parameters.prior]
    reach_px = np.median(np.sqrt(np.mean((wide.slopes @ parameters.root) ** 2, axis=1)), axis=0)
    starts = parameters.list_starts(reach_px) @ parameters.root.T
    steps, support = _refine_steps(
        wide, starts, parameters.information, np.zeros(starts.shape[1]), parameters.get_widths()
    )
    poses = [
        parameters.move(parameters.prior, steps[i])
        for i in _select_distinct(steps, support, POSE_FINALISTS, scene)
    ]
    widths, size = LAST_WIDTHS_PX, parameters.widths_per_linearisation
    groups = [widths[i : i + size] for i in range(0, len(widths), size)]
    exact = [_refine_pose(scene, wide, pose, groups) for pose in poses]
    reached = np.stack([parameters.compute_step(pose) for pose, _ in exact])
    scores = np.array([score for _, score in exact])
    best = _select_distinct(reached, scores, MAX_POSE_STARTS, scene)
    return [_refine_pose(scene, wide, exact[i][0], [groups[-1][-2:]])[0] for i in best]


def _refine_pose(
    scene: LineScene, wide: PosePairs, pose: Pose, groups: list[Widths]
) -> tuple[Pose, float]:
    """A pose refined with the pairs linearised there, anew for each group of widths; and its support."""
    parameters, support = scene.parameters, 0.0
    for group in groups:
        pairs = linearise_pairs(scene, pose, wide.model, wide.data)
        pairs = pairs.take(np.abs(pairs.distances).max(axis=1) < MAX_REFINED_PAIR_PX)
        if not len(pairs.model):
            break
        still = np.zeros((1, len(parameters.root)))
        offset = parameters.compute_step(pose)
        steps, supports = _refine_steps(pairs, still, parameters.information, offset, group)
        pose, support = parameters.move(pose, steps[0]), float(supports[0])
    return pose, support


def _select_distinct(
    steps: Floats, scores: Floats, count: int, scene: LineScene
) -> list[int]:
    """The best ``count`` of the steps (s, d) that differ, in the prior's deviations (non-maximum suppression)."""
    whitened = steps @ np.linalg.inv(scene.parameters.root).T
    free = np.ones(len(steps), np.bool_)
    kept: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        if free[i]:
            kept.append(int(i))
            free &= np.abs(whitened - whitened[i]).max(axis=1) > MIN_POSE_DIFFERENCE_SIGMAS
        if len(kept) == count:
            break
    return kept


def _refine_steps(
    pairs: PosePairs, steps: Floats, information: Floats, offset: Floats, widths: Widths
) -> tuple[Floats, Floats]:
    """Steps (s, d) moved to where close pairs agree, to first order, and their support (s,) [px of model line].

    ``information`` (d, d) is the prior's, ``offset`` (d,) the step from the prior to where the pairs are linearised.
    """
    max_square = MAX_WIDTH_RATIO**2
    moved: Floats = _reweight(
        pairs.distances, pairs.slopes, pairs.shares, np.array(steps), information, offset, np.array(widths),
        UNIT_LENGTH_PX, max_square,
    )
    support: Floats = _compute_support(
        pairs.model, pairs.distances, pairs.slopes, pairs.along, pairs.lengths, pairs.shares, moved, widths[-1],
        MAX_BESIDE_PX, max_square,
    )
    return moved, support


@compiled
def _reweight(
    distances: Floats, slopes: Floats, shares: Floats, steps: Floats, information: Floats, offset: Floats,
    widths: Floats, unit_length_px: float, max_square: float,
) -> Floats:
    """Steps (s, d), each reweighted and solved once a width: weights 1 / (1 + (distance / width)^2)^2."""
    pairs, _, unknowns = slopes.shape
    squares, pulls = np.zeros((pairs, unknowns * (unknowns + 1) // 2)), np.zeros((pairs, unknowns))
    for p in range(pairs):
        at = 0
        for a in range(unknowns):
            pulls[p, a] = slopes[p, 0, a] * distances[p, 0] + slopes[p, 1, a] * distances[p, 1]
            for b in range(a + 1):
                squares[p, at] = slopes[p, 0, a] * slopes[p, 0, b] + slopes[p, 1, a] * slopes[p, 1, b]
                at += 1
    totals, gradient, hessian = np.empty(squares.shape[1]), np.empty(unknowns), np.empty((unknowns, unknowns))
    for s in range(len(steps)):
        for width in widths:
            totals[:], gradient[:] = 0.0, information @ offset
            for p in range(pairs):
                close = _compute_closeness(distances, slopes, p, steps[s], width, max_square)
                if close == 0.0:
                    continue
                weight = close * close * shares[p] / (unit_length_px * width * width)
                for c in range(len(totals)):
                    totals[c] += weight * squares[p, c]
                for a in range(unknowns):
                    gradient[a] += weight * pulls[p, a]
            at = 0
            for a in range(unknowns):
                for b in range(a + 1):
                    hessian[a, b] = hessian[b, a] = totals[at] + information[a, b]
                    at += 1
            steps[s] = -np.linalg.solve(hessian, gradient)
    return steps


@compiled
def _compute_support(
    model: Indices, distances: Floats, slopes: Floats, along: Floats, lengths: Floats, shares: Floats, steps: Floats,
    width: float, max_beside_px: float, max_square: float,
) -> Floats:
    """(s,) model length that close data lines cover, each model line at most its own."""
    support, covered, full = np.zeros(len(steps)), np.zeros(model.max() + 1), np.zeros(model.max() + 1)
    for p in range(len(model)):
        full[model[p]] = lengths[p]
    for s in range(len(steps)):
        covered[:] = 0.0
        for p in range(len(model)):
            low, high = min(along[p, 0], along[p, 1]), max(along[p, 0], along[p, 1])
            if high >= -max_beside_px and low <= lengths[p] + max_beside_px:
                covered[model[p]] += _compute_closeness(distances, slopes, p, steps[s], width, max_square) * shares[p]
        for m in range(len(covered)):
            support[s] += min(covered[m], full[m])
    return support


@compiled
def _compute_closeness(
    distances: Floats, slopes: Floats, p: int, step: Floats, width: float, max_square: float
) -> float:
    """From 1, on the model line, down; 0 where the mean square distance exceeds ``max_square`` squared widths."""
    first, second = distances[p, 0], distances[p, 1]
    for a in range(len(step)):
        first, second = first + slopes[p, 0, a] * step[a], second + slopes[p, 1, a] * step[a]
    square = (first * first + second * second) * (0.5 / (width * width))
    return 1.0 / (1.0 + square) if square < max_square else 0.0
