"""Agreement of predicted lines with found segments, counted a contrario.

How many predicted lines are matched at the pose is compared with how many are at displaced poses, where they are
matched by chance. The binomial tail is the probability that as many are matched at a wrong pose (Desolneux, Moisan,
Morel: From Gestalt Theory to Image Analysis, 2008, ch. 3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from scipy.special import betainc

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.verification import VerificationSettings


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """How many of the predicted lines are matched.

    Attributes:
        coverage: (m,) covered part of each line, 0..1; NaN where the line is not in view.
        visible: number of lines in view.
        matched: number of lines of which enough is covered.
        chance: probability that a line is matched at a wrong pose.
        p_false: probability that as many lines are matched at a wrong pose.
    """

    coverage: Floats
    visible: int
    matched: int
    chance: float
    p_false: float

    def covered_length(self, lengths_px: Floats) -> float:
        """Covered part of the length in view, 0..1, of lines with these lengths (m,)."""
        visible = ~np.isnan(self.coverage)
        length = float(np.sum(lengths_px[visible]))
        return float(np.sum(self.coverage[visible] * lengths_px[visible])) / length if length > 0 else 0.0


def compute_agreement(
    lines_px: Floats, segments_px: Floats, displaced_px: Floats, settings: VerificationSettings = DEFAULT.verification
) -> Agreement:
    """Compute how well projected lines agree with segments, and how well they would by chance.

    Args:
        lines_px: (m, 2, 2) projected at the pose, NaN where not in view.
        segments_px: (k, 2, 2) found in the picture.
        displaced_px: (p, m, 2, 2) the same lines projected at p wrong poses nearby.
    """
    tolerances = settings.line_tolerance_px, settings.line_tolerance_rad, settings
    coverage = compute_coverage(lines_px, segments_px, *tolerances)
    displaced = compute_coverage(displaced_px.reshape(-1, 2, 2), segments_px, *tolerances)
    displaced = displaced.reshape(displaced_px.shape[:2])
    visible, matched = _count(coverage, settings.min_covered_fraction)
    visible_there, matched_there = _count(displaced, settings.min_covered_fraction)
    seen = visible_there > 0
    rate = float(np.mean(matched_there[seen] / visible_there[seen])) if np.any(seen) else 1.0
    chance = min(settings.max_chance, max(settings.min_chance, rate))
    p_false = compute_p_false(int(matched), int(visible), chance, settings)
    return Agreement(coverage, int(visible), int(matched), chance, p_false)


def compute_p_false(
    matched: int, visible: int, chance: float, settings: VerificationSettings = DEFAULT.verification
) -> float:
    """Compute the probability that so many of the visible lines are matched at a wrong pose (binomial tail)."""
    if not visible:
        return 1.0
    # As scipy.stats.binom.sf to the bit, whose import takes a quarter of a second.
    tail = float(betainc(matched, visible - matched + 1, chance)) if matched else 1.0
    return min(1.0, settings.test_count * tail)


def compute_coverage(
    lines_px: Floats, segments_px: Floats, tolerance_px: float, tolerance_rad: float,
    settings: VerificationSettings = DEFAULT.verification,
) -> Floats:
    """Compute the part (m,) of each line (m, 2, 2) that lies under segments (k, 2, 2) within the tolerances."""
    lines, segments = np.array(lines_px, float, order="C"), np.array(segments_px, float, order="C")
    covered: Floats = _cover(lines, segments, tolerance_px, math.sin(tolerance_rad), settings.cells_per_line)
    return covered


def _count(coverage: Floats, min_covered: float) -> Any:
    """Numbers of visible and of matched lines along the last axis."""
    return np.count_nonzero(~np.isnan(coverage), axis=-1), np.count_nonzero(coverage >= min_covered, axis=-1)


@njit(cache=True, error_model="numpy")
def _cover(lines: Any, segments: Any, tolerance_px: float, sine: float, cells: int) -> Any:
    """(m,) part of the cells of each line over which a near and parallel segment lies; NaN where not in view."""
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
        under = np.zeros(cells, np.bool_)
        for k in range(len(segments)):
            if abs(u * directions[k, 1] - v * directions[k, 0]) > sine:
                continue
            low, high, off = math.inf, -math.inf, 0.0
            for e in range(2):
                x, y = segments[k, e, 0] - u0, segments[k, e, 1] - v0
                off = max(off, abs(x * v - y * u))
                low, high = min(low, x * u + y * v), max(high, x * u + y * v)
            if off <= tolerance_px:
                for c in range(cells):
                    at = (c + 0.5) / cells * length
                    if low <= at <= high:
                        under[c] = True
        out[i] = np.sum(under) / cells
    return out
