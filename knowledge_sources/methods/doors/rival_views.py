"""How well a leaf explains an opening, and how well what is beyond does.

Colors need not be as the model has them: light is not modelled, and walls are painted. But where the model has another
surface beyond, an open doorway shows another color. A leaf is of one color, up to light that falls off across it. Both
are fitted to the same samples, so that they share what these tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Ints

MIN_SURFACE_SAMPLES = 8  # fewest samples of a surface that has a color of its own
FITS = 5  # times that a view is fitted, each time with less weight on what it does not explain
EXPLAINED = 0.05  # difference of a log color up to which a sample counts whole
FLOOR, MOST = 0.02, 0.3
"""Differences of log colors below which none is better, and above which none is worse."""


class Views(NamedTuple):
    """How badly each view explains an opening: mean log differences of colors."""

    shut: float = 0.0
    opened: float = 0.0


ALIKE = Views()


def fit_views(logs: Floats, surfaces: Ints, across: Floats, height_m: Floats) -> Views:
    """Fit each view to log colors (n, 3) of an opening; both alike where too few samples tell them apart.

    Args:
        surfaces: (n,) which of the model's surfaces beyond is there.
        across, height_m: (n,) places in the opening.
    """
    numbers, of, counts = np.unique(surfaces, return_inverse=True, return_counts=True)
    large = counts >= MIN_SURFACE_SAMPLES
    kept = large[of]
    if np.count_nonzero(large) < 2:
        return ALIKE
    each = (of[kept][:, None] == np.arange(len(numbers))[large]).astype(float)
    light = np.column_stack([across[kept] - 0.5, height_m[kept] - 1.0])
    leaf, beyond = np.column_stack([np.ones(len(light)), light]), np.column_stack([each, light])
    return Views(_fit(leaf, logs[kept]), _fit(beyond, logs[kept]))


def _fit(view: Floats, logs: Floats) -> float:
    """How badly a view that is fitted to all samples explains them."""
    weights, off = np.ones(len(logs)), np.zeros(len(logs))
    for _ in range(FITS):
        root = np.sqrt(weights)[:, None]
        solution = np.linalg.lstsq(root * view, root * logs, rcond=None)[0]
        off = np.abs(logs - view @ solution).max(axis=1)
        weights = np.minimum(1.0, EXPLAINED / np.maximum(off, 1e-9))
    return float(np.log(np.minimum(off, MOST) + FLOOR).mean())
