"""Matching with a camera's own unknowns: for errors that perspective does not show as a 2D motion (§6.1).

The paper's matcher moves the projected model rigidly in the image. Close to the camera that is not how it moves: a
pose error of 0.3 m shifts a line at 2 m by 60 px and one at 20 m by 6. Here a placement is a change of the camera's
pose, linear in the image to first order, so that the spatial fit is again in closed form and each pair again a matrix.
The objective and the local search are those of :func:`match_lines`. Starts lie all over the prior, refined by a robust
loss.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.special import ndtri

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.matching.image_matching import COVERAGE_CELLS
from knowledge_sources.methods.matching.search import (
    POSE_STEP,
    Correspondence,
    PairSpace,
    build_likelihood_terms,
    build_masks,
    choose_nearest,
    compute_coverage,
    evaluate_state,
    fit_state,
    list_pairs,
    search_pairs,
)
from knowledge_sources.methods.pose import LineSet, build_line_set
from world_models.camera import NEAR_PLANE_M, Camera
from world_models.compiled import compiled
from world_models.frames import Pose, Pose2, frozen

MAX_ALLOWED_PAIRS = 60000  # most pairs that are looked at; of more, each model line's longest (experiment matcher)
MAX_START_PAIRS = 12000
"""Most pairs that the starts are refined with; of more, each model line's longest (experiment matcher)."""
MAX_NEAR_PAIRS = 2500
"""Most pairs near a pose that are searched; of more, each model line's longest (experiment matcher)."""
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
GATE_SIGMAS = 3.0  # deviations of the prior within which a pair must lie
GATE_PX = 3.0  # px; and the segment's own error across its line
GATE_RAD = 0.12  # rad; and the segment's own error in direction
GATE_ALONG_PX = 30.0  # px; how far beyond a model line's end a segment may lie besides
MAX_GATE_RAD = 0.6  # rad; pairs that differ more in direction are never looked at
GRID_SIGMAS = 2.0  # deviations to either side of a prior on the floor that starts reach
GRID_PX = 20.0  # px; distance of two such starts in the image, so that the loss draws what lies between to one
MAX_GRID_STEPS = 3  # most starts to either side of an axis
SPACE_STARTS = 128  # starts spread over a prior with six unknowns, besides the prior itself
FLOOR_WIDTHS_PX = (16.0, 12.0, 8.0)  # px; widths of the loss by which starts on the floor are refined, to first order
SPACE_WIDTHS_PX = (16.0, 12.0, 8.0, 6.0)  # px; the same with six unknowns
TINY = 1e-12
"""Keeps the length of an image line's normal from zero."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseMatch(Correspondence):
    """The best correspondence, and the camera pose of its best fit; a pose solver refines it."""

    camera_from_world: Pose


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
        model_lines_world, data_px, camera, parameters, MAX_POSE_PAIR_PX, POSE_SIGMA_PX
    )
    return FloorMatch(
        match.pairs, match.e_fit, match.e_omission, match.coverage, match.residuals_px, match.camera_from_world,
        parameters.compute_robot_pose(match.camera_from_world),
    )


def match_in_space(
    model_lines_world: Any,
    data_px: Any,
    camera: Camera,
    prior: Pose,
    prior_covariance: Any,
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
    return _match(model_lines_world, data_px, camera, parameters, pair_px, sigma_px)


def _match(
    model_lines_world: Any, data_px: Any, camera: Camera, parameters: PoseParameters, pair_px: float,
    sigma_px: float,
) -> PoseMatch:
    """Match model lines (m, 2, 3) to data lines (k, 2, 2).

    Pairs that the prior allows vote by a robust fit from starts all over the prior; the best poses are searched as
    :func:`match_lines` does, under its objective with the prior as one more term.
    """
    scene = build_scene(model_lines_world, data_px, camera, parameters)
    lengths = project_model(scene, parameters.prior)[1]
    terms = build_likelihood_terms(lengths, len(scene.data), sigma_px, pair_px)
    wide = keep_longest(find_allowed_pairs(scene), MAX_ALLOWED_PAIRS)
    tries = []
    for pose in find_start_poses(scene, keep_longest(wide, MAX_START_PAIRS)):
        pairs = linearise_pairs(scene, pose, wide.model, wide.data)
        pairs = pairs.take(find_near_pairs(pairs, pair_px, MAX_POSE_PAIR_RAD))
        pairs = keep_longest(pairs, MAX_NEAR_PAIRS)
        space, first = _build_space(scene, pose, pairs, pair_px, sigma_px)
        tries.append((space, pairs, pose, search_pairs(space, terms, first)))
    space, pairs, pose, result = min(tries, key=lambda tried: float(tried[3].errors[-1]))
    fit, (rows, chosen) = fit_state(space, result.chosen), list_pairs(space, result.chosen)
    e_fit, step = float(fit.errors[0]), fit.placements[0]
    return PoseMatch(
        pairs=chosen,
        e_fit=e_fit,
        e_omission=evaluate_state(space, terms, result.chosen) - e_fit,
        coverage=compute_coverage(space, result.chosen),
        residuals_px=pairs.distances[rows] + pairs.slopes[rows] @ step,
        camera_from_world=parameters.move(pose, step),
    )


def _build_space(
    scene: LineScene, pose: Pose, pairs: PosePairs, pair_px: float, sigma_px: float
) -> tuple[PairSpace, Mask]:
    """The restricted space at a pose, forms in (step, 1), the prior as anchor; and the state to start from."""
    parameters = scene.parameters
    rows = np.concatenate([pairs.slopes, pairs.distances[..., None]], axis=-1) / (np.sqrt(2.0) * sigma_px)
    prior = np.concatenate([np.eye(len(parameters.root)), parameters.compute_step(pose)[:, None]], axis=1)
    space = PairSpace(
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
    scene: LineScene, wide: PosePairs, pose: Pose, groups: list[tuple[float, ...]]
) -> tuple[Pose, float]:
    """A pose refined with the pairs linearised there, again for each group of widths; and its support."""
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
    pairs: PosePairs, steps: Floats, information: Floats, offset: Floats, widths: tuple[float, ...]
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


@dataclass(frozen=True, slots=True, eq=False)
class PoseParameters(ABC):
    """A prior in d unknowns, and how they move the camera.

    Attributes:
        prior: ``camera_from_world``.
        information: (d, d) inverse covariance of the unknowns about the prior.
        root: (d, d) a factor of the covariance: times standard normal deviates it gives steps.
        widths_per_linearisation: when a pose is refined, the pairs are linearised again after this many widths.
    """

    prior: Pose
    information: Floats
    root: Floats
    widths_per_linearisation: ClassVar[int]

    @abstractmethod
    def list_starts(self, reach_px: Floats) -> Floats:
        """(s, d) starts, in deviations, given how far one along each axis moves the picture (d,) [px]."""

    @abstractmethod
    def get_widths(self) -> tuple[float, ...]:
        """tuple[float, ...] of the loss [px] by which starts are refined, to first order about the prior."""

    @abstractmethod
    def compute_basis(self, pose: Pose) -> Floats:
        """(6, d) left perturbation (rotation, translation) of a pose by a unit of each unknown."""

    @abstractmethod
    def move(self, pose: Pose, step: Floats) -> Pose:
        """The pose after a step (d,)."""

    @abstractmethod
    def compute_step(self, pose: Pose) -> Floats:
        """(d,) the step that takes the prior to a pose."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraParameters(PoseParameters):
    """All six unknowns: a step is a left perturbation (rotation [rad], translation [m])."""

    widths_per_linearisation = 1

    def list_starts(self, reach_px: Floats) -> Floats:
        return _spread_normal(SPACE_STARTS)

    def get_widths(self) -> tuple[float, ...]:
        return SPACE_WIDTHS_PX

    def compute_basis(self, pose: Pose) -> Floats:
        return np.eye(6)

    def move(self, pose: Pose, step: Floats) -> Pose:
        return pose.perturbed(step[:3], step[3:])

    def compute_step(self, pose: Pose) -> Floats:
        apart = pose @ self.prior.inverse()
        return np.concatenate([apart.rotation_vector, apart.translation])


@dataclass(frozen=True, slots=True, eq=False)
class FloorParameters(PoseParameters):
    """A robot that carries the camera: a step is one of (x [m], y [m], heading [rad]) in the world.

    Attributes:
        mount: ``camera_from_robot``.
        turning: (6,) left perturbation of the camera by a radian that the robot turns to the left.
    """

    mount: Pose
    turning: Floats
    widths_per_linearisation = 4

    def list_starts(self, reach_px: Floats) -> Floats:
        steps = (round(GRID_SIGMAS * reach / GRID_PX + 0.25) for reach in reach_px.tolist())
        return _build_grid(tuple(min(count, MAX_GRID_STEPS) for count in steps), GRID_SIGMAS)

    def get_widths(self) -> tuple[float, ...]:
        return FLOOR_WIDTHS_PX

    def compute_robot_pose(self, pose: Pose) -> Pose2:
        """``world_from_robot`` of a camera pose."""
        turn, shift = pose.rotation.T, pose.rotation.T @ (self.mount.translation - pose.translation)
        forward = turn @ self.mount.rotation[:, 0]
        return Pose2(shift[0], shift[1], math.atan2(forward[1], forward[0]))

    def compute_basis(self, pose: Pose) -> Floats:
        basis = np.zeros((6, 3))
        basis[3:, :2] = -pose.rotation[:, :2]
        basis[:, 2] = self.turning
        return basis

    def move(self, pose: Pose, step: Floats) -> Pose:
        at = self.compute_robot_pose(pose)
        c, s = math.cos(at.heading_rad + step[2]), math.sin(at.heading_rad + step[2])
        turn = self.mount.rotation @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return Pose(turn, self.mount.translation - turn @ np.array([at.x_m + step[0], at.y_m + step[1], 0.0]))

    def compute_step(self, pose: Pose) -> Floats:
        return self.compute_robot_pose(pose).minus(self.compute_robot_pose(self.prior))


def build_camera_parameters(prior: Pose, covariance: Any) -> CameraParameters:
    """From ``covariance`` (6, 6) of the prior's left perturbation. Raises ValueError for another shape."""
    spread = np.asarray(covariance, float)
    if spread.shape != (6, 6):
        raise ValueError(f"expected a prior_covariance of shape (6, 6), got {spread.shape}")
    return CameraParameters(prior, np.linalg.inv(spread), np.linalg.cholesky(spread))


def build_floor_parameters(mount: Pose, prior: Pose2, covariance: Any) -> FloorParameters:
    """From ``covariance`` (3, 3) of ``prior``, ``world_from_robot``. Raises ValueError for another shape."""
    spread = np.asarray(covariance, float)
    if spread.shape != (3, 3):
        raise ValueError(f"expected a prior_covariance of shape (3, 3), got {spread.shape}")
    # The robot's turn to the left turns the world clockwise about the robot's axis, as the camera sees it.
    axis = -mount.rotation[:, 2]
    turning = np.concatenate([axis, np.cross(mount.translation, axis)])
    camera_from_world = mount @ prior.lifted().inverse()
    return FloorParameters(camera_from_world, np.linalg.inv(spread), np.linalg.cholesky(spread), mount, turning)


@lru_cache(maxsize=64)
def _build_grid(steps: tuple[int, ...], sigmas: float) -> Floats:
    """(s, 3) every combination of so many steps to either side of each axis, which reach ``sigmas``."""
    axes = [sigmas * np.arange(-count, count + 1) / max(count, 1) for count in steps]
    return frozen(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes)))


@lru_cache(maxsize=4)
def _spread_normal(count: int) -> Floats:
    """(count + 1, 6) zero, and an even spread of the normal law (Halton's sequence, the same at every call)."""
    bases = 2, 3, 5, 7, 11, 13  # the first primes, one for each of the six unknowns
    spread = ndtri(np.stack([_reflect_digits(count, base) for base in bases], axis=1))
    return frozen(np.concatenate([np.zeros((1, 6)), spread]))


def _reflect_digits(count: int, base: int) -> Floats:
    """(count,) of van der Corput's sequence without its 0, as scipy.stats.qmc, whose import takes a quarter second."""
    rest, part, out = np.arange(1, count + 1), 1.0, np.zeros(count)
    while rest.any():
        part /= base
        out += part * (rest % base)
        rest //= base
    return out


@dataclass(frozen=True, slots=True, eq=False)
class LineScene:
    """The data of one call.

    Attributes:
        model: model lines. data: (k, 2, 2) data lines without distortion [px]. rays: (k, 2, 3) of their ends.
        camera: without distortion. parameters: the prior and its unknowns.
    """

    model: LineSet
    data: Floats
    rays: Floats
    camera: Camera
    parameters: PoseParameters


class PosePairs(NamedTuple):
    """p pairs at a pose.

    Attributes:
        model, data: (p,) indices.
        distances: (p, 2) of the data ends to their model line [px]. slopes: (p, 2, d) derivatives by the unknowns.
        along: (p, 2) of the data ends along the model line, from 0 to ``lengths`` (p,) [px].
        angles: (p,) of the data lines from their model lines [rad]. shares: (p,) the shorter lengths [px].
    """

    model: Indices
    data: Indices
    distances: Floats
    slopes: Floats
    along: Floats
    lengths: Floats
    angles: Floats
    shares: Floats

    def take(self, chosen: Mask) -> PosePairs:
        """The pairs of a mask."""
        return PosePairs._make(part[chosen] for part in self)


def build_scene(model: Any, data: Any, camera: Camera, parameters: PoseParameters) -> LineScene:
    """Prepare model lines (m, 2, 3) [m] and data lines (k, 2, 2) [px].

    Raises:
        ValueError: no model line, or a wrong shape.
    """
    lines = np.asarray(model, float).reshape(-1, 2, 3)
    if not len(lines):
        raise ValueError("expected at least one model line, got none")
    segments = np.asarray(data, float).reshape(-1, 2, 2)
    anywhere = np.broadcast_to([[0.0, 0.0], [1.0, 0.0]], (len(lines), 2, 2))
    seen = build_line_set(np.broadcast_to(lines[:1], (len(segments), 2, 3)), segments, camera, 1.0)
    return LineScene(
        build_line_set(lines, anywhere, camera, 1.0),
        np.ascontiguousarray(camera.undistort(segments)),
        seen.rays,
        replace(camera, distortion=None),
        parameters,
    )


def project_model(scene: LineScene, pose: Pose) -> tuple[Floats, Floats, Mask]:
    """Model lines in the image plane, cut at the near plane but not at the image's border.

    Returns:
        (m, 2, 2) [px]; lengths (m,) [px]; (m,) which are in front of the near plane, at least in part.
    """
    c = scene.camera
    projected: tuple[Floats, Floats, Mask] = _project(
        scene.model.points, np.array(pose.rotation), np.array(pose.translation), c.fx, c.fy, c.cx, c.cy, NEAR_PLANE_M
    )
    return projected


def find_allowed_pairs(scene: LineScene) -> PosePairs:
    """Pairs that the prior allows: near the prediction in offset at both ends, in angle, and along the line."""
    parameters = scene.parameters
    px, _, visible = project_model(scene, parameters.prior)
    i, k = _find_nearly_parallel(px, visible, scene.data, MAX_GATE_RAD)
    pairs = linearise_pairs(scene, parameters.prior, i, k)
    data_lengths = np.linalg.norm(scene.data[:, 1] - scene.data[:, 0], axis=1)
    gates = GATE_SIGMAS, GATE_PX, GATE_RAD, GATE_ALONG_PX
    return pairs.take(
        _find_within_prior(pairs.distances, pairs.slopes, pairs.along, pairs.lengths, pairs.angles, data_lengths[k],
                           parameters.root, gates)
    )


def keep_longest(pairs: PosePairs, most: int) -> PosePairs:
    """At most ``most`` pairs: of each model line as many as of any other that has so many, the longest ones.

    Short segments are many and say little; where a wide prior allows hundreds of them for each model line, the long
    ones decide which pose it is.
    """
    model = pairs.model
    if len(model) <= most:
        return pairs
    order = np.lexsort((np.arange(len(model)), -pairs.shares, model))
    counts = np.bincount(model)
    ranks = np.empty(len(model), np.intp)
    ranks[order] = np.arange(len(model)) - np.repeat(np.cumsum(counts) - counts, counts)
    sizes = np.cumsum(np.bincount(ranks))
    return pairs.take(ranks < np.searchsorted(sizes, most, side="right"))


def linearise_pairs(scene: LineScene, pose: Pose, i: Indices, k: Indices) -> PosePairs:
    """Model lines ``i`` (p,) with data lines ``k`` (p,), linearised at a pose."""
    px, lengths, _ = project_model(scene, pose)
    model = scene.model
    distances, slopes, along, angles, shares = _linearise(
        model.directions, model.moments, px, scene.data, scene.rays, model.focal_px, np.array(pose.rotation),
        np.array(pose.translation), scene.parameters.compute_basis(pose), i, k,
    )
    return PosePairs(i, k, distances, slopes, along, lengths[i], angles, shares)


def find_near_pairs(pairs: PosePairs, pair_px: float, pair_rad: float) -> Mask:
    """(p,) which lie within the limits across, overlap along and are nearly parallel."""
    near = (np.abs(pairs.distances).max(axis=1) <= pair_px) & (np.abs(pairs.angles) <= pair_rad)
    beside = (pairs.along.max(axis=1) < -pair_px) | (pairs.along.min(axis=1) > pairs.lengths + pair_px)
    return np.asarray(near & ~beside)


@compiled
def _project(
    points: Floats, rotation: Floats, translation: Floats, fx: float, fy: float, cx: float, cy: float, near_m: float
) -> tuple[Floats, Floats, Mask]:
    px, lengths, visible = np.empty((len(points), 2, 2)), np.ones(len(points)), np.ones(len(points), np.bool_)
    for m in range(len(points)):
        first, second = rotation @ points[m, 0] + translation, rotation @ points[m, 1] + translation
        visible[m] = first[2] >= near_m or second[2] >= near_m
        if not visible[m]:
            px[m, :, 0], px[m, :, 1] = cx, cy
            continue
        if first[2] < near_m:
            first = second + (second[2] - near_m) / (second[2] - first[2]) * (first - second)
        elif second[2] < near_m:
            second = first + (first[2] - near_m) / (first[2] - second[2]) * (second - first)
        px[m, 0, 0], px[m, 0, 1] = fx * first[0] / first[2] + cx, fy * first[1] / first[2] + cy
        px[m, 1, 0], px[m, 1, 1] = fx * second[0] / second[2] + cx, fy * second[1] / second[2] + cy
        lengths[m] = max(math.hypot(px[m, 1, 0] - px[m, 0, 0], px[m, 1, 1] - px[m, 0, 1]), 1.0)
    return px, lengths, visible


@compiled
def _find_nearly_parallel(
    px: Floats, visible: Mask, data: Floats, max_angle_rad: float
) -> tuple[Indices, Indices]:
    """Indices (p,) of the model and data lines of every pair whose directions differ by at most ``max_angle_rad``."""
    i, k = np.empty(len(px) * len(data), np.intp), np.empty(len(px) * len(data), np.intp)
    angles = np.empty(len(data))
    for d in range(len(data)):
        angles[d] = math.atan2(data[d, 1, 1] - data[d, 0, 1], data[d, 1, 0] - data[d, 0, 0])
    count = 0
    for m in range(len(px)):
        angle = math.atan2(px[m, 1, 1] - px[m, 0, 1], px[m, 1, 0] - px[m, 0, 0])
        for d in range(len(data)):
            if visible[m] and abs(_wrap_undirected(angles[d] - angle)) <= max_angle_rad:
                i[count], k[count] = m, d
                count += 1
    return i[:count].copy(), k[:count].copy()


@compiled
def _find_within_prior(
    distances: Floats, slopes: Floats, along: Floats, lengths: Floats, angles: Floats, data_lengths: Floats,
    root: Floats, gates: tuple[float, float, float, float],
) -> Mask:
    """(p,) which pairs lie where the prior, ``root``, allows them.

    ``gates`` are the deviations of the prior, and a segment's own error across [px], in angle [rad] and along [px].
    """
    sigmas, gate_px, gate_rad, gate_along_px = gates
    pairs, _, unknowns = slopes.shape
    near = np.empty(pairs, np.bool_)
    for p in range(pairs):
        spreads, turned = np.zeros(2), 0.0
        for c in range(unknowns):
            first = second = 0.0
            for a in range(unknowns):
                first, second = first + slopes[p, 0, a] * root[a, c], second + slopes[p, 1, a] * root[a, c]
            spreads[0], spreads[1] = spreads[0] + first * first, spreads[1] + second * second
            turned += (second - first) ** 2
        spreads = np.sqrt(spreads)
        reach = sigmas * spreads.max() + gate_along_px
        near[p] = (
            abs(distances[p, 0]) <= sigmas * spreads[0] + gate_px
            and abs(distances[p, 1]) <= sigmas * spreads[1] + gate_px
            and abs(angles[p]) <= sigmas * math.sqrt(turned) / max(data_lengths[p], 1.0) + gate_rad
            and max(along[p, 0], along[p, 1]) >= -reach
            and min(along[p, 0], along[p, 1]) <= lengths[p] + reach
        )
    return near


@compiled
def _linearise(
    directions: Floats, moments: Floats, px: Floats, data: Floats, rays: Floats, focal: Floats, rotation: Floats,
    translation: Floats, basis: Floats, i: Indices, k: Indices,
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Distances (p, 2), slopes (p, 2, d), along (p, 2), angles (p,) and shares (p,) of pairs at a pose.

    A turn w moves a projection plane's normal m by w x m; a shift t by t x d, d the model line's direction.
    """
    pairs, unknowns = len(i), basis.shape[1]
    distances, along = np.empty((pairs, 2)), np.empty((pairs, 2))
    slopes, angles, shares = np.empty((pairs, 2, unknowns)), np.empty(pairs), np.empty(pairs)
    planes, tilts, reaches, moves = _project_planes(directions, moments, focal, rotation, translation, basis)
    for p in range(pairs):
        m, n = i[p], k[p]
        u, v = px[m, 1, 0] - px[m, 0, 0], px[m, 1, 1] - px[m, 0, 1]
        length = max(math.hypot(u, v), 1.0)
        data_u, data_v = data[n, 1, 0] - data[n, 0, 0], data[n, 1, 1] - data[n, 0, 1]
        angles[p] = _wrap_undirected(math.atan2(data_v, data_u) - math.atan2(v, u))
        shares[p] = min(math.hypot(data_u, data_v), length)
        for e in range(2):
            along[p, e] = ((data[n, e, 0] - px[m, 0, 0]) * u + (data[n, e, 1] - px[m, 0, 1]) * v) / length
            distance = 0.0
            for a in range(3):
                distance += rays[n, e, a] * planes[m, a] / reaches[m]
            distances[p, e] = distance
            for c in range(unknowns):
                slope = 0.0
                for a in range(3):
                    slope += (rays[n, e, a] - distance * tilts[m, a]) * moves[m, c, a]
                slopes[p, e, c] = slope / reaches[m]
    return distances, slopes, along, angles, shares


@compiled
def _project_planes(
    directions: Floats, moments: Floats, focal: Floats, rotation: Floats, translation: Floats, basis: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """The model lines' projection planes in the camera frame.

    Returns:
        normals (m, 3); derivatives (m, 3) of the length of the image line's normal by them; that length (m,);
        derivatives (m, d, 3) of the normals by each unknown.
    """
    lines, unknowns = len(directions), basis.shape[1]
    planes, tilts, reaches = np.empty((lines, 3)), np.zeros((lines, 3)), np.empty(lines)
    moves, direction = np.empty((lines, unknowns, 3)), np.empty(3)
    for m in range(lines):
        for a in range(3):
            x, y, z = rotation[a, 0], rotation[a, 1], rotation[a, 2]
            direction[a] = x * directions[m, 0] + y * directions[m, 1] + z * directions[m, 2]
            planes[m, a] = x * moments[m, 0] + y * moments[m, 1] + z * moments[m, 2]
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            planes[m, a] += translation[b] * direction[c] - translation[c] * direction[b]
        x, y = planes[m, 0] / focal[0], planes[m, 1] / focal[1]
        reaches[m] = max(math.hypot(x, y), TINY)
        tilts[m, 0], tilts[m, 1] = x / focal[0] / reaches[m], y / focal[1] / reaches[m]
        for n in range(unknowns):
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                moves[m, n, a] = (
                    basis[b, n] * planes[m, c] - basis[c, n] * planes[m, b]
                    + basis[3 + b, n] * direction[c] - basis[3 + c, n] * direction[b]
                )
    return planes, tilts, reaches, moves


@compiled
def _wrap_undirected(angle: float) -> float:
    """The angle between undirected lines, in [-pi/2, pi/2)."""
    return (angle + 0.5 * math.pi) % math.pi - 0.5 * math.pi
