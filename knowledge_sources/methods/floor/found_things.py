"""Things on the floor that the model lacks: how certain they are, where they stand, and which are the same."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import shapely

from knowledge_sources.methods.floor.footprints import (
    Corners,
    build_polygon,
    measure_common_directions,
    measure_hull_part,
    measure_width_m,
)
from knowledge_sources.methods.floor.thing_shapes import MIN_COMMON_DIRECTIONS
from world_models.building.building import Building
from world_models.building.locales import EXTRA_KIND, Doorway
from world_models.entries import Obstacle, ObstacleStatus, Place
from world_models.frames import Pose2

MIN_OBSTACLE_CERTAINTY = 0.9  # with this certainty an obstacle is there: by one sure picture, or by two unsure ones
VAGUE_SIGMA_M = 0.05  # an obstacle of which the place is less sure is not known well
MAX_BEHIND_DOOR_M = 4.0  # a thing that is seen through a doorway stands at most so far behind it


def may_be_there(obstacle: Obstacle) -> bool:
    """Whether it is there or suspected."""
    return obstacle.status != "gone"


def tell_status(certainty: float) -> ObstacleStatus:
    """Whether something so certain is acted on."""
    return "there" if certainty >= MIN_OBSTACLE_CERTAINTY else "suspected"


def find_same(
    known: Mapping[str, Obstacle], shape: shapely.Polygon, sigma_m: float, most_hull: float
) -> str | None:
    """Which obstacle a thing is another sight of: that of which it covers most, within the standard deviations.

    What lies next to an obstacle, so that a hull round both would take much floor that neither takes, is another thing.
    """
    best: tuple[float, str] | None = None
    for name, obstacle in known.items():
        polygon = build_polygon(obstacle.footprint)
        reach_m = 2.0 * math.hypot(sigma_m, obstacle.sigma_m)
        shared = shapely.intersection(polygon.buffer(reach_m), shape).area
        if shared > 0.0 and (best is None or shared > best[0]) and measure_hull_part(polygon, shape) <= most_hull:
            best = shared, name
    return None if best is None else best[1]


def find_before(
    known: Mapping[str, Obstacle], seen: shapely.Geometry, eye: tuple[float, float], overhang_m: float
) -> str | None:
    """The obstacle that something without a visible foot belongs to: well known, nearer than the picture's border,
    and in most of its directions, as its top may be wider than its foot.
    """
    at = np.array(eye)
    reach_m = float(np.linalg.norm(shapely.get_coordinates(seen) - at, axis=1).max())
    best: tuple[float, str] | None = None
    for name, obstacle in known.items():
        wide = build_polygon(obstacle.footprint).buffer(overhang_m)
        if not obstacle.is_there or obstacle.sigma_m > VAGUE_SIGMA_M:
            continue
        if wide.distance(shapely.Point(at)) > reach_m:
            continue
        part = measure_common_directions(wide, seen, at)
        if part >= MIN_COMMON_DIRECTIONS and (best is None or part > best[0]):
            best = part, name
    return None if best is None else best[1]


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
    def move(corners: Corners) -> Corners:
        return tuple((round(float(x), 3), round(float(y), 3)) for x, y in by.apply(corners)) if corners else ()

    moved = replace(thing, footprint=move(thing.footprint), core=move(thing.core), evidence=evidence,
                    sigma_m=round(math.hypot(thing.sigma_m, 0.5 * off_m), 4))
    return place(world, moved, build_polygon(moved.footprint))


def find_room(world: Building, shape: shapely.Polygon, near: str) -> str:
    """The room in which most of a thing stands, of that where the robot is and those next to it."""
    if shapely.Polygon(world.outline(near)).contains(shape.centroid):
        return near
    doors = {doorway.other(near): doorway for doorway in world.doorways_of(near)}
    rooms = [near, *(room for room, door in doors.items() if _measure_behind_m(door, shape) <= MAX_BEHIND_DOOR_M)]
    areas = [shapely.intersection(shapely.Polygon(world.outline(room)), shape).area for room in rooms]
    return rooms[int(np.argmax(areas))]


def _measure_behind_m(door: Doorway, shape: shapely.Polygon) -> float:
    """How far a thing is from a doorway."""
    return float(shapely.MultiPoint(np.concatenate(door.thresholds_world)).distance(shape))


def find_open_floor(world: Building, locale: str, margin_m: float) -> shapely.Geometry:
    """The floor of a room, with its open doorways, so far from its walls and from what the file has there."""
    openings = [shapely.MultiPoint(np.concatenate(doorway.thresholds_world)).convex_hull.buffer(0.01)
                for doorway in world.doorways_of(locale)]
    floor = shapely.union_all([shapely.Polygon(world.outline(locale)), *openings])
    things = [shapely.Polygon(thing.footprint_world) for thing in world.things_of(locale)
              if thing.is_obstacle and thing.kind != EXTRA_KIND]
    return shapely.difference(shapely.buffer(floor, -margin_m), shapely.buffer(shapely.union_all(things), margin_m))
