"""Footprints of things on the floor: joined from several sights of a thing, and taken back where the floor is free.

All coordinates are on the floor, in one frame, in metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from knowledge_sources.methods.arrays import Floats

Corners = tuple[tuple[float, float], ...]

GRAIN_M = 1e-3
"""Corners are resolved to this."""
MIN_SIDE_M = 0.02
"""A footprint is at least so wide and so deep."""


def build_polygon(footprint: Any) -> shapely.Polygon:
    """The hull of the corners (k, 2), with an area also where they lie in a line."""
    hull = shapely.convex_hull(shapely.multipoints(np.asarray(footprint, float).reshape(-1, 2)))
    if isinstance(hull, shapely.Polygon) and hull.area > MIN_SIDE_M**2:
        return hull
    return hull.buffer(0.5 * MIN_SIDE_M, join_style="mitre", cap_style="square")


def list_corners(shape: shapely.Geometry) -> Corners:
    """The corners of the hull of a shape, counter-clockwise; () where it has no area."""
    hull = shapely.convex_hull(shape)
    if not isinstance(hull, shapely.Polygon) or hull.is_empty:
        return ()
    ring = shapely.get_coordinates(orient(hull.simplify(5 * GRAIN_M)))[:-1]
    return tuple((round(float(x), 3), round(float(y), 3)) for x, y in ring)


def build_free_floor(
    x_m: float, y_m: float, bearings_rad: Sequence[float], near_m: Sequence[float], far_m: Sequence[float]
) -> shapely.Geometry:
    """The floor that is free by one sight: between the near and the far end of each direction, and between these."""
    at = np.array([x_m, y_m])
    out = np.column_stack([np.cos(bearings_rad), np.sin(bearings_rad)])
    near, far = np.asarray(near_m, float), np.asarray(far_m, float)
    pieces = []
    for run in _find_runs(far > near + GRAIN_M):
        ring = np.concatenate([at + far[run, None] * out[run], (at + near[run, None] * out[run])[::-1]])
        pieces.append(shapely.make_valid(shapely.Polygon(ring)))
    return shapely.union_all(pieces)


def _find_runs(free: Any) -> list[Floats]:
    """The indices of each run of at least two neighbours for which it holds."""
    ends = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(free, int), [0]])))
    return [np.arange(a, b) for a, b in zip(ends[::2], ends[1::2], strict=True) if b - a >= 2]


def deepen(footprint: Any, eye: Any, depth_m: float) -> shapely.Polygon:
    """What a thing is taken to cover whose near side alone is seen from an ``eye`` (2,): at least so deep behind that.

    A footprint that is as deep already stays.
    """
    polygon = build_polygon(footprint)
    corners = shapely.get_coordinates(polygon)[:-1]
    away = corners.mean(axis=0) - np.asarray(eye, float)
    out = away / (float(np.linalg.norm(away)) or 1.0)
    along = corners @ out
    lacking = depth_m - float(np.ptp(along))
    if lacking <= 0.0:
        return polygon
    return build_polygon(np.concatenate([corners, corners + lacking * out]))


def join_footprints(known: shapely.Geometry, seen: shapely.Geometry, free: shapely.Geometry) -> shapely.Geometry:
    """Both, without what of the known is seen to be free; at least what is seen now."""
    return shapely.convex_hull(shapely.union(seen, take_free(known, free)))


def take_free(known: shapely.Geometry, free: shapely.Geometry) -> shapely.Geometry:
    """What is left of a footprint without the floor that is seen to be free: the hull of its largest piece.

    A sliver, which rounding leaves, is nothing.
    """
    pieces = [piece for piece in shapely.get_parts(shapely.difference(known, free)) if piece.area > MIN_SIDE_M**2]
    return shapely.convex_hull(max(pieces, key=lambda piece: piece.area, default=shapely.Polygon()))


def measure_hull_part(one: shapely.Geometry, other: shapely.Geometry) -> float:
    """How many times as large as two footprints the hull round both is: 1 where they make one convex footprint."""
    both = shapely.union(one, other)
    return float(shapely.convex_hull(both).area / max(both.area, MIN_SIDE_M**2))


def measure_free_part(footprint: Any, free: shapely.Geometry) -> float:
    """Which part of a footprint is seen to be free floor, 0..1."""
    polygon = build_polygon(footprint)
    return float(shapely.intersection(polygon, free).area / polygon.area)


def measure_change_m(one: Any, other: Any) -> float:
    """How far the outlines of two footprints are from each other, at most; infinite where there is none."""
    if not len(one) or not len(other):
        return math.inf
    return float(build_polygon(one).hausdorff_distance(build_polygon(other)))


def measure_width_m(footprint: Any) -> float:
    """The longer side of the smallest rectangle round a footprint."""
    ring = shapely.get_coordinates(shapely.minimum_rotated_rectangle(build_polygon(footprint)))
    return max(float(np.linalg.norm(b - a)) for a, b in pairwise(ring))


def measure_common_directions(known: shapely.Geometry, seen: shapely.Geometry, eye: Any) -> float:
    """Which part of the directions in which a thing is seen from an eye (2,) is that of what is known, 0..1."""
    (known_rad, *ends), (seen_rad, low, high) = (_find_directions(shape, eye) for shape in (known, seen))
    a, b = (math.remainder(known_rad - seen_rad, math.tau) + end for end in ends)
    return max(0.0, min(b, high) - max(a, low)) / max(high - low, 1e-6)


def cover_directions(known: shapely.Geometry, seen: shapely.Geometry, eye: Any) -> float:
    """The same of what is seen of something, 0 where the known is further off than all of that."""
    reach_m = float(np.linalg.norm(shapely.get_coordinates(seen) - np.asarray(eye, float), axis=1).max())
    return measure_common_directions(known, seen, eye) if known.distance(shapely.Point(eye)) <= reach_m else 0.0


def _find_directions(shape: shapely.Geometry, eye: Any) -> tuple[float, float, float]:
    """The direction of a shape's middle from an eye (2,), and its ends from that [rad]."""
    to = shapely.get_coordinates(shape) - np.asarray(eye, float)
    middle = to.mean(axis=0)
    aside = np.arctan2(middle[0] * to[:, 1] - middle[1] * to[:, 0], to @ middle)
    return math.atan2(middle[1], middle[0]), float(aside.min()), float(aside.max())


def measure_approach_m(
    way: shapely.LineString, footprint: shapely.Polygon, reach_m: float, step_m: float = 0.05
) -> float:
    """How near a way comes to a footprint; where it begins nearer than ``reach_m``, not counting how it leads away."""
    steps = max(2, math.ceil(way.length / step_m))
    distances = [way.interpolate(step / steps, normalized=True).distance(footprint) for step in range(steps + 1)]
    first = 0
    while first < steps and distances[first] < reach_m and distances[first + 1] > distances[first] + 0.5 * step_m:
        first += 1
    return float(min(distances[first:]))
