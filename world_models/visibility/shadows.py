"""Shadow volumes: which part of a segment, or which point, is hidden from the camera by convex one-sided surfaces.

All points and lines are in the camera frame [m]. Windows are (left, top, right, bottom) in normalized image
coordinates (x / z, y / z).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.outlines import subtract_intervals
from world_models.camera import NEAR_PLANE_M
from world_models.visibility.portals import Window

Floats = NDArray[np.float64]

CONTACT_M = 0.002
"""A point no deeper than this below a surface lies on it and is visible; details stand out by twice as much."""

MIN_PIECE = 1e-6
"""Smallest visible part of a line, relative to its length: smaller gaps are cracks between adjoining surfaces."""


@dataclass(frozen=True, eq=False)
class Shadows:
    """Shadow volumes of m front-facing surfaces with up to K corners.

    Attributes:
        bounds: (4, K + 1, m) half-spaces (g, h): a point p is in the shadow where all g . p + h >= 0; the last one is
            the surface's own plane.
        windows: (m, 4) windows round the surfaces.
        nearest_m: (m,) depth of the surface's nearest corner.
    """

    bounds: Floats
    windows: Floats
    nearest_m: Floats


def build_shadows(polygons: Floats, planes: Floats, windows: Floats) -> Shadows:
    """Shadow volumes of polygons (m, K, 3) with planes (m, 4), normals towards the camera, and windows (m, 4)."""
    bounds = np.zeros((4, polygons.shape[1] + 1, len(polygons)))
    x, y, z = np.ascontiguousarray(polygons.T)
    u, v, w = (np.concatenate([c[1:], c[:1]]) for c in (x, y, z))
    bounds[0, :-1], bounds[1, :-1], bounds[2, :-1] = z * v - y * w, x * w - z * u, y * u - x * v
    bounds[:3, -1] = -planes[:, :3].T
    bounds[3, -1] = planes[:, 3] - CONTACT_M
    return Shadows(bounds, windows, z.min(axis=0))


def clipped_spans(lines: Floats, window: Window) -> Floats:
    """(n, 2) parameters of the part of each segment (n, 2, 3) in front of the near plane and within the window."""
    x0, y0, x1, y1 = window
    x, y, z = (lines[..., i].T for i in range(3))
    values = np.stack([z - NEAR_PLANE_M, x - x0 * z, x1 * z - x, y - y0 * z, y1 * z - y])
    return _interval(values[:, 0], values[:, 1])


def _interval(start: Floats, end: Floats) -> Floats:
    """(n, 2) interval where k linear functions, given by values (k, n) at 0 and 1, are all >= 0; empty: low >= high."""
    before, after = start < 0, end < 0
    with np.errstate(divide="ignore", invalid="ignore"):
        root = start / (start - end)
    low = np.where(before, np.where(after, 2.0, root), 0.0)
    high = np.where(after & ~before, root, 1.0)
    return np.stack([low.max(axis=0), high.min(axis=0)], axis=1)


def cut_segments(lines: Floats, span: Floats) -> Floats:
    """(n, 2, 3) the part of each segment (n, 2, 3) between its two parameters (n, 2)."""
    a, d = lines[:, :1], lines[:, 1:] - lines[:, :1]
    return np.asarray(a + span[:, :, None] * d)


def lengths_px(segments_px: Floats) -> Floats:
    """(n,) lengths of segments (n, 2, 2) [px]."""
    return np.asarray(np.hypot(*(segments_px[:, 1] - segments_px[:, 0]).T))


def bounding_windows(points: Floats) -> Floats:
    """(n, 4) windows round n sets of points (n, k, 3); infinite where a point is behind the near plane."""
    x, y, z = np.ascontiguousarray(points.T)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = x / z, y / z
    windows = np.stack([x.min(axis=0), y.min(axis=0), x.max(axis=0), y.max(axis=0)], axis=1)
    windows[z.min(axis=0) < 0.99 * NEAR_PLANE_M] = (-np.inf, -np.inf, np.inf, np.inf)
    return windows


def overlap(one: Floats, other: Floats) -> NDArray[np.bool_]:
    """(...) whether windows (..., 4) have a point in common."""
    common = (one[..., 0] <= other[..., 2]) & (one[..., 1] <= other[..., 3])
    common &= (other[..., 0] <= one[..., 2]) & (other[..., 1] <= one[..., 3])
    return np.asarray(common)


def visible_spans(lines: Floats, shadows: Shadows) -> tuple[NDArray[np.int64], Floats]:
    """The k visible parts of segments (n, 2, 3): index of the segment (k,), and parameters (k, 2)."""
    near_enough = shadows.nearest_m[None, :] < np.maximum(lines[:, 0, 2], lines[:, 1, 2])[:, None]
    line, surface = np.nonzero(overlap(bounding_windows(lines)[:, None], shadows.windows[None]) & near_enough)
    behind = shadows.bounds[:, -1]
    beyond = np.maximum(*(_value(behind[:, surface], lines[line, end]) for end in (0, 1))) >= 0
    line, surface = line[beyond], surface[beyond]
    bounds = shadows.bounds[:, :, surface]
    hidden = _interval(_value(bounds, lines[line, 0]), _value(bounds, lines[line, 1]))
    some = hidden[:, 1] > hidden[:, 0]
    taken: list[list[tuple[float, float]]] = [[] for _ in lines]
    for number, low, high in zip(line[some].tolist(), *hidden[some].T.tolist(), strict=True):
        taken[number].append((low, high))
    rows = [(number, *span) for number, parts in enumerate(taken)
            for span in subtract_intervals((0.0, 1.0), parts, MIN_PIECE)]
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
    own = bounding_windows(points[:, None])
    point, surface = np.nonzero(overlap(own[:, None], shadows.windows[None]) & near_enough)
    inside = np.all(_value(shadows.bounds[:, :, surface], points[point]) >= 0, axis=0)
    hidden = np.zeros(len(points), bool)
    hidden[point[inside]] = True
    return hidden
