"""How well a leaf explains an opening, and how well its rivals do: what is beyond, and a leaf that is ajar.

Colors need not be as the model has them: light is not modelled, and walls are painted. But where the model has another
surface beyond, an open doorway shows another color. A leaf is of one color, up to light that falls off across it. One
that is ajar hides what is beyond from one jamb on. All three are fitted to the same samples, so that they share what
these tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Ints, Mask

MIN_SURFACE_SAMPLES = 8  # fewest samples of a surface that has a color of its own
MIN_PART_SAMPLES = 20  # fewest samples of a leaf that is ajar, and of what is left open
AJAR_PARTS = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Parts of an opening that a leaf may hide, from either jamb."""
FITS = 5  # times that a view is fitted, each time with less weight on what it does not explain
EXPLAINED = 0.05  # difference of a log color up to which a sample counts whole
FLOOR, MOST = 0.02, 0.3
"""Differences of log colors below which none is better, and above which none is worse."""


class Views(NamedTuple):
    """How badly each view explains an opening: mean log differences of colors."""

    shut: float = 0.0
    opened: float = 0.0
    ajar: float = 0.0



ALIKE = Views()


def fit_views(logs: Floats, surfaces: Ints, across: Floats, height_m: Floats) -> Views:
    """Fit each view to log colors (n, 3) of an opening; all alike where too few samples tell them apart.

    Args:
        surfaces: (n,) which of the model's surfaces beyond is there.
        across, height_m: (n,) places in the opening.
    """
    numbers, of, counts = np.unique(surfaces, return_inverse=True, return_counts=True)
    large = counts >= MIN_SURFACE_SAMPLES
    kept = large[of]
    if np.count_nonzero(large) < 2:
        return ALIKE
    logs, of, across = logs[kept], of[kept], across[kept]
    each = (of[:, None] == np.arange(len(numbers))[large]).astype(float)
    light = np.column_stack([across - 0.5, height_m[kept] - 1.0])
    leaf, beyond = np.column_stack([np.ones(len(logs)), light]), np.column_stack([each, light])
    halves = [hidden for part in AJAR_PARTS for hidden in (across < part, across > 1.0 - part)
              if MIN_PART_SAMPLES <= np.count_nonzero(hidden) <= len(logs) - MIN_PART_SAMPLES]
    ajar = [_measure(np.where(hidden, _fit(leaf, logs, hidden), _fit(beyond, logs, ~hidden))) for hidden in halves]
    everywhere = np.ones(len(logs), bool)
    shut, opened = (_measure(_fit(view, logs, everywhere)) for view in (leaf, beyond))
    return Views(shut, opened, min(ajar, default=max(shut, opened)))


def _fit(view: Floats, logs: Floats, where: Mask) -> Floats:
    """(n,) the largest difference of each sample from a view that was fitted where it holds."""
    weights, off = where.astype(float), np.zeros(len(logs))
    for _ in range(FITS):
        root = np.sqrt(weights)[:, None]
        solution = np.linalg.lstsq(root * view, root * logs, rcond=None)[0]
        off = np.abs(logs - view @ solution).max(axis=1)
        weights = where * np.minimum(1.0, EXPLAINED / np.maximum(off, 1e-9))
    return np.asarray(off)


def _measure(off: Floats) -> float:
    return float(np.log(np.minimum(off, MOST) + FLOOR).mean())
