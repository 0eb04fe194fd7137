"""Doors in curved walls: a curved wall is many short sides in a file; it is straightened at each door."""

from __future__ import annotations

import numpy as np

from harvey_buildings.polygons import Floats
from world_models.building.geometry.outlines import is_simple

JAMB_M = 0.06
"""Straight wall on either side of the door."""
MAX_WALL_DISTANCE_M = 0.6
"""A wall further from the middle of a door is not the one it is in."""
MAX_SAGITTA_M = 0.25
"""A corner further off the door's line is a corner of the room, not of a curve."""
MIN_SIDE_M = 0.04
"""Corners nearer than this to the ends of the new side are dropped."""


def straighten_wall(outline: Floats, centre: Floats, along: Floats, width_m: float) -> Floats | None:
    """The outline (k, 2) with one side, parallel to a door, at the door; None where it has one or cannot have one.

    Args:
        centre, along: (2,) middle and direction of the door on the plan [m].
        width_m: of the door.
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
    if np.abs(off[between] - level).max() > MAX_SAGITTA_M or np.abs(np.array(ends) - level).max() > MAX_SAGITTA_M:
        return None
    new = [centre + sign * ahead * half * along + level * normal for sign in (-1.0, 1.0)]
    kept = [outline[(end + i) % count] for i in range(count - len(between))]
    kept = [p for p in kept if min(float(np.linalg.norm(p - q)) for q in new) > MIN_SIDE_M]
    changed = np.round(np.array([*kept, *new]), 4)
    return changed if len(changed) >= 4 and is_simple(changed) else None


def _crossing(s: Floats, off: Floats) -> int | None:
    """Index of the side that passes the middle of the door nearest; None where none is near."""
    best: tuple[float, int] | None = None
    for i in range(len(s)):
        j = (i + 1) % len(s)
        if (s[i] < 0.0) != (s[j] < 0.0):
            away = abs(_off_at(s, off, i, j, 0.0))
            if away < MAX_WALL_DISTANCE_M and (best is None or away < best[0]):
                best = away, i
    return best[1] if best else None


def _off_at(s: Floats, off: Floats, i: int, j: int, at: float) -> float:
    """Distance off the door's line of the side from corner i to j, at position ``at`` along the line [m]."""
    part = (at - s[i]) / (s[j] - s[i]) if abs(s[j] - s[i]) > 1e-9 else 0.5
    return float(off[i] + min(max(part, 0.0), 1.0) * (off[j] - off[i]))
