"""Which subsets of lines or landmarks a combinatorial solver tries (§6.2.4, step 1)."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Groups = list[NDArray[np.intp]]


def count_subsets(size: int, outliers: float, probability: float) -> int:
    """Random subsets to draw so that one is free of outliers with the stated probability."""
    if not (0.0 <= outliers < 1.0 and 0.0 < probability < 1.0):
        raise ValueError(f"expected outliers in [0, 1) and probability in (0, 1), got {outliers} and {probability}")
    clean = (1.0 - outliers) ** size
    return 1 if clean >= 1.0 else max(1, math.ceil(math.log1p(-probability) / math.log1p(-clean)))


def list_subsets(
    count: int, size: int, needed: int | None = None, rng: np.random.Generator | None = None
) -> NDArray[np.intp]:
    """Subsets (k, size) of ``count`` groups: all of them, or ``needed`` different ones drawn with ``rng``."""
    total = math.comb(count, size)
    if needed is None or needed >= total:
        return np.array(list(combinations(range(count), size)), dtype=np.intp).reshape(-1, size)
    if rng is None:
        raise ValueError(f"expected an rng to draw {needed} of {total} subsets, got None")
    keys = rng.random((needed, count))
    drawn = np.sort(np.argpartition(keys, size - 1, axis=1)[:, :size], axis=1)
    return np.unique(drawn, axis=0).astype(np.intp)


def padded_rows(groups: Groups, subsets: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Line indices (k, w) of each subset of groups, padded with 0, and weights (k, w) that are 0 on the padding."""
    width = max((len(g) for g in groups), default=0)
    table = np.zeros((len(groups), width), dtype=np.intp)
    real = np.zeros((len(groups), width))
    for i, rows in enumerate(groups):
        table[i, : len(rows)] = rows
        real[i, : len(rows)] = 1.0
    return table[subsets].reshape(len(subsets), -1), real[subsets].reshape(len(subsets), -1)
