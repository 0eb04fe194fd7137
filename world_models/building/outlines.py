"""Outlines: simple polygons on the floor, counter-clockwise; what lies in them and how they are cut."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def inside_polygon(point: NDArray[np.float64], polygon: NDArray[np.float64], margin_m: float = 0.0) -> bool:
    """Whether a point (2,) lies in a simple polygon (k, 2) or at most ``margin_m`` from its border."""
    x, y = point.tolist()
    sides = _sides(polygon)
    if _distance(x, y, sides) <= margin_m + 1e-9:
        return True
    crossings = sum(1 for ax, ay, bx, by in sides if (ay > y) != (by > y) and ax + (y - ay) / (by - ay) * (bx - ax) > x)
    return crossings % 2 == 1


def distance_to_border(point: NDArray[np.float64], polygon: NDArray[np.float64]) -> float:
    """Distance [m] of a point (2,) from the nearest side of a polygon (k, 2)."""
    x, y = point.tolist()
    return _distance(x, y, _sides(polygon))


def _sides(polygon: NDArray[np.float64]) -> list[tuple[float, float, float, float]]:
    """Both ends of each side in plain numbers: there are few, and they are asked often."""
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
    """Whether a polygon (k, 2) is counter-clockwise, with sides of 1 cm and more that meet only in their corners."""
    ahead = np.roll(outline, -1, axis=0)
    area = 0.5 * float(np.sum(outline[:, 0] * ahead[:, 1] - outline[:, 1] * ahead[:, 0]))
    if area < 1e-4 or np.linalg.norm(ahead - outline, axis=1).min() < 0.01:
        return False
    k = len(outline)
    for i in range(k):
        for j in range(i + 1, k):
            apart = j - i > 1 and (i, j) != (0, k - 1)
            if apart and _touching(outline[i], ahead[i], outline[j], ahead[j]):
                return False
    return all(distance_to_border(outline[i], np.stack([outline[i - 2], outline[i - 1]])) > 1e-3 for i in range(k))


def _touching(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64]) -> bool:
    """Whether two segments come nearer than 1 mm."""
    def side(p: NDArray[np.float64], q: NDArray[np.float64], r: NDArray[np.float64]) -> float:
        u, v = q - p, r - p
        return float(u[0] * v[1] - u[1] * v[0])

    if side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0:
        return True
    pairs = ((a, c, d), (b, c, d), (c, a, b), (d, a, b))
    return min(distance_to_border(p, np.stack([q, r])) for p, q, r in pairs) < 1e-3


def convex_pieces(outline: NDArray[np.float64]) -> list[list[int]]:
    """A simple counter-clockwise polygon (k, 2) cut into convex ones, as vertex numbers (by clipping ears)."""
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
