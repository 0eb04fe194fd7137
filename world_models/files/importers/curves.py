"""Doors in curved walls: the wall, which is many short sides in a file, is made straight where the door is."""

from __future__ import annotations

import numpy as np

from world_models.building.outlines import is_simple
from world_models.files.importers.outlines import Floats

JAMB_M = 0.06
"""Straight wall on either side of the door."""
NEAR_M = 0.6
"""A wall further from the middle of a door is not the one it is in."""
DEEPEST_M = 0.25
"""A corner that is further off the door's line is one of the room, not of a curve."""
SHORT_M = 0.04


def straight_at(outline: Floats, centre: Floats, along: Floats, width_m: float) -> Floats | None:
    """The outline with one side where a door of this width is, parallel to it; None where that is so, or it cannot be.

    ``centre`` and ``along`` (2,) are the middle and the direction of the door on the plan.
    """
    normal = np.array([-along[1], along[0]])
    s, off = (outline - centre) @ along, (outline - centre) @ normal
    first = _crossing(s, off)
    if first is None:
        return None
    half, count = width_m / 2 + JAMB_M, len(outline)
    ahead = 1.0 if s[(first + 1) % count] > s[first] else -1.0
    start, end = first, (first + 1) % count
    while ahead * s[start] > -half and start != end:
        start = (start - 1) % count
    while ahead * s[end] < half and start != end:
        end = (end + 1) % count
    between = [(start + 1 + i) % count for i in range((end - start - 1) % count)]
    if start == end or not between:
        return None
    ends = [_off_at(s, off, start, (start + 1) % count, -ahead * half), _off_at(s, off, (end - 1) % count, end,
                                                                                  ahead * half)]
    level = float(np.mean(ends))
    if np.abs(off[between] - level).max() > DEEPEST_M or np.abs(np.array(ends) - level).max() > DEEPEST_M:
        return None
    new = [centre + sign * ahead * half * along + level * normal for sign in (-1.0, 1.0)]
    kept = [outline[(end + i) % count] for i in range(count - len(between))]
    kept = [p for p in kept if min(float(np.linalg.norm(p - q)) for q in new) > SHORT_M]
    changed = np.round(np.array([*kept, *new]), 4)
    return changed if len(changed) >= 4 and is_simple(changed) else None


def _crossing(s: Floats, off: Floats) -> int | None:
    """The side that runs past the middle of the door, nearest to it."""
    best: tuple[float, int] | None = None
    for i in range(len(s)):
        j = (i + 1) % len(s)
        if (s[i] < 0.0) != (s[j] < 0.0):
            away = abs(_off_at(s, off, i, j, 0.0))
            if away < NEAR_M and (best is None or away < best[0]):
                best = away, i
    return best[1] if best else None


def _off_at(s: Floats, off: Floats, i: int, j: int, at: float) -> float:
    """How far off the door's line the side from i to j is, where it is ``at`` along it."""
    part = (at - s[i]) / (s[j] - s[i]) if abs(s[j] - s[i]) > 1e-9 else 0.5
    return float(off[i] + min(max(part, 0.0), 1.0) * (off[j] - off[i]))
