"""How much a picture speaks for a pose, so that two poses can be compared: a log likelihood with dependent lines.

Each line that is found where the pose predicts it speaks for the pose, each that ought to be seen and is not speaks
against it. Lines that coincide in the picture, or lie on one another's extension, are one observation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Indices
from knowledge_sources.methods.verification.agreement import compute_coverage
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.verification import VerificationSettings


@dataclass(frozen=True, slots=True, eq=False)
class PoseScore:
    """How much a picture speaks for a pose.

    Attributes:
        log_likelihood: against a picture of anything else; comparable between poses, given the same chance.
        coverage: (m,) covered part of each line; NaN where it is not in view.
        groups: (m,) number of the observation that each line belongs to; -1 where it is not in view.
    """

    log_likelihood: float
    coverage: Floats
    groups: Indices

    @property
    def count(self) -> int:
        """Number of observations."""
        return int(self.groups.max(initial=-1)) + 1


def compute_pose_score(
    lines_px: Floats, segments_px: Floats, chance: float, settings: VerificationSettings = DEFAULT.verification
) -> PoseScore:
    """Score lines (m, 2, 2) as a pose predicts them, NaN where not in view, by segments (k, 2, 2).

    ``chance`` is the probability that a line is found at a wrong pose.
    """
    coverage = compute_coverage(
        lines_px, segments_px, settings.line_tolerance_px, settings.line_tolerance_rad, settings)
    groups = group_lines(lines_px, settings)
    seen = groups >= 0
    lengths = np.linalg.norm(lines_px[seen, 1] - lines_px[seen, 0], axis=1)
    whole = np.bincount(groups[seen], weights=lengths)
    part = np.bincount(groups[seen], weights=lengths * coverage[seen]) / np.maximum(whole, 1e-9)
    weights = np.minimum(whole / settings.full_line_px, 1.0)
    found, missed = compute_line_odds(chance, settings)
    value = settings.line_independence * float(np.sum(weights * (part * found + (1.0 - part) * missed)))
    return PoseScore(value, coverage, groups)


def compute_line_odds(chance: float, settings: VerificationSettings = DEFAULT.verification) -> tuple[float, float]:
    """The log likelihood ratios of a line that is found, and of one that is not, where the pose predicts it."""
    rate = settings.detection_rate
    chance = min(max(chance, settings.min_score_chance), settings.max_score_chance)
    return math.log(rate / chance), math.log((1.0 - rate) / (1.0 - chance))


def group_lines(lines_px: Floats, settings: VerificationSettings = DEFAULT.verification) -> Indices:
    """Number (m,) the observations that lines (m, 2, 2) belong to: of one line in the picture, each counts once.

    The longest line leads a group; -1 where a line is not in view.
    """
    lines = np.array(lines_px, float, order="C").reshape(-1, 2, 2)
    lengths = np.nan_to_num(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1))
    order = np.argsort(-lengths, kind="stable")
    groups: Indices = _group(lines, order, settings.same_line_px, math.sin(settings.same_line_rad))
    return groups


@njit(cache=True, error_model="numpy")
def _group(lines: Any, order: Any, tolerance_px: float, sine: float) -> Any:
    """(m,) group of each line: the first leader near whose infinite line both of its ends lie."""
    groups, leaders, count = np.full(len(lines), -1, np.intp), np.empty(len(lines), np.intp), 0
    for i in order:
        if not np.isfinite(lines[i, 0, 0] + lines[i, 1, 0] + lines[i, 0, 1] + lines[i, 1, 1]):
            continue
        for g in range(count):
            k = leaders[g]
            u0, v0 = lines[k, 0, 0], lines[k, 0, 1]
            u, v = lines[k, 1, 0] - u0, lines[k, 1, 1] - v0
            length = max(math.hypot(u, v), 1e-9)
            u, v = u / length, v / length
            x, y = lines[i, 1, 0] - lines[i, 0, 0], lines[i, 1, 1] - lines[i, 0, 1]
            if abs(u * y - v * x) > sine * max(math.hypot(x, y), 1e-9):
                continue
            first = abs((lines[i, 0, 0] - u0) * v - (lines[i, 0, 1] - v0) * u)
            second = abs((lines[i, 1, 0] - u0) * v - (lines[i, 1, 1] - v0) * u)
            if max(first, second) <= tolerance_px:
                groups[i] = g
                break
        if groups[i] < 0:
            leaders[count] = i
            groups[i] = count
            count += 1
    return groups
