"""Outlines: simple polygons on the floor, counter-clockwise; what lies in them and how they are cut."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def inside_polygon(point: NDArray[np.float64], polygon: NDArray[np.float64], margin_m: float = 0.0) -> bool:
    """Whether a point (2,) lies in a simple polygon (k, 2) or at most ``margin_m`` from its border."""
    if distance_to_border(point, polygon) <= margin_m + 1e-9:
        return True
    a, b = polygon, np.roll(polygon, -1, axis=0)
    crosses = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    a, b = a[crosses], b[crosses]
    x = a[:, 0] + (point[1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return bool(np.count_nonzero(x > point[0]) % 2)


def distance_to_border(point: NDArray[np.float64], polygon: NDArray[np.float64]) -> float:
    """Distance [m] of a point (2,) from the nearest side of a polygon (k, 2)."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    d = b - a
    t = np.clip(np.sum((point - a) * d, axis=1) / np.maximum(np.sum(d * d, axis=1), 1e-18), 0.0, 1.0)
    return float(np.min(np.linalg.norm(a + t[:, None] * d - point, axis=1)))


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
