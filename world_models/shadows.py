"""Shadow volumes: which part of a segment, or which point, is hidden from the camera by convex one-sided surfaces.

All points and lines here are in the camera frame. Rectangles are (left, top, right, bottom) at depth 1.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from world_models.camera import NEAR_M
from world_models.geometer import left_over
from world_models.portals import Window

Floats = NDArray[np.float64]

TOUCHING_M = 0.002
"""What lies no deeper than this below a surface lies on it and is seen; details stand out by twice as much."""

SHORTEST_PIECE = 1e-6
"""Gaps between hidden intervals that are shorter than this part of a line are cracks between surfaces, not views."""


@dataclass(frozen=True, eq=False)
class Shadows:
    """Front-facing surfaces as seen by the camera.

    Attributes:
        bounds: (K + 1, m, 4) rows (g, h): a point p of the camera frame is in the shadow where all g . p + h >= 0.
        windows: (m, 4) rectangles at depth 1 that they cannot leave.
        nearest_m: (m,) depth of their nearest corner.
    """

    bounds: Floats
    windows: Floats
    nearest_m: Floats


def shadows_of(polygons: Floats, planes: Floats, windows: Floats) -> Shadows:
    """The shadows of surfaces: polygons (m, K, 3), planes (m, 4) with normals towards the camera, rectangles (m, 4)."""
    bounds = np.zeros((polygons.shape[1] + 1, len(polygons), 4))
    x, y, z = np.moveaxis(polygons, (2, 1), (0, 1))
    u, v, w = (np.concatenate([c[1:], c[:1]]) for c in (x, y, z))
    bounds[:-1, :, 0], bounds[:-1, :, 1], bounds[:-1, :, 2] = z * v - y * w, x * w - z * u, y * u - x * v
    bounds[-1, :, :3] = -planes[:, :3]
    bounds[-1, :, 3] = planes[:, 3] - TOUCHING_M
    return Shadows(bounds, windows, over_corners(np.minimum, polygons[..., 2]))


def over_corners(least_or_most: np.ufunc, values: Floats) -> Floats:
    """(m,) the least or most of (m, k) values: quicker than along an axis where k is small."""
    return reduce(least_or_most, np.moveaxis(values, 1, 0))


def clipped_spans(lines: Floats, window: Window) -> Floats:
    """(n, 2) the part of each segment (n, 2, 3) of the camera frame that is in front and within the window."""
    x0, y0, x1, y1 = window
    x, y, z = np.moveaxis(lines, 2, 0)
    values = z - NEAR_M, x - x0 * z, x1 * z - x, y - y0 * z, y1 * z - y
    return _interval(((value[:, 0], value[:, 1]) for value in values), len(lines))


def _interval(bounds: Iterable[tuple[Floats, Floats]], count: int) -> Floats:
    """(n, 2) where linear functions are all >= 0, given by their values (n,) at 0 and at 1; empty where low >= high."""
    low, high = np.zeros(count), np.ones(count)
    for start, end in bounds:
        with np.errstate(divide="ignore", invalid="ignore"):
            root = start / (start - end)
        low = np.where(start < 0, np.where(end < 0, 2.0, np.maximum(low, root)), low)
        high = np.where((start >= 0) & (end < 0), np.minimum(high, root), high)
    return np.stack([low, high], axis=1)


def pieces(lines: Floats, span: Floats) -> Floats:
    """(n, 2, 3) the parts of segments between two parameters each (n, 2)."""
    a, d = lines[:, :1], lines[:, 1:] - lines[:, :1]
    return np.asarray(a + span[:, :, None] * d)


def lengths_px(segments_px: Floats) -> Floats:
    """(n,) [px]."""
    return np.asarray(np.hypot(*(segments_px[:, 1] - segments_px[:, 0]).T))


def rectangles(points: Floats) -> Floats:
    """(n, 4) rectangles at depth 1 round n sets of points (n, k, 3); without bounds where one is not in front."""
    z = points[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = points[..., 0] / z, points[..., 1] / z
    found = np.stack([over_corners(f, v) for f in (np.minimum, np.maximum) for v in (x, y)], axis=1)
    found[over_corners(np.minimum, z) < 0.99 * NEAR_M] = (-np.inf, -np.inf, np.inf, np.inf)
    return found


def overlap(one: Floats, other: Floats) -> NDArray[np.bool_]:
    """Whether rectangles (..., 4) have a point in common."""
    found = (one[..., 0] <= other[..., 2]) & (one[..., 1] <= other[..., 3])
    found &= (other[..., 0] <= one[..., 2]) & (other[..., 1] <= one[..., 3])
    return np.asarray(found)


def visible_spans(lines: Floats, shadows: Shadows) -> tuple[NDArray[np.int64], Floats]:
    """The visible parts of segments (n, 2, 3): which segment (k,), and from where to where (k, 2)."""
    near_enough = shadows.nearest_m[None, :] < np.maximum(lines[:, 0, 2], lines[:, 1, 2])[:, None]
    pair = np.nonzero(overlap(rectangles(lines)[:, None], shadows.windows[None]) & near_enough)
    start, end = lines[pair[0], 0], lines[pair[0], 1]
    hidden = _interval(((_value(b, start), _value(b, end)) for b in shadows.bounds[:, pair[1]]), len(start))
    some = hidden[:, 1] > hidden[:, 0]
    taken: list[list[tuple[float, float]]] = [[] for _ in lines]
    for line, low, high in zip(pair[0][some].tolist(), *hidden[some].T.tolist(), strict=True):
        taken[line].append((low, high))
    whole = [(0.0, 1.0)]
    rows = [(line, *span) for line, parts in enumerate(taken)
            for span in (left_over((0.0, 1.0), parts, SHORTEST_PIECE) if parts else whole)]
    table = np.array(rows, float).reshape(-1, 3)
    return table[:, 0].astype(np.int64), table[:, 1:]


def _value(bound: Floats, points: Floats) -> Floats:
    """(n,) g . p + h for bounds (n, 4) and points (n, 3)."""
    gx, gy, gz, h = bound.T
    return np.asarray(gx * points[:, 0] + gy * points[:, 1] + gz * points[:, 2] + h)


def hidden_points(points: Floats, shadows: Shadows) -> NDArray[np.bool_]:
    """(n,) whether points (n, 3) lie in a shadow."""
    near_enough = shadows.nearest_m[None, :] < points[:, 2:]
    pair = np.nonzero(overlap(rectangles(points[:, None])[:, None], shadows.windows[None]) & near_enough)
    inside = np.ones(len(pair[0]), bool)
    for bound in shadows.bounds[:, pair[1]]:
        inside &= _value(bound, points[pair[0]]) >= 0
    hidden = np.zeros(len(points), bool)
    hidden[pair[0][inside]] = True
    return hidden
