"""E1 and E2: distance of the model lines' ends to the observed projection planes (§6.2.2)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.numerics.kernels import TINY
from knowledge_sources.methods.pose.numerics.levenberg_marquardt import cross, invert_information

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
