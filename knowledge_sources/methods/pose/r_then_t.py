"""R then T: rotation first, translation after (Liu et al., §6.2.1). The paper's baseline."""

from __future__ import annotations

from typing import Any

import numpy as np

from knowledge_sources.methods.pose.estimate import Array, PoseEstimate
from knowledge_sources.methods.pose.line_set import LandmarkIds, LineSet, build_line_set, check_landmarks
from knowledge_sources.methods.pose.numerics.finish import FEW_LINES, all_kept, estimate_at, guarded, prior_estimate
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import (
    Descent,
    Normal,
    cross,
    descend,
    invert_information,
    normal_equations,
    rotations,
)
from knowledge_sources.methods.pose.numerics.plane_error import (
    Weighting,
    best_translation,
    compute_camera_ends,
    compute_plane_distances,
    compute_plane_jacobian,
    end_noise,
    line_weights,
)
from world_models.camera import Camera
from world_models.frames import Pose


def r_then_t(
    model_lines_world: Any,
    segments_px: Any,
    camera: Camera,
    prior: Pose,
    *,
    landmark_ids: LandmarkIds = None,
    sigma_px: Any = 1.0,
    weighting: Weighting = "unit",
) -> PoseEstimate:
    """Solve n_i . R d_i = 0 for R, then n_i . (R p_i + T) = 0 for T, each by least squares.

    Source: §6.2.1 (Liu et al. [27]). Rotation increments are axis-angle vectors, not Liu's Euler angles: the
    optimum is the same, the way to it safer. Arguments as in :func:`r_and_t`.
    """
    lines = build_line_set(model_lines_world, segments_px, camera, sigma_px)
    check_landmarks(landmark_ids, len(lines))
    if len(lines) < 3:
        return prior_estimate(lines, prior, FEW_LINES)
    weights = line_weights(lines, weighting)
    end = _solve_rotation(lines, prior, weights)
    rotation = end.state
    translation = best_translation(lines, rotation, prior.translation, weights)
    misses = compute_plane_distances(lines, compute_camera_ends(lines, rotation, translation))
    cost = float(np.sum(weights[:, None] * misses**2))
    covariance = _covariance(lines, rotation, translation, weights)
    kept = all_kept(lines, rotation, translation)
    return guarded(
        lines, prior, estimate_at(lines, rotation, translation, covariance, kept, cost, end.iterations, None)
    )


def _solve_rotation(lines: LineSet, prior: Pose, weights: Array) -> Descent[Array]:
    root = np.sqrt(weights)[:, None]

    def linearise(rotation: Array) -> Normal:
        turned = lines.directions @ rotation.T
        misses = np.sum(lines.normals * turned, axis=1, keepdims=True)
        return normal_equations(misses * root, cross(turned, lines.normals) * root)

    return descend(prior.rotation, linearise, lambda rotation, step: rotations(step) @ rotation)


def _covariance(lines: LineSet, rotation: Array, translation: Array, weights: Array) -> Array:
    """The ends' noise carried through both stages."""
    turned = lines.directions @ rotation.T
    jacobian = cross(turned, lines.normals)
    noise = end_noise(lines, turned[:, None, :])[:, 0]
    weighted = jacobian * weights[:, None]
    turn = -invert_information(weighted.T @ jacobian) @ (weighted[:, None, :] * noise[..., None]).reshape(-1, 3).T
    ends = compute_camera_ends(lines, rotation, translation)
    full = compute_plane_jacobian(lines, ends)
    moved = np.einsum("ika,am->ikm", full[..., :3], turn)
    moved += _own_noise(end_noise(lines, ends))
    normals = lines.normals * weights[:, None]
    shift = -invert_information(2.0 * normals.T @ lines.normals) @ np.einsum("ia,ikm->am", normals, moved)
    both = np.vstack([turn, shift])
    return np.asarray(both @ both.T)


def _own_noise(noise: Array) -> Array:
    """(n, 2, 2) noise of a line's own two ends laid out over all 2n ends: (n, 2, 2n)."""
    n = len(noise)
    out = np.zeros((n, 2, n, 2))
    rows = np.arange(n)
    out[rows, :, rows, :] = noise
    return out.reshape(n, 2, 2 * n)
