"""Does the picture agree with a pose, and how easily would it agree with a wrong one?

Agreement is counted a contrario: how many of the expected lines are matched for at the pose, against how many are at
displaced poses, where they are matched for by chance. The binomial tail is the probability that as much agrees at a
wrong place (Desolneux, Moisan, Morel: From Gestalt Theory to Image Analysis, 2008, ch. 3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.stats import binom

Floats = NDArray[np.float64]
CELLS = 24
PLACES = 1e3
"""Resolvable poses within the matcher's reach, each of which might agree by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """What of the expected lines is matched for.

    Attributes:
        coverage: (m,) part of each line that some segment lies on, NaN where the line is not in view.
        chance: probability that a line is matched for at a wrong pose.
        p_false: probability that as many lines are matched for at a wrong pose.
    """

    coverage: Floats
    chance: float
    p_false: float

    @property
    def visible(self) -> int:
        """How many lines are in view."""
        return int(np.count_nonzero(~np.isnan(self.coverage)))

    @property
    def matched(self) -> int:
        """How many lines are matched for, by half their length or more."""
        return int(np.count_nonzero(np.nan_to_num(self.coverage) >= 0.5))

    def total(self, lengths_px: Floats) -> float:
        """Part of the length in view that is matched for, 0..1."""
        here = ~np.isnan(self.coverage)
        length = float(np.sum(lengths_px[here]))
        return float(np.sum(self.coverage[here] * lengths_px[here])) / length if length > 0 else 0.0


def compute_coverage(lines_px: Floats, segments_px: Floats, tolerance_px: float, tolerance_rad: float) -> Floats:
    """(m,) part of each line (m, 2, 2) that lies under segments (k, 2, 2) within the tolerances."""
    lines, segments = np.array(lines_px, float, order="C"), np.array(segments_px, float, order="C")
    covered: Floats = _covered(lines, segments, tolerance_px, math.sin(tolerance_rad))
    return covered


@njit(cache=True, error_model="numpy")
def _covered(lines: Any, segments: Any, tolerance_px: float, sine: float) -> Any:
    """(m,) share of CELLS cells of each line over which some near and parallel segment lies; NaN out of view."""
    out = np.empty(len(lines))
    directions = np.empty((len(segments), 2))
    for k in range(len(segments)):
        u, v = segments[k, 1, 0] - segments[k, 0, 0], segments[k, 1, 1] - segments[k, 0, 1]
        size = max(math.hypot(u, v), 1e-9)
        directions[k, 0], directions[k, 1] = u / size, v / size
    for i in range(len(lines)):
        u0, v0 = lines[i, 0, 0], lines[i, 0, 1]
        u, v = lines[i, 1, 0] - u0, lines[i, 1, 1] - v0
        length = max(math.hypot(u, v), 1e-9)
        if not (math.isfinite(u0) and math.isfinite(v0) and math.isfinite(u) and math.isfinite(v)):
            out[i] = math.nan
            continue
        u, v = u / length, v / length
        under = np.zeros(CELLS, np.bool_)
        for k in range(len(segments)):
            if abs(u * directions[k, 1] - v * directions[k, 0]) > sine:
                continue
            low, high, off = math.inf, -math.inf, 0.0
            for e in range(2):
                x, y = segments[k, e, 0] - u0, segments[k, e, 1] - v0
                off = max(off, abs(x * v - y * u))
                low, high = min(low, x * u + y * v), max(high, x * u + y * v)
            if off <= tolerance_px:
                for c in range(CELLS):
                    at = (c + 0.5) / CELLS * length
                    if low <= at <= high:
                        under[c] = True
        out[i] = np.sum(under) / CELLS
    return out


def compute_agreement(
    lines_px: Floats,
    segments_px: Floats,
    displaced_px: Floats,
    *,
    tolerance_px: float = 2.5,
    tolerance_rad: float = 0.06,
) -> Agreement:
    """Agreement of lines projected at a pose (m, 2, 2; NaN: not in view) with segments (k, 2, 2).

    ``displaced_px`` (p, m, 2, 2) are the same lines at p wrong poses nearby.
    """
    here = compute_coverage(lines_px, segments_px, tolerance_px, tolerance_rad)
    there = compute_coverage(displaced_px.reshape(-1, 2, 2), segments_px, tolerance_px, tolerance_rad)
    each = there.reshape(displaced_px.shape[:2])
    seen = np.count_nonzero(~np.isnan(each), axis=1)
    by_chance = np.count_nonzero(each >= 0.5, axis=1)[seen > 0] / seen[seen > 0]
    chance = min(0.95, max(0.02, float(np.mean(by_chance)) if len(by_chance) else 1.0))
    found = Agreement(here, chance, 1.0)
    p = PLACES * float(binom.sf(found.matched - 1, found.visible, chance)) if found.visible else 1.0
    return Agreement(here, chance, min(1.0, p))
