"""The shortest way across a room that keeps clear of its walls and of known obstacles: a visibility graph."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import networkx as nx
import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SLACK_M = 1e-6


def free_space(outline: Any, obstacles: Sequence[Any], clearance_m: float) -> shapely.Geometry:
    """Where the robot's centre may be: the room's polygon (k, 2) shrunk, less the obstacles' (k, 2) grown [m]."""
    room = shapely.Polygon(np.asarray(outline, float)).buffer(-clearance_m, join_style="mitre")
    grown = [shapely.Polygon(np.asarray(o, float)).buffer(clearance_m, join_style="mitre") for o in obstacles]
    return room.difference(shapely.union_all(grown)) if grown else room


def is_clear(free: shapely.Geometry, a: Any, b: Any) -> bool:
    """Whether the straight line between two points (2,) stays in the free space."""
    return bool(free.buffer(SLACK_M).covers(shapely.LineString([np.asarray(a, float), np.asarray(b, float)])))


def shortest_route(free: shapely.Geometry, start: Any, goal: Any) -> list[Floats] | None:
    """Way points [(2,), ...] from start to goal, both included; None where there is no way.

    An end that lies in the margin round the free space is first joined to the nearest free point.
    """
    ends = [np.asarray(start, float), np.asarray(goal, float)]
    inner = [_nearest_free(free, p) for p in ends]
    if any(p is None for p in inner):
        return None
    nodes = [p for p in inner if p is not None] + _corners(free)
    slack = free.buffer(SLACK_M)
    graph: nx.Graph = nx.Graph()
    graph.add_nodes_from(range(len(nodes)))
    pairs = np.array(list(combinations(range(len(nodes)), 2)))
    shapely.prepare(slack)
    clear = shapely.covers(slack, shapely.linestrings(np.array(nodes)[pairs]))
    for i, j in pairs[clear].tolist():
        graph.add_edge(i, j, weight=float(np.linalg.norm(nodes[i] - nodes[j])))
    try:
        way = nx.shortest_path(graph, 0, 1, weight="weight")
    except nx.NetworkXNoPath:
        return None
    return _without_repeats([ends[0], *(nodes[i] for i in way), ends[1]])


def _nearest_free(free: shapely.Geometry, point: Floats) -> Floats | None:
    if free.is_empty:
        return None
    nearest = shapely.shortest_line(shapely.Point(point), free)
    return np.asarray(shapely.get_coordinates(nearest)[-1])


def _corners(free: shapely.Geometry) -> list[Floats]:
    """The distinct vertices of the free space, in a fixed order."""
    return list(np.unique(np.round(shapely.get_coordinates(free), 9), axis=0))


def _without_repeats(points: list[Floats]) -> list[Floats]:
    kept = points[:1]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) > 1e-6:
            kept.append(point)
    return kept
