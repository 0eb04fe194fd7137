"""The shortest way across a room that keeps clear of its walls and of known obstacles: a visibility graph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import networkx as nx
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.polygon import orient

Floats = NDArray[np.float64]
SLACK_M = 1e-6


def compute_free_space(outline: Any, obstacles: Sequence[Any], clearance_m: float) -> shapely.Geometry:
    """Where the robot's centre may be: the room's polygon (k, 2) shrunk, less the obstacles' (k, 2) grown [m]."""
    room = shapely.Polygon(np.asarray(outline, float)).buffer(-clearance_m, join_style="mitre")
    if not len(obstacles):
        return room
    rings = shapely.linearrings(np.concatenate([np.asarray(o, float) for o in obstacles]),
                                indices=np.repeat(np.arange(len(obstacles)), [len(o) for o in obstacles]))
    grown = shapely.buffer(shapely.polygons(rings), clearance_m, join_style="mitre")
    return room.difference(shapely.union_all(grown))


def is_clear(free: shapely.Geometry, a: Any, b: Any) -> bool:
    """Whether the straight line between two points (2,) stays in the free space."""
    line = shapely.LineString([np.asarray(a, float), np.asarray(b, float)])
    return bool(free.covers(line) or free.buffer(SLACK_M).covers(line))


def find_shortest_route(
    free: shapely.Geometry, start: Any, goal: Any, floor: Callable[[], shapely.Geometry]
) -> list[Floats] | None:
    """Way points [(2,), ...] from start to goal, both included; None where there is no way.

    An end that lies in the margin round the free space is first joined to the nearest free point to which a straight
    line leads over the open ``floor`` (the free space of a robot without a width), which is asked for only then.
    """
    ends = [np.asarray(start, float), np.asarray(goal, float)]
    inner = [_nearest_free(free, p, floor) for p in ends]
    if any(p is None for p in inner):
        return None
    nodes = np.array([*(p for p in inner if p is not None), *_bends(free)])
    slack = free.buffer(SLACK_M)
    shapely.prepare(slack)
    graph: nx.Graph = nx.Graph()
    graph.add_nodes_from(range(len(nodes)))
    pairs = np.array(list(combinations(range(len(nodes)), 2)))
    pairs = pairs[shapely.covers(slack, shapely.linestrings(nodes[pairs]))]
    lengths = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    graph.add_weighted_edges_from(zip(*pairs.T.tolist(), lengths.tolist(), strict=True))
    try:
        way = nx.shortest_path(graph, 0, 1, weight="weight")
    except nx.NetworkXNoPath:
        return None
    return _without_repeats([ends[0], *(nodes[i] for i in way), ends[1]])


def _nearest_free(free: shapely.Geometry, point: Floats, floor: Callable[[], shapely.Geometry]) -> Floats | None:
    """Of what is nearest in each free part, and of all corners: the nearest that is not behind a barrier."""
    parts = [part for part in shapely.get_parts(free) if not part.is_empty]
    nearest = [shapely.get_coordinates(shapely.shortest_line(shapely.Point(point), part))[-1] for part in parts]
    if any(float(np.linalg.norm(p - point)) <= SLACK_M for p in nearest):
        return point
    there = sorted((*nearest, *_corners(free)), key=lambda p: float(np.linalg.norm(p - point)))
    open_floor = floor()
    return next((np.asarray(p) for p in there if is_clear(open_floor, point, p)), None)


def _corners(free: shapely.Geometry) -> Floats:
    """(n, 2) the distinct vertices of the free space, in a fixed order."""
    return _distinct(shapely.get_coordinates(free))


def _bends(free: shapely.Geometry) -> Floats:
    """(n, 2) the vertices about which a shortest way may bend: those that stand into the free space."""
    found = [np.zeros((0, 2))]
    for part in shapely.get_parts(free):
        if not part.is_empty:
            inwards = orient(part)
            found += [_standing_in(np.asarray(ring.coords)[:-1, :2]) for ring in (inwards.exterior, *inwards.interiors)]
    return _distinct(np.concatenate(found))


def _standing_in(ring: Floats) -> Floats:
    """The corners of a ring at which it turns right; what it bounds is on its left."""
    came, goes = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return np.asarray(ring[came[:, 0] * goes[:, 1] - came[:, 1] * goes[:, 0] < 0.0])


def _distinct(points: Floats) -> Floats:
    return np.asarray(np.unique(np.round(points, 9), axis=0))


def _without_repeats(points: list[Floats]) -> list[Floats]:
    kept = points[:1]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) > 1e-6:
            kept.append(point)
    return kept


def measure_wall_distance_m(outline: Any, openings: Sequence[Any], point: Any) -> float:
    """How far a point (2,) is from the sides of a room (k, 2), less its openings, each the corners (n, 2) of its floor.

    In an open doorway one stands far from walls, though at the border of the room.
    """
    walls = shapely.LinearRing(np.asarray(outline, float))
    if len(openings):
        walls = walls.difference(shapely.union_all([_hull(opening) for opening in openings]))
    return float(walls.distance(shapely.Point(point)))


def measure_thing_distance_m(footprint: Any, point: Any) -> float:
    """How far a point (2,) is from what stands on a footprint (k, 2); 0 within it."""
    return float(shapely.Polygon(np.asarray(footprint, float)).distance(shapely.Point(point)))


def _hull(opening: Any) -> shapely.Geometry:
    return shapely.MultiPoint(np.asarray(opening, float)).convex_hull.buffer(1e-6)
