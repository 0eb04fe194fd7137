"""R then T: rotation first, translation after (Liu et al., §6.2.1). The paper's baseline."""

from __future__ import annotations

from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.pose.estimate import PoseEstimate
from knowledge_sources.methods.pose.line_set import LandmarkIds, LineSet, build_line_set, check_landmarks
from knowledge_sources.methods.pose.numerics.finish import (
    FEW_LINES,
    build_estimate,
    build_prior_estimate,
    check_in_front,
    compute_covariance,
    reject_behind,
)
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import (
    Minimum,
    NormalEquations,
    build_normal_equations,
    compute_rotations,
    cross,
    invert_information,
    minimise,
)
from knowledge_sources.methods.pose.numerics.plane_error import (
    Weighting,
    compute_camera_ends,
    compute_end_noise,
    compute_line_weights,
    compute_plane_distances,
    compute_plane_jacobian,
    compute_translation,
    shape_gain,
)
from knowledge_sources.methods.pose.r_and_t import MIN_LINES
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.pose import PoseSettings
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
    end = _minimise_rotation(lines, prior, weights, settings)
    rotation = end.state
    translation = compute_translation(lines, rotation, prior.translation, weights)
    misses = compute_plane_distances(lines, compute_camera_ends(lines, rotation, translation))
    cost = float(np.sum(weights[:, None] * misses**2))
    gain = _compute_gain(lines, rotation, translation, weights)
    kept = reject_behind(lines, rotation, translation)
    covariance = compute_covariance(lines, rotation, translation, kept, gain, settings)
    estimate = build_estimate(lines, rotation, translation, covariance, kept, cost, end.iterations, None, settings)
    return check_in_front(lines, prior, estimate, settings)


def _minimise_rotation(lines: LineSet, prior: Pose, weights: Floats, settings: PoseSettings) -> Minimum[Floats]:
    root = np.sqrt(weights)[:, None]

    def linearise(rotation: Floats) -> NormalEquations:
        turned = lines.directions @ rotation.T
        misses = np.sum(lines.normals * turned, axis=1, keepdims=True)
        return build_normal_equations(misses * root, cross(turned, lines.normals) * root)

    def retract(rotation: Floats, step: Floats) -> Floats:
        return np.asarray(compute_rotations(step) @ rotation)

    return minimise(prior.rotation, linearise, retract, settings.max_iterations)


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
