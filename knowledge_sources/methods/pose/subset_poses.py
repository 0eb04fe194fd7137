"""R and T on many subsets of lines at once (§6.2.4, step 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.pose.descent import cross, rotations
from knowledge_sources.methods.pose.estimate import Array
from knowledge_sources.methods.pose.image_error import image_distances
from knowledge_sources.methods.pose.lines import LineSet
from world_models.frames import Pose

CHUNK = 1024
"""Subsets solved at once: bounds the memory."""


def subset_poses(
    lines: LineSet, rows: NDArray[np.intp], real: Array, start: Pose, iterations: int = 4
) -> tuple[Array, Array]:
    """E1 poses (k, 3, 3), (k, 3) of k padded subsets ``rows`` (k, w), weights ``real`` (k, w), all from ``start``."""
    turns = np.broadcast_to(start.rotation, (len(rows), 3, 3))
    shifts = np.broadcast_to(start.translation, (len(rows), 3))
    pieces = [slice(i, i + CHUNK) for i in range(0, len(rows), CHUNK)]
    parts = [_chunk(lines, rows[p], real[p], turns[p], shifts[p], iterations) for p in pieces]
    return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])


def concentrated(lines: LineSet, turns: Array, shifts: Array, keep: int, rounds: int = 3) -> tuple[Array, Array]:
    """Poses (k, 3, 3), (k, 3), each solved again, ``rounds`` times, on the ``keep`` lines that fit it best.

    A minimal subset amplifies the noise; half of all lines do not.
    """
    for _ in range(rounds):
        errors = squared_distances(lines, turns, shifts)
        rows = np.argsort(errors, axis=1, kind="stable")[:, :keep]
        turns, shifts = _chunk(lines, rows, np.ones(rows.shape), turns, shifts, iterations=2)
    return turns, shifts


def squared_distances(lines: LineSet, turns: Array, shifts: Array) -> Array:
    """(k, n) squared image distance of each line under each pose, in units of its variance."""
    scaled = image_distances(lines, turns, shifts) / lines.sigma_px[:, None]
    return np.asarray(scaled[..., 0] ** 2 + scaled[..., 1] ** 2)


def _chunk(
    lines: LineSet, rows: NDArray[np.intp], real: Array, turns: Array, shifts: Array, iterations: int
) -> tuple[Array, Array]:
    k = len(rows)
    points = lines.points[rows].reshape(k, -1, 3)
    normals = np.repeat(lines.normals[rows], 2, axis=1) * np.repeat(real, 2, axis=1)[..., None]
    for _ in range(iterations):
        ends = points @ np.swapaxes(turns, 1, 2) + shifts[:, None, :]
        step = _steps(ends, normals)
        turn = rotations(step[:, :3])
        turns = turn @ turns
        shifts = (turn @ shifts[..., None])[..., 0] + step[:, 3:]
    return turns, shifts


def _steps(ends: Array, normals: Array) -> Array:
    """One Gauss-Newton step of E1 for each subset, (k, 6); hardly damped, so that no subset is singular."""
    jacobian = np.concatenate([cross(ends, normals), normals], axis=-1)
    misses = np.sum(ends * normals, axis=-1)
    across = np.swapaxes(jacobian, 1, 2)
    hessian = across @ jacobian
    diagonal = np.einsum("kii->ki", hessian)
    diagonal += 1e-9 * np.maximum(diagonal.max(axis=1, keepdims=True), 1e-9)
    return np.asarray(-np.linalg.solve(hessian, across @ misses[..., None])[..., 0])
