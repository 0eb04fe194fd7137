"""R and T on many subsets of lines at once (§6.2.4, step 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.pose.estimate import Array
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.numerics import line_kernels as kernels
from world_models.frames import Pose


def subset_poses(
    lines: LineSet, rows: NDArray[np.intp], real: Array, start: Pose, iterations: int = 4
) -> tuple[Array, Array]:
    """E1 poses (k, 3, 3), (k, 3) of k padded subsets ``rows`` (k, w), weights ``real`` (k, w), all from ``start``."""
    turns = np.tile(start.rotation, (len(rows), 1, 1))
    shifts = np.tile(start.translation, (len(rows), 1))
    found: tuple[Array, Array] = kernels.subset_poses(lines.arrays, rows, real, turns, shifts, iterations)
    return found


def concentrated(lines: LineSet, turns: Array, shifts: Array, keep: int, rounds: int = 3) -> tuple[Array, Array]:
    """Poses (k, 3, 3), (k, 3), each solved again, ``rounds`` times, on the ``keep`` lines that fit it best.

    A minimal subset amplifies the noise; half of all lines do not.
    """
    for _ in range(rounds):
        errors = compute_squared_distances(lines, turns, shifts)
        rows = np.ascontiguousarray(np.argsort(errors, axis=1, kind="stable")[:, :keep])
        turns, shifts = kernels.subset_poses(lines.arrays, rows, np.ones(rows.shape), turns, shifts, 2)
    return turns, shifts


def compute_squared_distances(lines: LineSet, turns: Array, shifts: Array) -> Array:
    """(k, n), or (n,) for one pose, squared image distance of each line, in units of its variance."""
    many = kernels.compute_squared_distances(
        lines.arrays, np.array(turns).reshape(-1, 3, 3), np.array(shifts).reshape(-1, 3)
    )
    return np.asarray(many if turns.ndim == 3 else many[0])
