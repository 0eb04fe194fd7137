"""Lines of a model that is inexact: displaced to fit a picture, or their errors integrated out of the robot's pose.

The model's errors are modes (:class:`world_models.building.model_errors.LineErrors`): a wall with all that is on it, a
door, a thing. To first order in the image, the distance of a segment's end from its model line is r + J dx + A a, with
the pose's change dx and the modes' amplitudes a in standard deviations, of which a prior is known: N(0, I).

*Marginal likelihood.* Errors that lines share do not average out. So the amplitudes are not solved for but integrated
out: the residuals have the covariance S = sigma^2 I + A A', and the pose of greatest marginal likelihood is that of
generalised least squares, with the covariance (J' S^-1 J + prior)^-1. It is what a Schmidt-Kalman filter states whose
considered states are the modes. Source: S. F. Schmidt, Application of state-space methods to navigation problems,
Advances in Control Systems 3, 1966.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from knowledge_sources.methods.pose.line_set import (
    MAX_BESIDE_PX,
    OUTLIER_SIGMAS,
    LineSet,
    build_line_set,
    compute_distance_slopes,
    cross,
)
from knowledge_sources.methods.pose.planar import (
    PlanarPrior,
    compute_camera_poses,
    compute_line_jacobian,
    compute_scatter,
)
from world_models.building.model_errors import LineErrors
from world_models.camera import Camera
from world_models.frames import Pose, Pose2, wrap_angle

SHARED_PRIOR_FACTOR = 3.0
"""A prior of the same model is loosened by so many times what the model's errors make uncertain."""
MARGINAL_SPREAD = 1.4
"""Factor on the standard deviations of such a pose, for segments matched to a wrong line nearby (after a few poses on
generated floors)."""
DISPLACED_WIDTHS_PX = (12.0, 8.0, 5.0, 3.0, 2.0, 1.5)
"""Widths of the loss by which displacements of the model are fitted."""
DISPLACED_STEPS = 2  # steps of that fit at each width
DISPLACED_PAIR_PX = 2.5  # largest distance of a segment from its line, once that is displaced
DISPLACED_UNIT_PX = 20.0  # a segment of this length weighs like one measurement
MAX_FEW_LINES = 3  # so few lines move a prior of unknown worth only as far as their noise demands
MAX_MARGINAL_ROUNDS = 12  # rounds in which lines that do not agree are left out
MAX_MARGINAL_STEPS = 8  # steps of Gauss-Newton in each of them
MIN_MARGINAL_STEP = 1e-7  # step [m, rad] at which these end (convergence)
DISPLACED_WIDTH_SIGMAS = 2.0  # widest of these, in standard deviations of the lines in the picture
DISPLACED_GATE_SIGMAS = 2.5  # deviations of belief and model within which a segment may belong to a line
DISPLACED_GATE_PX = 3.0  # px; and the segment's own error across its line
DISPLACED_GATE_RAD = 0.15  # rad; and the segment's own error in direction


class DisplacedFit(NamedTuple):
    """Model lines displaced so that segments lie on them.

    Attributes:
        state: (3,) x [m], y [m], heading [rad] of ``world_from_robot``.
        amplitudes: (k,) of the modes, in standard deviations.
        lines_world: (n, 2, 3) the displaced model lines [m].
        pairs: (p, 2) line and segment that lie on each other, sorted.
    """

    state: Floats
    amplitudes: Floats
    lines_world: Floats
    pairs: Indices


def compute_displaced_jacobian(
    lines: LineSet, shifts: Floats, state: Floats, camera_from_robot: Pose
) -> tuple[Floats, Floats, Floats]:
    """Distances (n, 2) [px], derivatives (n, 2, 3) by (x, y, heading) and (n, 2, k) by the amplitudes of the modes.

    Args:
        shifts: (k, n, 3) as in :class:`LineErrors`, one row a line.
    """
    points = lines.points[:, 0]
    distances, by_pose = compute_line_jacobian(points, lines.directions, lines, state, camera_from_robot)
    rotation, translation = compute_camera_poses(state, camera_from_robot)
    along = lines.directions @ rotation.T
    planes = cross(points @ rotation.T + translation, along)
    _, slopes = compute_distance_slopes(lines, planes)
    moved = cross(shifts @ rotation.T, along[None])
    return distances, by_pose, np.einsum("ned,knd->nek", slopes, moved)


def compute_sigmas_px(
    lines_world: Floats, errors: LineErrors, camera: Camera, camera_from_robot: Pose, pose: Pose2
) -> Floats:
    """(n,) by how much the model's errors displace each line in the image, across it: a standard deviation [px].

    The larger of a line's two ends; 0 where it is not in view.
    """
    rotation, translation = compute_camera_poses(pose.vector, camera_from_robot)
    projected, _ = camera.project_segments(np.array(lines_world, float), Pose(rotation, translation))
    sigmas = np.zeros(len(lines_world))
    seen = np.flatnonzero(np.isfinite(projected).all(axis=(1, 2)))
    if len(seen) and len(errors.displacement_modes):
        lines = build_line_set(lines_world[seen], projected[seen], camera, 1.0)
        _, _, by_mode = compute_displaced_jacobian(lines, errors.displacements[:, seen], pose.vector, camera_from_robot)
        sigmas[seen] = np.sqrt(np.sum(by_mode**2, axis=2)).max(axis=1)
    return sigmas


def fit_displacements(
    lines_world: Any,
    errors: LineErrors,
    segments_px: Any,
    camera: Camera,
    camera_from_robot: Pose,
    pose: Pose2,
    covariance: Floats | None = None,
) -> DisplacedFit:
    """Displace model lines by their modes, and move the pose, until segments lie on them: least robust squares.

    The loss is Welsch's, of a width that becomes smaller, so that lines which are displaced together find the segments
    that are displaced alike, though each of them has others nearby.

    Args:
        lines_world: (n, 2, 3) [m]. segments_px: (s, 2, 2) found in the picture.
        pose: ``world_from_robot``. covariance: (3, 3) of it; ``None``: the pose stays.
    """
    lines, segments = np.asarray(lines_world, float), np.asarray(segments_px, float).reshape(-1, 2, 2)
    state, start = pose.vector, pose.vector
    which, data = _find_candidates(lines, errors, segments, camera, camera_from_robot, state, covariance)
    amplitudes = np.zeros(len(errors.displacement_modes))
    if not len(which):
        return DisplacedFit(state, amplitudes, lines, np.zeros((0, 2), np.int64))
    observed = build_line_set(lines[which], segments[data], camera, 1.0)
    shifts, free = errors.displacements[:, which], 0 if covariance is None else 3
    information = np.eye(free + len(amplitudes))
    if covariance is not None:
        information[:3, :3] = np.linalg.inv(covariance)
    weight = np.minimum(1.0, observed.lengths_px / DISPLACED_UNIT_PX)
    for width in _choose_widths(lines, errors, camera, camera_from_robot, pose):
        for _ in range(DISPLACED_STEPS):
            moved = _displace(observed, shifts, amplitudes)
            distances, by_pose, by_mode = compute_displaced_jacobian(moved, shifts, state, camera_from_robot)
            slopes = by_mode if covariance is None else np.concatenate([by_pose, by_mode], axis=2)
            w = weight * np.exp(-0.5 * np.mean(distances**2, axis=1) / width**2) / width**2
            away = np.concatenate([_subtract(state, start)[:free], amplitudes])
            step = _solve(slopes, distances, w, information, away)
            state, amplitudes = state + np.pad(step[:free], (0, 3 - free)), amplitudes + step[free:]
    moved = _displace(observed, shifts, amplitudes)
    distances, _, _ = compute_displaced_jacobian(moved, shifts, state, camera_from_robot)
    near = np.abs(distances).max(axis=1) <= DISPLACED_PAIR_PX
    return DisplacedFit(state, amplitudes, errors.displace(lines, amplitudes), np.column_stack([which, data])[near])


def _choose_widths(
    lines: Floats, errors: LineErrors, camera: Camera, mount: Pose, pose: Pose2
) -> tuple[float, ...]:
    """The widths that are not much wider than the model is inexact: a wider loss draws to other lines."""
    most_px = DISPLACED_WIDTH_SIGMAS * float(np.median(compute_sigmas_px(lines, errors, camera, mount, pose)))
    return tuple(w for w in DISPLACED_WIDTHS_PX if w <= max(most_px, DISPLACED_GATE_PX))


def _solve(slopes: Floats, distances: Floats, weights: Floats, information: Floats, away: Floats) -> Floats:
    """The step of weighted least squares with the prior's share."""
    flat = slopes.reshape(-1, slopes.shape[2])
    weighted = flat * np.repeat(weights, 2)[:, None]
    return np.asarray(-np.linalg.solve(
        flat.T @ weighted + information, weighted.T @ distances.reshape(-1) + information @ away))


def _displace(lines: LineSet, shifts: Floats, amplitudes: Floats) -> LineSet:
    by_m = np.tensordot(amplitudes, shifts, axes=1)
    points = lines.points + by_m[:, None]
    return replace(lines, points=points, moments=np.cross(points[:, 0], lines.directions))


def _find_candidates(
    lines: Floats, errors: LineErrors, segments: Floats, camera: Camera, mount: Pose, state: Floats,
    covariance: Floats | None,
) -> tuple[Indices, Indices]:
    """Lines and segments (p,) that may belong together, by what belief and model may be wrong."""
    rotation, translation = compute_camera_poses(state, mount)
    projected, _ = camera.project_segments(lines, Pose(rotation, translation))
    along, lengths = _measure(projected)
    data_along, _ = _measure(segments)
    turned = np.abs(along[:, None, 0] * data_along[None, :, 1] - along[:, None, 1] * data_along[None, :, 0])
    which, data = np.nonzero(turned <= np.sin(DISPLACED_GATE_RAD))
    if not len(which):
        return which, data
    observed = build_line_set(lines[which], segments[data], camera, 1.0)
    distances, by_pose, by_mode = compute_displaced_jacobian(observed, errors.displacements[:, which], state, mount)
    variances = np.sum(by_mode**2, axis=2)
    if covariance is not None:
        variances = variances + np.einsum("nei,ij,nej->ne", by_pose, covariance, by_pose)
    reach = DISPLACED_GATE_SIGMAS * np.sqrt(variances) + DISPLACED_GATE_PX
    at = np.einsum("ni,nei->ne", along[which], segments[data] - projected[which, :1])
    beside = reach.max(axis=1) + MAX_BESIDE_PX
    overlaps = (at.max(axis=1) >= -beside) & (at.min(axis=1) <= lengths[which] + beside)
    near: Mask = np.all(np.abs(distances) <= reach, axis=1) & overlaps
    return which[near], data[near]


def _measure(segments_px: Floats) -> tuple[Floats, Floats]:
    """Unit directions (n, 2), NaN where there is none, and lengths (n,)."""
    by = segments_px[:, 1] - segments_px[:, 0]
    lengths = np.linalg.norm(by, axis=1)
    return by / np.where(lengths > 0.0, lengths, np.nan)[:, None], lengths


def _subtract(state: Floats, start: Floats) -> Floats:
    return np.array([*(state[:2] - start[:2]), wrap_angle(float(state[2] - start[2]))])


class MarginalFit(NamedTuple):
    """A pose of greatest marginal likelihood.

    Attributes:
        state: (3,) x [m], y [m], heading [rad].
        covariance: (3, 3).
        near: (n,) the lines that agree with it.
        residuals_px: (n, 2) what of the distances the model's errors do not explain.
        cost: squared distances over their covariance, plus the prior's share.
    """

    state: Floats
    covariance: Floats
    near: Mask
    residuals_px: Floats
    cost: float


def maximise_marginal(
    lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, prior: PlanarPrior, state: Floats, near: Mask,
) -> MarginalFit:
    """The pose of greatest marginal likelihood from lines of which some are wrong.

    Lines whose remaining residual is beyond ``OUTLIER_SIGMAS`` are left out, the worst first.

    Args:
        shifts: (k, n, 3) displacement of each line by one standard deviation of each mode [m, world].
        sigma_px: of a segment's end across its line.
        state, near: where to start, and the lines (n,) that are used at first.
    """
    bound, near = 2.0 * OUTLIER_SIGMAS**2, near.copy()
    prior = _loosen(prior, lines.take(near), shifts[:, near], sigma_px, mount, state)
    for _ in range(MAX_MARGINAL_ROUNDS):
        state = _minimise(lines.take(near), shifts[:, near], sigma_px, mount, prior, state)
        squares = np.where(near, np.sum(_explain(lines, shifts, sigma_px, mount, state, near) ** 2, axis=1), 0.0)
        worst = float(squares.max(initial=0.0))
        if worst <= bound * sigma_px**2 or np.count_nonzero(near) <= MAX_FEW_LINES:
            break
        near = near & (squares < 0.5 * worst)
    r, slopes, weights = _linearise(lines.take(near), shifts[:, near], sigma_px, mount, state)
    away = _subtract(state, prior.mean)
    chi2 = float(r @ weights @ r)
    scatter = MARGINAL_SPREAD**2 * compute_scatter(chi2, len(r), bound)
    return MarginalFit(
        state, np.asarray(np.linalg.inv(slopes.T @ weights @ slopes + prior.information) * scatter, float), near,
        _explain(lines, shifts, sigma_px, mount, state, near), chi2 + float(away @ prior.information @ away))


def _loosen(
    prior: PlanarPrior, lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, state: Floats,
) -> PlanarPrior:
    """The prior without what it may share with these lines: it came of the same model, with the same errors.

    The share is the part of the covariance that the model's errors make. Where the lines tell nothing it is none.
    """
    if not prior.given or not np.any(prior.information):
        return prior
    _, slopes, weights = _linearise(lines, shifts, sigma_px, mount, state)
    exact = slopes.T @ slopes / sigma_px**2 + prior.information
    share = np.linalg.inv(slopes.T @ weights @ slopes + prior.information) - np.linalg.inv(exact)
    loose = np.linalg.inv(prior.information) + SHARED_PRIOR_FACTOR * share
    return PlanarPrior(prior.mean, np.asarray(np.linalg.inv(loose), float), True)


def _minimise(
    lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, prior: PlanarPrior, state: Floats,
) -> Floats:
    """Gauss-Newton on generalised least squares."""
    for _ in range(MAX_MARGINAL_STEPS):
        r, slopes, weights = _linearise(lines, shifts, sigma_px, mount, state)
        hessian = slopes.T @ weights @ slopes + prior.information
        step = np.linalg.solve(hessian, slopes.T @ weights @ r + prior.information @ _subtract(state, prior.mean))
        state = state - step
        if np.abs(step).max() < MIN_MARGINAL_STEP:
            break
    return state


def _linearise(
    lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, state: Floats
) -> tuple[Floats, Floats, Floats]:
    """Distances (2n,), their derivatives (2n, 3) by the state, and the inverse of their covariance (2n, 2n)."""
    distances, by_pose, by_mode = compute_displaced_jacobian(lines, shifts, state, mount)
    modes = by_mode.reshape(2 * len(lines), -1)
    weights = np.linalg.inv(sigma_px**2 * np.eye(len(modes)) + modes @ modes.T)
    return distances.reshape(-1), by_pose.reshape(-1, 3), np.asarray(weights, float)


def _explain(lines: LineSet, shifts: Floats, sigma_px: float, mount: Pose, state: Floats, near: Mask) -> Floats:
    """(n, 2) what the modes, as the lines ``near`` tell them, leave of each line's distances [px]."""
    distances, _, by_mode = compute_displaced_jacobian(lines, shifts, state, mount)
    modes = by_mode[near].reshape(-1, by_mode.shape[2])
    information = modes.T @ modes / sigma_px**2 + np.eye(by_mode.shape[2])
    amplitudes = np.linalg.solve(information, modes.T @ distances[near].reshape(-1)) / sigma_px**2
    return np.asarray(distances - by_mode @ amplitudes)
