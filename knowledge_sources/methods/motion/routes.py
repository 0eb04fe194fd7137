"""Routes over free floor: the shortest way, straight lines through doorways, and places to look again from.

All coordinates are on the floor, in one frame, in metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from heapq import heappop, heappush
from itertools import combinations, count
from typing import Any

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from knowledge_sources.methods.arrays import Floats, Ints
from world_models.building.building import Building
from world_models.building.locales import EXTRA_KIND

SLACK_M = 1e-6
"""Distance below which two places are the same: rounding of shapely's geometry."""

TOUCHED_M = 0.002
"""What comes nearer by less than this is no nearer."""

AWAY_GAP_M, AWAY_STEP_M, AWAY_PART = 0.02, 0.05, 0.3
"""What is nearer than this is left: so much of the first step leads away from it."""

CORNER_STEPS = 4
"""Corners of a quarter circle round what is no rectangle: the way round it is at most 4.4 % too near (where the
corner's angle is no multiple of a step, a step may be half as long again: 1 - cos(16.9 degrees))."""

MAX_FREE_SPACES = 64
"""Size of the cache of free spaces."""


def find_free_space(
    building: Building, locale: str, clearance_m: float, *, is_round: bool = False
) -> shapely.Geometry:
    """Where the robot's centre may be in a locale, ``clearance_m`` from walls and things; cached."""
    return building.cached("free spaces", MAX_FREE_SPACES, (locale, clearance_m, is_round), lambda: compute_free_space(
        building.outline(locale), building.obstacles(locale), clearance_m, is_round=is_round))


def compute_free_space(
    outline: Any, obstacles: Sequence[Any], clearance_m: float, *, is_round: bool = False
) -> shapely.Geometry:
    """Where the robot's centre may be: the room's polygon (k, 2) shrunk, less the obstacles' (k, 2) grown."""
    room = shapely.Polygon(np.asarray(outline, float)).buffer(-clearance_m, join_style="mitre")
    return room.difference(grow_obstacles(obstacles, clearance_m, is_round=is_round)) if len(obstacles) else room


def grow_obstacles(obstacles: Sequence[Any], clearance_m: float, *, is_round: bool = False) -> shapely.Geometry:
    """What is so near to obstacles, each of (k, 2) corners.

    Ways round few corners have few legs: what is no rectangle is grown as the smallest rectangle round it, and corners
    stay corners. With ``is_round`` all of the floor is free that is: obstacles are grown as they are, round at corners.
    """
    rings = shapely.linearrings(np.concatenate([np.asarray(o, float) for o in obstacles]),
                                indices=np.repeat(np.arange(len(obstacles)), [len(o) for o in obstacles]))
    polygons = shapely.polygons(rings)
    if is_round:
        return shapely.union_all(shapely.buffer(polygons, clearance_m, quad_segs=CORNER_STEPS))
    other = np.array([len(corners) != 4 for corners in obstacles])
    polygons[other] = shapely.oriented_envelope(polygons[other])
    return shapely.union_all(shapely.buffer(polygons, clearance_m, join_style="mitre"))


def is_clear(free: shapely.Geometry, a: Any, b: Any) -> bool:
    """Whether the straight line between two points (2,) stays in the free space."""
    line = shapely.LineString([np.asarray(a, float), np.asarray(b, float)])
    return bool(free.covers(line) or free.buffer(SLACK_M).covers(line))


def find_shortest_route(
    free: shapely.Geometry, start: Any, goal: Any, floor: Callable[[], shapely.Geometry], radius_m: float = 0.0
) -> list[Floats] | None:
    """Find the shortest route through the free space, by Dijkstra's search of its visibility graph.

    An end in the margin round the free space is first joined to the nearest free point to which a straight line leads
    over the open ``floor`` (the free space of a robot without a width), which is computed only then. On the way to it a
    robot with ``radius_m`` touches nothing, and comes no nearer to what it touches already.

    Returns:
        Way points [(2,), ...] with both ends; None where there is no route.
    """
    ends = [np.asarray(start, float), np.asarray(goal, float)]
    inner = [_find_nearest_free(free, p, floor, radius_m) for p in ends]
    if any(p is None for p in inner):
        return None
    nodes = np.array([*(p for p in inner if p is not None), *find_bends(free)])
    slack = free.buffer(SLACK_M)
    shapely.prepare(slack)
    pairs = np.array(list(combinations(range(len(nodes)), 2)))
    pairs = pairs[shapely.covers(slack, shapely.linestrings(nodes[pairs]))]
    lengths = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    found = next((route for _, route in list_shortest_routes(pairs, lengths) if route[-1] == 1), None)
    return None if found is None else _drop_repeats([ends[0], *(nodes[i] for i in found), ends[1]])


def list_shortest_routes(pairs: Ints, lengths: Floats) -> Iterator[tuple[float, list[int]]]:
    """The shortest route to each node that is joined with node 0, and its length, the shortest first (Dijkstra).

    Not networkx, whose import takes longer than all searches of a mission.

    Args:
        pairs: (n, 2) nodes that are joined. lengths: (n,) of the way between.
    """
    beside: dict[int, list[tuple[int, float]]] = {}
    for (a, b), length in zip(pairs.tolist(), lengths.tolist(), strict=True):
        beside.setdefault(a, []).append((b, length))
        beside.setdefault(b, []).append((a, length))
    number = count()  # of routes of equal length the one that was found first comes first
    todo: list[tuple[float, int, list[int]]] = [(0.0, next(number), [0])]
    least, done = {0: 0.0}, set[int]()
    while todo:
        away, _, route = heappop(todo)
        if route[-1] in done:
            continue
        done.add(route[-1])
        yield away, route
        for node, length in beside.get(route[-1], ()):
            if node not in done and away + length < least.get(node, math.inf):
                least[node] = away + length
                heappush(todo, (away + length, next(number), [*route, node]))


def find_nearest(building: Building, locale: str, point: Any, *, of_model: bool = False) -> tuple[float, str]:
    """Distance [m] of a point (2,) [world] from the nearest wall or obstacle of a locale, and which of them it is.

    Args:
        of_model: without what the model lacks.
    """
    at, walls = shapely.Point(point), shapely.LinearRing(np.asarray(building.outline(locale), float))
    openings = [shapely.MultiPoint(np.concatenate(doorway.thresholds_world)).convex_hull.buffer(SLACK_M)
                for doorway in building.doorways_of(locale)]  # there the walls are far, although it is at the border
    near = [(float(walls.difference(shapely.union_all(openings)).distance(at)), "a wall")]
    near += [(float(shapely.Polygon(thing.footprint_world).distance(at)), thing.name)
             for thing in building.things_of(locale)
             if thing.is_obstacle and not (of_model and thing.kind == EXTRA_KIND)]
    return min(near)


def _find_nearest_free(
    free: shapely.Geometry, point: Floats, floor: Callable[[], shapely.Geometry], radius_m: float
) -> Floats | None:
    """Of the nearest point of each free part, and all corners: the nearest that is not behind a barrier, and on the way
    to which nothing is touched that is not touched already.
    """
    parts = [part for part in shapely.get_parts(free) if not part.is_empty]
    nearest = [shapely.get_coordinates(shapely.shortest_line(shapely.Point(point), part))[-1] for part in parts]
    if any(float(np.linalg.norm(p - point)) <= SLACK_M for p in nearest):
        return point
    corners = _drop_duplicates(shapely.get_coordinates(free))
    candidates = sorted((*nearest, *corners), key=lambda p: float(np.linalg.norm(p - point)))
    open_floor = floor()
    return next((np.asarray(p) for p in candidates if is_clear(open_floor, point, p) and (
        not radius_m or _leads_away(open_floor.boundary, point, p, radius_m))), None)


def _leads_away(boundary: shapely.Geometry, point: Floats, end: Floats, radius_m: float) -> bool:
    """Whether a line touches nothing, and leads away from what is touched, or nearly so, at its beginning."""
    line = shapely.LineString([point, end])
    begin_m = boundary.distance(shapely.Point(point))
    if boundary.distance(line) < min(radius_m + TOUCHED_M, begin_m) - TOUCHED_M:
        return False
    first = shapely.line_interpolate_point(line, min(AWAY_STEP_M, line.length))
    return bool(begin_m >= radius_m + AWAY_GAP_M or boundary.distance(first) >= begin_m + AWAY_PART * AWAY_STEP_M)


def find_bends(free: shapely.Geometry) -> Floats:
    """(n, 2) the vertices about which a shortest route may bend: the reflex corners of the free space."""
    found = [np.zeros((0, 2))]
    for part in shapely.get_parts(free):
        if not part.is_empty:
            rings = orient(part)  # their inside is on their left
            for ring in (np.asarray(line.coords)[:-1, :2] for line in (rings.exterior, *rings.interiors)):
                before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
                found.append(ring[before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] < 0.0])
    return _drop_duplicates(np.concatenate(found))


def _drop_duplicates(points: Floats) -> Floats:
    """The distinct points (n, 2), to a nanometre, in a fixed order."""
    return np.asarray(np.unique(np.round(points, 9), axis=0))


def _drop_repeats(points: list[Floats]) -> list[Floats]:
    """Points without those that repeat the one before."""
    kept = points[:1]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) > SLACK_M:
            kept.append(point)
    return kept


def find_line_through(
    free: shapely.Geometry, middles: Any, outward: Any, distances_m: Sequence[float], offsets_m: Sequence[float]
) -> tuple[Floats, Floats] | None:
    """The straight line through a doorway that stays in the free space and is the least diagonal.

    Args:
        free: where the robot's centre may be.
        middles: (2, 2) of the thresholds on this side and on the other.
        outward: (2,) unit vector through the doorway, from this side to the other.
        distances_m: of the line's ends from the thresholds.
        offsets_m: how far to either side of the middle they may be; they rise from 0.

    Returns:
        Its ends (2,), on this side and on the other; None where no line stays in the free space.
    """
    (near, far), out = np.asarray(middles, float), np.asarray(outward, float)
    across = np.array([-out[1], out[0]])
    aside = np.array([sign * offset for offset in offsets_m for sign in ((1.0, -1.0) if offset else (1.0,))])
    away, side = (part.ravel() for part in np.meshgrid(distances_m, aside))
    ends = near - away[:, None] * out + side[:, None] * across, far + away[:, None] * out + side[:, None] * across
    first, second = (part.ravel() for part in np.meshgrid(*(np.arange(len(away)),) * 2, indexing="ij"))
    diagonal_m = np.abs(side[first]) + np.abs(side[second]) + np.abs(side[first] - side[second])
    order = np.lexsort((first + second, diagonal_m))
    first, second = first[order], second[order]
    shapely.prepare(free)
    clear = shapely.covers(free, shapely.linestrings(np.stack([ends[0][first], ends[1][second]], axis=1)))
    k = int(np.argmax(clear))
    return (ends[0][first[k]], ends[1][second[k]]) if clear[k] else None


def list_lookouts(
    free: shapely.Geometry, floor: shapely.Geometry, footprint: Any, distances_m: Sequence[float], directions: int,
    short_m: float,
) -> Floats:
    """The poses (n, 3) x, y, heading [rad] round a thing that face it, with nothing in between.

    Args:
        free: where the robot's centre may be.
        floor: where nothing stands but the thing, at most.
        footprint: corners (k, 2) of the thing.
        distances_m: of the robot's centre from the thing's middle.
        directions: so many round it are tried.
        short_m: the last so much of a line of sight, before the thing's near side, need not be floor.
    """
    shape = shapely.convex_hull(shapely.multipoints(np.asarray(footprint, float).reshape(-1, 2)))
    middle = shapely.get_coordinates(shape.centroid)[0]
    around = 2.0 * np.pi * np.arange(directions) / directions
    away, at = (part.ravel() for part in np.meshgrid(distances_m, around, indexing="ij"))
    out = np.column_stack([np.cos(at), np.sin(at)])
    places = middle + away[:, None] * out
    kept = shapely.contains_xy(free, places[:, 0], places[:, 1])
    lines = shapely.difference(shapely.linestrings(np.stack([places, np.broadcast_to(middle, places.shape)], axis=1)),
                               shapely.buffer(shape, short_m))
    kept &= shapely.covers(floor, lines)
    return np.asarray(np.column_stack([places, np.arctan2(-out[:, 1], -out[:, 0])])[kept])
