"""Does the picture agree with a pose, and how easily would it agree with a wrong one?

Agreement is counted a contrario: how many of the expected lines are accounted for at the pose, against how many are at
displaced poses, where they are accounted for by chance. The binomial tail is the probability that as much agrees at a
wrong place (Desolneux, Moisan, Morel: From Gestalt Theory to Image Analysis, 2008, ch. 3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

Floats = NDArray[np.float64]
CELLS = 24
PLACES = 1e3
"""Resolvable poses within the matcher's reach, each of which might agree by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """What of the expected lines is accounted for.

    Attributes:
        coverage: (m,) part of each line that some segment lies on, NaN where the line is not in view.
        chance: probability that a line is accounted for at a wrong pose.
        p_false: probability that as many lines are accounted for at a wrong pose.
    """

    coverage: Floats
    chance: float
    p_false: float

    @property
    def seen(self) -> int:
        """How many lines are in view."""
        return int(np.count_nonzero(~np.isnan(self.coverage)))

    @property
    def accounted(self) -> int:
        """How many lines are accounted for, by half their length or more."""
        return int(np.count_nonzero(np.nan_to_num(self.coverage) >= 0.5))

    def total(self, lengths_px: Floats) -> float:
        """Part of the length in view that is accounted for, 0..1."""
        here = ~np.isnan(self.coverage)
        length = float(np.sum(lengths_px[here]))
        return float(np.sum(self.coverage[here] * lengths_px[here])) / length if length > 0 else 0.0


def coverage(lines_px: Floats, segments_px: Floats, tolerance_px: float, tolerance_rad: float) -> Floats:
    """(m,) part of each line (m, 2, 2) that lies under segments (k, 2, 2) within the tolerances."""
    if not len(lines_px) or not len(segments_px):
        return np.where(np.isnan(lines_px).any(axis=(1, 2)), np.nan, 0.0)
    a, d = lines_px[:, 0], lines_px[:, 1] - lines_px[:, 0]
    length = np.maximum(np.linalg.norm(d, axis=1), 1e-9)
    u = d / length[:, None]
    n = np.stack([-u[:, 1], u[:, 0]], axis=1)
    ends = segments_px[None] - a[:, None, None]  # (m, k, 2, 2)
    off = np.abs(np.einsum("mkej,mj->mke", ends, n)).max(axis=2)
    t = np.sort(np.einsum("mkej,mj->mke", ends, u), axis=2)
    s = segments_px[:, 1] - segments_px[:, 0]
    s = s / np.maximum(np.linalg.norm(s, axis=1), 1e-9)[:, None]
    turned = np.abs(n @ s.T)
    lies = (off <= tolerance_px) & (turned <= np.sin(tolerance_rad))
    cells = (np.arange(CELLS) + 0.5) / CELLS * length[:, None]
    under = (t[:, :, :1] <= cells[:, None]) & (t[:, :, 1:] >= cells[:, None]) & lies[:, :, None]
    return np.where(np.isnan(lines_px).any(axis=(1, 2)), np.nan, under.any(axis=1).mean(axis=1))


def agreement(
    lines_px: Floats,
    segments_px: Floats,
    displaced_px: Callable[[int], Floats | None],
    *,
    tolerance_px: float = 2.5,
    tolerance_rad: float = 0.06,
) -> Agreement:
    """Agreement of lines projected at a pose (m, 2, 2; NaN: not in view) with segments (k, 2, 2).

    ``displaced_px(i)`` gives the same lines at the i-th wrong pose nearby, None when there are no more.
    """
    here = coverage(lines_px, segments_px, tolerance_px, tolerance_rad)
    counts = []
    for i in range(64):
        wrong = displaced_px(i)
        if wrong is None:
            break
        there = coverage(wrong, segments_px, tolerance_px, tolerance_rad)
        if np.any(~np.isnan(there)):
            counts.append(float(np.mean(there[~np.isnan(there)] >= 0.5)))
    chance = min(0.95, max(0.02, float(np.mean(counts)) if counts else 1.0))
    found = Agreement(here, chance, 1.0)
    p = PLACES * float(binom.sf(found.accounted - 1, found.seen, chance)) if found.seen else 1.0
    return Agreement(here, chance, min(1.0, p))
