"""Footprints of things on the floor that the model lacks: joined from several sights, taken back where it is free.

From far away what hangs over the floor seems to stand on it further off, and things that stand behind one another seem
to be one. So of two sights the one from clearly nearer tells the shape. All coordinates are on the floor, in one frame,
in metres.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from knowledge_sources.methods.arrays import Floats
from world_models.building.building import Building
from world_models.building.locales import EXTRA_KIND
from world_models.entries import Obstacle, Place
from world_models.frames import Pose2

Corners = tuple[tuple[float, float], ...]

GRAIN_M = 1e-3
"""Corners are resolved to this."""
MIN_SIDE_M = 0.02
"""A footprint is at least so wide and so deep."""
VAGUE_SIGMA_M = 0.05  # an obstacle of which the place is less sure is not known well
MAX_BEHIND_DOOR_M = 4.0  # a thing that is seen through a doorway stands at most so far behind it
NEARER = 0.7
"""A sight from less than this part of the distance of another is from clearly nearer."""
MIN_COMMON_DIRECTIONS = 0.6
"""A sight without feet tells nothing new where this part of its directions is that of what is known."""
OBSTACLE_DEPTH_M = 0.3  # depth that something is taken to have of which only the near side is seen
MAX_FLOORS = 64
REACH_M = 10.0
"""No thing is further off than this when it is seen."""


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
    """What a thing is taken to cover whose near side alone is seen from an ``eye`` (2,): at least so deep."""
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
    """What is left of a footprint without the floor that is free: the hull of its largest piece, no sliver."""
    pieces = [piece for piece in shapely.get_parts(shapely.difference(known, free)) if piece.area > MIN_SIDE_M**2]
    return shapely.convex_hull(max(pieces, key=lambda piece: piece.area, default=shapely.Polygon()))


def measure_hull_part(one: shapely.Geometry, other: shapely.Geometry) -> float:
    """How many times as large as two footprints the hull round both is: 1 where they make one convex footprint."""
    both = shapely.union(one, other)
    return float(shapely.convex_hull(both).area / max(both.area, MIN_SIDE_M**2))


def measure_free_part(where: shapely.Geometry, free: shapely.Geometry) -> float:
    """Which part of some floor is seen to be free, 0..1."""
    return float(shapely.intersection(where, free).area / where.area)


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


def may_be_there(obstacle: Obstacle) -> bool:
    """Whether it is there or suspected."""
    return obstacle.status != "gone"


class ThingShape(NamedTuple):
    """What is known of the shape of a thing [m, world].

    Attributes:
        taken: what it takes of the floor, as far as that was seen, and as deep as is assumed.
        from_m: from how near it was seen; infinite where its feet were not.
    """

    taken: shapely.Geometry
    from_m: float

    @staticmethod
    def of(obstacle: Obstacle) -> ThingShape:
        return ThingShape(build_polygon(obstacle.footprint), obstacle.seen_from_m)


def join_shapes(known: ThingShape, new: ThingShape, free: shapely.Geometry, eye: Floats) -> ThingShape:
    """The shape of a thing by what is known and by a new sight from an ``eye`` (2,), which shows some floor ``free``.

    A sight of which the feet are not seen tells only in which directions the thing is: it adds to what is known in
    directions in which nothing was known, and there no more than what is next to that.
    """
    if new.from_m < NEARER * known.from_m:
        known_beside = shapely.difference(known.taken, _build_sector(new.taken, eye))
        return ThingShape(join_footprints(known_beside, new.taken, free), new.from_m)
    if not math.isfinite(new.from_m):
        if measure_common_directions(known.taken, new.taken, eye) >= MIN_COMMON_DIRECTIONS:
            return known._replace(taken=take_free(known.taken, free))
        beside = shapely.intersection(new.taken, shapely.buffer(known.taken, OBSTACLE_DEPTH_M))
        new = new if beside.is_empty else new._replace(taken=beside)
    elif NEARER * new.from_m > known.from_m:
        return known
    return ThingShape(join_footprints(known.taken, new.taken, free), min(known.from_m, new.from_m))


def _build_sector(shape: shapely.Geometry, eye: Floats) -> shapely.Geometry:
    """All in the directions of a shape from an eye."""
    to = shapely.get_coordinates(shape) - eye
    rim = eye + REACH_M * to / np.maximum(np.linalg.norm(to, axis=1, keepdims=True), 1e-9)
    return shapely.convex_hull(shapely.multipoints(np.vstack([eye, rim])))


def find_same(known: Mapping[str, Obstacle], shape: shapely.Polygon, sigma_m: float, most_hull: float) -> str | None:
    """Which obstacle a thing is another sight of: that of which it covers most, within the standard deviations.

    What lies next to an obstacle, so that a hull round both would take much floor that neither takes, is another thing.
    """
    shared = dict[str, float]()
    for name, obstacle in known.items():
        polygon = build_polygon(obstacle.footprint)
        reach_m = 2.0 * math.hypot(sigma_m, obstacle.sigma_m)
        if measure_hull_part(polygon, shape) <= most_hull:
            shared[name] = shapely.intersection(polygon.buffer(reach_m), shape).area
    best = max(shared, key=shared.__getitem__, default=None)
    return best if best is not None and shared[best] > 0.0 else None


def find_before(
    known: Mapping[str, Obstacle], seen: shapely.Geometry, eye: tuple[float, float], overhang_m: float
) -> str | None:
    """The obstacle that something without a visible foot belongs to: well known, nearer than the picture's border,
    and in most of its directions, as its top may be wider than its foot.
    """
    parts = {name: cover_directions(build_polygon(obstacle.footprint).buffer(overhang_m), seen, eye)
             for name, obstacle in known.items() if obstacle.is_there and obstacle.sigma_m <= VAGUE_SIGMA_M}
    best = max(parts, key=parts.__getitem__, default=None)
    return best if best is not None and parts[best] >= MIN_COMMON_DIRECTIONS else None


def place(world: Building, obstacle: Obstacle, shape: shapely.Geometry) -> Obstacle:
    """An obstacle with the place and the width that follow from its footprint."""
    middle = shape.centroid
    at = Place.of_world(world, obstacle.locale, float(middle.x), float(middle.y))
    return replace(obstacle, x_m=round(at.x_m, 3), y_m=round(at.y_m, 3),
                   width_m=round(measure_width_m(obstacle.footprint), 3))


def move_thing(world: Building, thing: Obstacle, by: Pose2, off_m: float, evidence: str) -> Obstacle:
    """A thing that is moved on the floor: ``by``, in the world; it was seen by a belief that was ``off_m`` wrong.

    How much of that the belief was wrong already when it was seen, is not known: half of it is added to its deviation.
    """
    footprint = tuple((round(float(x), 3), round(float(y), 3)) for x, y in by.apply(thing.footprint))
    sigma_m = round(math.hypot(thing.sigma_m, 0.5 * off_m), 4)
    moved = replace(thing, footprint=footprint, evidence=evidence, sigma_m=sigma_m)
    return place(world, moved, build_polygon(moved.footprint))


def find_room(world: Building, shape: shapely.Polygon, near: str) -> str:
    """The room in which most of a thing stands, of that where the robot is and those next to it."""
    if shapely.Polygon(world.outline(near)).contains(shape.centroid):
        return near
    doors = {doorway.other(near): doorway for doorway in world.doorways_of(near)}
    behind_m = {room: shapely.MultiPoint(np.concatenate(door.thresholds_world)).distance(shape)
                for room, door in doors.items()}
    rooms = [near, *(room for room, far_m in behind_m.items() if far_m <= MAX_BEHIND_DOOR_M)]
    areas = [shapely.intersection(shapely.Polygon(world.outline(room)), shape).area for room in rooms]
    return rooms[int(np.argmax(areas))]


def find_open_floor(world: Building, locale: str, margin_m: float) -> shapely.Geometry:
    """The floor of a room, with its open doorways, so far from its walls and from what the file has there; cached."""
    return world.cached("floors of rooms", MAX_FLOORS, (locale, margin_m), lambda: _open(world, locale, margin_m))


def _open(world: Building, locale: str, margin_m: float) -> shapely.Geometry:
    openings = [shapely.MultiPoint(np.concatenate(doorway.thresholds_world)).convex_hull.buffer(0.01)
                for doorway in world.doorways_of(locale)]
    floor = shapely.union_all([shapely.Polygon(world.outline(locale)), *openings])
    things = [shapely.Polygon(thing.footprint_world) for thing in world.things_of(locale)
              if thing.is_obstacle and thing.kind != EXTRA_KIND]
    return shapely.difference(shapely.buffer(floor, -margin_m), shapely.buffer(shapely.union_all(things), margin_m))
