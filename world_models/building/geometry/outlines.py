"""Outlines: simple counter-clockwise polygons on the floor; containment, distance and convex parts; intervals.

Point tests are plain Python: outlines have few corners and are asked often, which shapely's overhead would slow down.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Interval = tuple[float, float]
"""(low, high)."""


def subtract_intervals(whole: Interval, taken: Sequence[Interval], min_length: float) -> list[Interval]:
    """The pieces of ``whole`` outside all ``taken`` intervals, at least ``min_length`` long, in order."""
    pieces, at = [], whole[0]
    for low, high in sorted(taken):
        if low > at:
            pieces.append((at, min(low, whole[1])))
        at = max(at, high)
    pieces.append((at, whole[1]))
    return [(low, high) for low, high in pieces if high - low >= min_length]


MIN_AREA_M2, MIN_SIDE_M, MIN_GAP_M = 1e-4, 0.01, 1e-3
"""What a room's outline must have: area, length of its sides, distance between sides that share no corner."""

def inside_polygon(point: NDArray[np.float64], polygon: NDArray[np.float64], margin_m: float = 0.0) -> bool:
    """Whether a point (2,) lies in a simple polygon (k, 2) or at most ``margin_m`` from its border; even-odd rule."""
    x, y = point.tolist()
    sides = _sides(polygon)
    if _distance(x, y, sides) <= margin_m + 1e-9:
        return True
    crossings = sum(1 for ax, ay, bx, by in sides if (ay > y) != (by > y) and ax + (y - ay) / (by - ay) * (bx - ax) > x)
    return crossings % 2 == 1


def distance_to_border(point: NDArray[np.float64], polygon: NDArray[np.float64]) -> float:
    """Distance [m] of a point (2,) to the nearest side of a polygon (k, 2)."""
    x, y = point.tolist()
    return _distance(x, y, _sides(polygon))


def _sides(polygon: NDArray[np.float64]) -> list[tuple[float, float, float, float]]:
    """Both ends of each side."""
    corners = polygon.tolist()
    return [(ax, ay, bx, by) for (ax, ay), (bx, by) in zip(corners, (*corners[1:], corners[0]), strict=True)]


def _distance(x: float, y: float, sides: list[tuple[float, float, float, float]]) -> float:
    nearest = math.inf
    for ax, ay, bx, by in sides:
        dx, dy = bx - ax, by - ay
        t = ((x - ax) * dx + (y - ay) * dy) / max(dx * dx + dy * dy, 1e-18)
        t = min(max(t, 0.0), 1.0)
        u, v = ax + t * dx - x, ay + t * dy - y
        nearest = min(nearest, u * u + v * v)
    return math.sqrt(nearest)


def is_simple(outline: NDArray[np.float64]) -> bool:
    """Whether a polygon (k, 2) is counter-clockwise and simple, with sides of at least 1 cm.

    Sides that share no corner must be 1 mm apart, and no corner may lie within 1 mm of the side before last.
    """
    import shapely  # slow to import, and of all that entries need only used here

    ahead = np.roll(outline, -1, axis=0)
    area = 0.5 * float(np.sum(outline[:, 0] * ahead[:, 1] - outline[:, 1] * ahead[:, 0]))
    if area < MIN_AREA_M2 or np.linalg.norm(ahead - outline, axis=1).min() < MIN_SIDE_M:
        return False
    k = len(outline)
    sides = shapely.linestrings(np.stack([outline, ahead], axis=1))
    i, j = np.triu_indices(k, 2)
    apart = (i != 0) | (j != k - 1)
    if np.any(shapely.distance(sides[i[apart]], sides[j[apart]]) < MIN_GAP_M):
        return False
    return bool(np.all(shapely.distance(shapely.points(outline), np.roll(sides, 2)) > MIN_GAP_M))


def convex_pieces(outline: NDArray[np.float64]) -> list[list[int]]:
    """A simple counter-clockwise polygon (k, 2) cut into convex ones, as vertex indices (ear clipping)."""
    left = list(range(len(outline)))
    if all(_turn(outline, left[i - 2], left[i - 1], left[i]) > 0 for i in left):
        return [left]
    pieces = []
    while len(left) > 3:
        ear = next((i for i in range(len(left)) if _is_ear(outline, left, i)), 0)
        pieces.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    return [*pieces, left]


def _turn(outline: NDArray[np.float64], a: int, b: int, c: int) -> float:
    d, e = outline[b] - outline[a], outline[c] - outline[a]
    return float(d[0] * e[1] - d[1] * e[0])


def _is_ear(outline: NDArray[np.float64], left: list[int], i: int) -> bool:
    corners = left[i - 1], left[i], left[(i + 1) % len(left)]
    if _turn(outline, *corners) <= 1e-9:
        return False
    pairs = list(zip(corners, (*corners[1:], corners[0]), strict=True))
    others = [k for k in left if k not in corners]
    return not any(all(_turn(outline, a, b, k) > -1e-9 for a, b in pairs) for k in others)
