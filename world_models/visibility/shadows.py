"""Shadow volumes: which part of a segment, or which point, is hidden from the camera by convex one-sided surfaces.

All points and lines here are in the camera frame. Rectangles are (left, top, right, bottom) at depth 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world_models.building.intervals import subtract_intervals
from world_models.camera import NEAR_PLANE_M
from world_models.visibility.portals import Window

Floats = NDArray[np.float64]

TOUCHING_M = 0.002
"""What lies no deeper than this below a surface lies on it and is seen; details stand out by twice as much."""

SHORTEST_PIECE = 1e-6
"""Gaps between hidden intervals that are shorter than this part of a line are cracks between surfaces, not views."""


@dataclass(frozen=True, eq=False)
class Shadows:
    """Front-facing surfaces as seen by the camera.

    Attributes:
        bounds: (4, K + 1, m) columns (g, h): a point p of the camera frame is in the shadow where all g . p + h >= 0;
            the last one is the surface's own plane.
        windows: (m, 4) rectangles at depth 1 that they cannot leave.
        nearest_m: (m,) depth of their nearest corner.
    """

    bounds: Floats
    windows: Floats
    nearest_m: Floats


def shadows_of(polygons: Floats, planes: Floats, windows: Floats) -> Shadows:
    """The shadows of surfaces: polygons (m, K, 3), planes (m, 4) with normals towards the camera, rectangles (m, 4)."""
    bounds = np.zeros((4, polygons.shape[1] + 1, len(polygons)))
    x, y, z = np.ascontiguousarray(polygons.T)
    u, v, w = (np.concatenate([c[1:], c[:1]]) for c in (x, y, z))
    bounds[0, :-1], bounds[1, :-1], bounds[2, :-1] = z * v - y * w, x * w - z * u, y * u - x * v
    bounds[:3, -1] = -planes[:, :3].T
    bounds[3, -1] = planes[:, 3] - TOUCHING_M
    return Shadows(bounds, windows, z.min(axis=0))


def clipped_spans(lines: Floats, window: Window) -> Floats:
    """(n, 2) the part of each segment (n, 2, 3) of the camera frame that is in front and within the window."""
    x0, y0, x1, y1 = window
    x, y, z = (lines[..., i].T for i in range(3))
    values = np.stack([z - NEAR_PLANE_M, x - x0 * z, x1 * z - x, y - y0 * z, y1 * z - y])
    return _interval(values[:, 0], values[:, 1])


def _interval(start: Floats, end: Floats) -> Floats:
    """(n, 2) where k linear functions are all >= 0, by their values (k, n) at 0 and at 1; empty where low >= high."""
    before, after = start < 0, end < 0
    with np.errstate(divide="ignore", invalid="ignore"):
        root = start / (start - end)
    low = np.where(before, np.where(after, 2.0, root), 0.0)
    high = np.where(after & ~before, root, 1.0)
    return np.stack([low.max(axis=0), high.min(axis=0)], axis=1)


def pieces(lines: Floats, span: Floats) -> Floats:
    """(n, 2, 3) the parts of segments between two parameters each (n, 2)."""
    a, d = lines[:, :1], lines[:, 1:] - lines[:, :1]
    return np.asarray(a + span[:, :, None] * d)


def lengths_px(segments_px: Floats) -> Floats:
    """(n,) [px]."""
    return np.asarray(np.hypot(*(segments_px[:, 1] - segments_px[:, 0]).T))


def rectangles(points: Floats) -> Floats:
    """(n, 4) rectangles at depth 1 round n sets of points (n, k, 3); without bounds where one is not in front."""
    x, y, z = np.ascontiguousarray(points.T)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = x / z, y / z
    found = np.stack([x.min(axis=0), y.min(axis=0), x.max(axis=0), y.max(axis=0)], axis=1)
    found[z.min(axis=0) < 0.99 * NEAR_PLANE_M] = (-np.inf, -np.inf, np.inf, np.inf)
    return found


def overlap(one: Floats, other: Floats) -> NDArray[np.bool_]:
    """Whether rectangles (..., 4) have a point in common."""
    found = (one[..., 0] <= other[..., 2]) & (one[..., 1] <= other[..., 3])
    found &= (other[..., 0] <= one[..., 2]) & (other[..., 1] <= one[..., 3])
    return np.asarray(found)


def visible_spans(lines: Floats, shadows: Shadows) -> tuple[NDArray[np.int64], Floats]:
    """The visible parts of segments (n, 2, 3): which segment (k,), and from where to where (k, 2)."""
    near_enough = shadows.nearest_m[None, :] < np.maximum(lines[:, 0, 2], lines[:, 1, 2])[:, None]
    line, surface = np.nonzero(overlap(rectangles(lines)[:, None], shadows.windows[None]) & near_enough)
    behind = shadows.bounds[:, -1]
    beyond = np.maximum(*(_value(behind[:, surface], lines[line, end]) for end in (0, 1))) >= 0
    line, surface = line[beyond], surface[beyond]
    bounds = shadows.bounds[:, :, surface]
    hidden = _interval(_value(bounds, lines[line, 0]), _value(bounds, lines[line, 1]))
    some = hidden[:, 1] > hidden[:, 0]
    taken: list[list[tuple[float, float]]] = [[] for _ in lines]
    for number, low, high in zip(line[some].tolist(), *hidden[some].T.tolist(), strict=True):
        taken[number].append((low, high))
    whole = [(0.0, 1.0)]
    rows = [(number, *span) for number, parts in enumerate(taken)
            for span in (subtract_intervals((0.0, 1.0), parts, SHORTEST_PIECE) if parts else whole)]
    table = np.array(rows, float).reshape(-1, 3)
    return table[:, 0].astype(np.int64), table[:, 1:]


def _value(bounds: Floats, points: Floats) -> Floats:
    """(..., n) g . p + h for bounds (4, ..., n) and points (n, 3)."""
    gx, gy, gz, h = bounds
    x, y, z = points.T
    return np.asarray(gx * x + gy * y + gz * z + h)


def hidden_points(points: Floats, shadows: Shadows) -> NDArray[np.bool_]:
    """(n,) whether points (n, 3) lie in a shadow."""
    near_enough = shadows.nearest_m[None, :] < points[:, 2:]
    point, surface = np.nonzero(overlap(rectangles(points[:, None])[:, None], shadows.windows[None]) & near_enough)
    inside = np.all(_value(shadows.bounds[:, :, surface], points[point]) >= 0, axis=0)
    hidden = np.zeros(len(points), bool)
    hidden[point[inside]] = True
    return hidden
