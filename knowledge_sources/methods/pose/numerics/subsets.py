"""Subsets of lines or landmarks: which ones are tried, and the pose of each (§6.2.4, steps 1 and 2)."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices
from knowledge_sources.methods.pose.line_set import LineSet
from knowledge_sources.methods.pose.numerics import kernels
from knowledge_sources.settings.pose import PoseSettings
from world_models.frames import Pose


def count_subsets(size: int, outliers: float, probability: float) -> int:
    """Random subsets to draw so that one is free of outliers with the stated probability (RANSAC's count).

    Raises:
        ValueError: ``outliers`` is not in [0, 1), or ``probability`` not in (0, 1).
    """
    if not (0.0 <= outliers < 1.0 and 0.0 < probability < 1.0):
        raise ValueError(f"expected outliers in [0, 1) and probability in (0, 1), got {outliers} and {probability}")
    clean = (1.0 - outliers) ** size
    return 1 if clean >= 1.0 else max(1, math.ceil(math.log1p(-probability) / math.log1p(-clean)))


def list_subsets(
    count: int, size: int, needed: int | None = None, rng: np.random.Generator | None = None
) -> Indices:
    """Subsets (k, size) of ``count`` groups: all of them, or ``needed`` different ones drawn with ``rng``.

    Raises:
        ValueError: subsets must be drawn and there is no ``rng``.
    """
    total = math.comb(count, size)
    if needed is None or needed >= total:
        return np.array(list(combinations(range(count), size)), dtype=np.intp).reshape(-1, size)
    if rng is None:
        raise ValueError(f"expected an rng to draw {needed} of {total} subsets, got None")
    keys = rng.random((needed, count))
    drawn = np.sort(np.argpartition(keys, size - 1, axis=1)[:, :size], axis=1)
    return np.unique(drawn, axis=0).astype(np.intp)


def pad_rows(groups: list[Indices], subsets: Indices) -> tuple[Indices, Floats]:
    """Line indices (k, w) of each subset of groups, padded with 0, and weights (k, w) that are 0 on the padding."""
    width = max((len(g) for g in groups), default=0)
    table = np.zeros((len(groups), width), dtype=np.intp)
    real = np.zeros((len(groups), width))
    for i, rows in enumerate(groups):
        table[i, : len(rows)] = rows
        real[i, : len(rows)] = 1.0
    return table[subsets].reshape(len(subsets), -1), real[subsets].reshape(len(subsets), -1)


def solve_subsets(
    lines: LineSet, rows: Indices, real: Floats, start: Pose, settings: PoseSettings
) -> tuple[Floats, Floats]:
    """Poses (k, 3, 3), (k, 3) of least E1 on k padded subsets ``rows`` (k, w), weights ``real``, all from ``start``."""
    rotations = np.tile(start.rotation, (len(rows), 1, 1))
    translations = np.tile(start.translation, (len(rows), 1))
    poses: tuple[Floats, Floats] = kernels.solve_subsets(
        lines.arrays, rows, real, rotations, translations, settings.subset_iterations
    )
    return poses


def concentrate(
    lines: LineSet, rotations: Floats, translations: Floats, keep: int, settings: PoseSettings
) -> tuple[Floats, Floats]:
    """Poses (k, 3, 3), (k, 3), each solved again, round by round, on the ``keep`` lines that fit it best.

    Rousseeuw's concentration steps: a minimal subset amplifies the noise; half of all lines do not.
    """
    for _ in range(settings.concentration_rounds):
        errors = compute_squared_distances(lines, rotations, translations)
        rows = np.ascontiguousarray(np.argsort(errors, axis=1, kind="stable")[:, :keep])
        rotations, translations = kernels.solve_subsets(
            lines.arrays, rows, np.ones(rows.shape), rotations, translations, settings.concentration_iterations
        )
    return rotations, translations


def compute_squared_distances(lines: LineSet, rotations: Floats, translations: Floats) -> Floats:
    """(k, n), or (n,) for one pose, squared image distance of each line, over its variance."""
    many = kernels.compute_squared_distances(
        lines.arrays, np.array(rotations).reshape(-1, 3, 3), np.array(translations).reshape(-1, 3)
    )
    return np.asarray(many if rotations.ndim == 3 else many[0])
