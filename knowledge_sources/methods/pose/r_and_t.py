"""The paper's own objectives: E1 and E2, rotation and translation at once (§6.2.2), and Liu's rotation first (§6.2.1).

All are distances of the model lines' ends to the observed projection planes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.pose import kernels
from knowledge_sources.methods.pose.estimate import (
    FEW_LINES,
    PoseEstimate,
    build_estimate,
    build_prior_estimate,
    check_in_front,
    compute_covariance,
    reject_behind,
)
from knowledge_sources.methods.pose.kernels import PLANES, TINY
from knowledge_sources.methods.pose.levenberg_marquardt import (
    Minimum,
    NormalEquations,
    build_normal_equations,
    compute_rotations,
    cross,
    invert_information,
    minimise,
)
from knowledge_sources.methods.pose.line_set import LandmarkIds, LineSet, build_line_set, check_landmarks
from knowledge_sources.settings import DEFAULT, PoseSettings
from world_models.camera import Camera
from world_models.frames import Pose

MAX_ITERATIONS = 30  # levenberg-Marquardt steps for the six unknowns of a camera

PoseState = tuple[Floats, Floats]
"""Rotation (3, 3) and translation (3,) [m] of ``camera_from_world``."""

MIN_LINES = 3
"""Three lines decide six unknowns."""
NO_INFORMATION = np.zeros((6, 6))
"""Of a prior that does not count."""
NO_INFORMATION.setflags(write=False)


def r_and_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    objective: Literal["E1", "E2"] = "E1",
    weighting: Weighting = "unit",
    settings: PoseSettings = DEFAULT.pose,
) -> PoseEstimate:
    """Camera pose of least squared distances of the model ends to the observed projection planes.

    Source: §6.2.2, E1 = sum_i sigma_i (n_i . (R p_i + T))^2, and E2, each term over |R p_i + T|^2. E1 is quadratic
    in T, which is eliminated: the basin does not depend on the prior's translation. Every line counts: use
    :func:`med_r_and_t` where some may be matched wrongly.

    Args:
        model_lines_world: (n, 2, 3) [m].
        segments_px: (n, 2, 2) observed, as the lens shows them.
        prior: guess of ``camera_from_world``.
        landmark_ids: checked, not used, as every line counts.
        sigma_px: of the segment ends across the line, one number or (n,); scales the covariance.
        objective: "E1", or "E2" (ends weigh alike whatever their depth), started from E1.
        weighting: the paper's sigma_i: "unit" or by segment "length".

    Raises:
        ValueError: as :func:`build_line_set`; ids that are not one a line; an unknown objective or weighting.
    """
    if objective not in ("E1", "E2"):
        raise ValueError(f'expected objective "E1" or "E2", got {objective!r}')
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    check_landmarks(landmark_ids, len(lines))
    if len(lines) < MIN_LINES:
        return build_prior_estimate(lines, prior, FEW_LINES, settings)
    weights = compute_line_weights(lines, weighting)
    end = minimise_e1(lines, prior, weights)
    steps = end.iterations
    if objective == "E2":
        end = minimise(end.state, _build_e2(lines, weights), _perturb, MAX_ITERATIONS)
        steps += end.iterations
    rotation, translation = end.state
    scale = np.ones((len(lines), 2))
    if objective == "E2":
        scale = 1.0 / np.maximum(np.sum(compute_camera_ends(lines, rotation, translation) ** 2, axis=-1), TINY)
    gain = compute_gain(lines, rotation, translation, weights[:, None] * scale)
    kept = reject_behind(lines, rotation, translation)
    covariance = compute_covariance(lines, rotation, translation, kept, gain, settings)
    estimate = build_estimate(lines, rotation, translation, covariance, kept, end.normal.cost, steps, None, settings)
    return check_in_front(lines, prior, estimate, settings)


def minimise_e1(lines: LineSet, start: Pose, weights: Floats) -> Minimum[PoseState]:
    """Minimise E1 over R, with T eliminated exactly at every step."""
    return minimise_compiled(PLANES, lines, weights, (start.rotation, start.translation), MAX_ITERATIONS)


def minimise_compiled(
    kind: int, lines: LineSet, weights: Floats, start: PoseState, iterations: int, prior: Pose | None = None,
    information: Floats | None = None,
) -> Minimum[PoseState]:
    """:func:`kernels.minimise_pose`; the prior counts if its information (6, 6) is given.

    Arrays that may be read-only are copied: numba compiles a function anew for each kind of argument.
    """
    begin = np.array(start[0]), np.array(start[1])
    towards = begin if prior is None else (np.array(prior.rotation), np.array(prior.translation))
    known = NO_INFORMATION.copy() if information is None or prior is None else np.array(information)
    rotation, translation, hessian, cost, steps = kernels.minimise_pose(
        kind, lines.arrays, weights, begin, towards, known, iterations
    )
    return Minimum((rotation, translation), NormalEquations(cost, hessian, np.zeros(6)), steps)


def _perturb(state: PoseState, step: Floats) -> PoseState:
    """The left perturbation of a pose by (rotation, translation) (6,)."""
    turn = compute_rotations(step[:3])
    return turn @ state[0], turn @ state[1] + step[3:]


def _build_e2(lines: LineSet, weights: Floats) -> Callable[[PoseState], NormalEquations]:
    def linearise(state: PoseState) -> NormalEquations:
        ends = compute_camera_ends(lines, *state)
        reach = np.maximum(np.linalg.norm(ends, axis=-1), TINY)
        sines = compute_plane_distances(lines, ends) / reach
        jacobian = compute_plane_jacobian(lines, ends) / reach[..., None]
        jacobian[..., 3:] -= (sines / reach**2)[..., None] * ends
        root = np.sqrt(weights)[:, None]
        return build_normal_equations(sines * root, jacobian * root[..., None])

    return linearise


def r_then_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    weighting: Weighting = "unit",
    settings: PoseSettings = DEFAULT.pose,
) -> PoseEstimate:
    """Camera pose in two least-squares problems: n_i . R d_i = 0 for R, then n_i . (R p_i + T) = 0 for T.

    Source: §6.2.1 (Liu et al. [27]). Rotation increments are axis-angle vectors, not Liu's Euler angles: the minimum is
    the same, the way to it safer. Arguments and errors as in :func:`r_and_t`, which is more accurate.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    check_landmarks(landmark_ids, len(lines))
    if len(lines) < MIN_LINES:
        return build_prior_estimate(lines, prior, FEW_LINES, settings)
    weights = compute_line_weights(lines, weighting)
    end = _minimise_rotation(lines, prior, weights)
    rotation = end.state
    translation = compute_translation(lines, rotation, prior.translation, weights)
    misses = compute_plane_distances(lines, compute_camera_ends(lines, rotation, translation))
    cost = float(np.sum(weights[:, None] * misses**2))
    gain = _compute_gain(lines, rotation, translation, weights)
    kept = reject_behind(lines, rotation, translation)
    covariance = compute_covariance(lines, rotation, translation, kept, gain, settings)
    estimate = build_estimate(lines, rotation, translation, covariance, kept, cost, end.iterations, None, settings)
    return check_in_front(lines, prior, estimate, settings)


def _minimise_rotation(lines: LineSet, prior: Pose, weights: Floats) -> Minimum[Floats]:
    root = np.sqrt(weights)[:, None]

    def linearise(rotation: Floats) -> NormalEquations:
        turned = lines.directions @ rotation.T
        misses = np.sum(lines.normals * turned, axis=1, keepdims=True)
        return build_normal_equations(misses * root, cross(turned, lines.normals) * root)

    def retract(rotation: Floats, step: Floats) -> Floats:
        return np.asarray(compute_rotations(step) @ rotation)

    return minimise(prior.rotation, linearise, retract, MAX_ITERATIONS)


def _compute_gain(lines: LineSet, rotation: Floats, translation: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """How the pose moves with the observed ends, through both stages, see :func:`kernels.compute_gain`."""
    turned = lines.directions @ rotation.T
    jacobian = cross(turned, lines.normals)
    noise = compute_end_noise(lines, turned[:, None, :])[:, 0]
    weighted = jacobian * weights[:, None]
    turn = -invert_information(weighted.T @ jacobian) @ (weighted[:, None, :] * noise[..., None]).reshape(-1, 3).T
    ends = compute_camera_ends(lines, rotation, translation)
    full = compute_plane_jacobian(lines, ends)
    moved = np.einsum("ika,am->ikm", full[..., :3], turn)
    moved += _spread_noise(compute_end_noise(lines, ends))
    normals = lines.normals * weights[:, None]
    shift = -invert_information(2.0 * normals.T @ lines.normals) @ np.einsum("ia,ikm->am", normals, moved)
    return shape_gain(lines, np.vstack([turn, shift]))


def _spread_noise(noise: Floats) -> Floats:
    """Noise (n, 2, 2) of each line's own two ends, laid out over all 2n ends: (n, 2, 2n)."""
    n = len(noise)
    out = np.zeros((n, 2, n, 2))
    rows = np.arange(n)
    out[rows, :, rows, :] = noise
    return out.reshape(n, 2, 2 * n)


Weighting = Literal["unit", "length"]


def compute_line_weights(lines: LineSet, weighting: Weighting) -> Floats:
    """The paper's weights sigma_i (n,): all one, or the segment's length over the mean length.

    Raises:
        ValueError: ``weighting`` is neither "unit" nor "length".
    """
    if weighting == "unit":
        return np.ones(len(lines))
    if weighting == "length":
        return np.asarray(lines.lengths_px / max(float(np.mean(lines.lengths_px)), TINY))
    raise ValueError(f'expected weighting "unit" or "length", got {weighting!r}')


def compute_camera_ends(lines: LineSet, rotation: Floats, translation: Floats) -> Floats:
    """q = R p + T, (n, 2, 3) [m, camera]."""
    return np.asarray(lines.points @ rotation.T + translation)


def compute_plane_distances(lines: LineSet, ends: Floats) -> Floats:
    """n . q, (n, 2) [m]: the bracket of E1."""
    return np.asarray(np.matmul(ends, lines.normals[:, :, None])[..., 0])


def compute_plane_jacobian(lines: LineSet, ends: Floats) -> Floats:
    """Derivatives (n, 2, 6) of n . q by the left perturbation: (q x n, n)."""
    turn = cross(ends, lines.normals[:, None, :])
    return np.concatenate([turn, np.broadcast_to(lines.normals[:, None, :], ends.shape)], axis=-1)


def compute_translation(lines: LineSet, rotation: Floats, translation: Floats, weights: Floats) -> Floats:
    """T (3,) that minimises E1 exactly for a given R; in directions that the lines leave open, ``translation``'s."""
    misses = compute_plane_distances(lines, compute_camera_ends(lines, rotation, translation))
    weighted = lines.normals * weights[:, None]
    moved = weighted.T @ misses.sum(axis=1)
    values, vectors = np.linalg.eigh(2.0 * weighted.T @ lines.normals)
    known = values > 1e-10 * max(float(values[-1]), TINY)
    back = np.where(known, 1.0 / np.where(known, values, 1.0), 0.0)
    return np.asarray(translation - vectors @ (back * (vectors.T @ moved)))


def compute_end_noise(lines: LineSet, vectors: Floats) -> Floats:
    """Change (n, k, 2) of n . v, v (n, k, 3), when the observed ends move across their segment by one sigma."""
    first, second = lines.rays[:, 0], lines.rays[:, 1]
    along = (second - first)[:, :2] * lines.focal_px
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(lines.lengths_px, TINY)[:, None]
    shift = np.zeros_like(first)
    shift[:, :2] = across * lines.sigma_px[:, None] / lines.focal_px
    size = np.maximum(np.linalg.norm(cross(first, second), axis=1), TINY)[:, None]
    planes = np.stack([cross(shift, second) / size, cross(first, shift) / size], axis=1)
    return np.asarray(vectors @ np.swapaxes(planes, 1, 2))


def compute_gain(lines: LineSet, rotation: Floats, translation: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """How the minimum of E1 with ``weights`` (n, 2) moves with the observed ends, see :func:`kernels.compute_gain`.

    E1 is not a likelihood, so the inverse Hessian is not its covariance. For E2 divide the weights by |q|^2.
    """
    ends = compute_camera_ends(lines, rotation, translation)
    jacobian = compute_plane_jacobian(lines, ends)
    weighted = jacobian * weights[..., None]
    hessian = np.einsum("ika,ikb->ab", weighted, jacobian)
    spread = np.einsum("ika,ikj->aij", weighted, compute_end_noise(lines, ends)).reshape(6, -1)
    return shape_gain(lines, -invert_information(hessian) @ spread)


def shape_gain(lines: LineSet, gain: Floats) -> tuple[Floats, Floats]:
    """From the move (6, 2n) of a pose for each deviation of an end across its segment: gain and normals in the picture.

    See :func:`kernels.compute_gain`.
    """
    along = (lines.rays[:, 1] - lines.rays[:, 0])[:, :2] * lines.focal_px
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(lines.lengths_px, TINY)[:, None]
    rows = np.moveaxis(gain.reshape(6, len(lines), 2), 0, 2) / lines.sigma_px[:, None, None]
    return np.ascontiguousarray(rows), across
