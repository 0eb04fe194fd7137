"""From the shapes of an IFC file: the floor of a space, the wall hole of a door, the footprint of a wall."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from harvey_buildings.polygons import Floats, find_turn, side_of

MAX_ORIGIN_DISTANCE_M = 1000.0
"""A building further from the file's zero is moved near it."""
LEVEL_TOLERANCE_M = 0.05
MIN_DOOR_WIDTH_M = 0.3


@dataclass(frozen=True, eq=False)
class Body:
    """The shape of an element.

    Attributes:
        points: (n, 3) corners in the element's frame [m].
        triangles: (m, 3) indices of corners.
        frame: (3, 4) world_from_element.
        edges: (k, 2) indices of corners; used where there are no triangles.
    """

    points: Floats
    triangles: Any
    frame: Floats
    edges: Any = ()

    @property
    def world(self) -> Floats:
        """(n, 3) corners in the file's or the plan's frame [m]."""
        return np.asarray(self.points @ self.frame[:, :3].T + self.frame[:, 3])

    @property
    def footprint(self) -> shapely.Geometry:
        """What its triangles cover on the plan."""
        return _unite_triangles(self.world[self.triangles])


@dataclass(frozen=True, eq=False)
class PlanOrigin:
    """Pose of the plan in the file: (2,) its origin [m], and the angle from the file's x axis to the plan's."""

    zero: Floats
    turn_rad: float

    def place_on_plan(self, body: Body) -> Body:
        """The body in the plan's frame."""
        if not self.zero.any() and self.turn_rad == 0.0:
            return body
        c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
        frame = body.frame.copy()
        frame[:2, 3] -= self.zero
        frame[:2] = np.array([[c, s], [-s, c]]) @ frame[:2]
        return Body(body.points, body.triangles, frame, body.edges)


def find_plan_origin(bodies: Iterable[Body]) -> PlanOrigin:
    """A plan origin near these rooms, turned so that most of their walls run along x and y."""
    worlds = [(body.world, body.triangles) for body in bodies]
    if not worlds:
        return PlanOrigin(np.zeros(2), 0.0)
    middle = np.median([world[:, :2].mean(axis=0) for world, _ in worlds], axis=0)
    zero = np.round(middle) if np.abs(middle).max() > MAX_ORIGIN_DISTANCE_M else np.zeros(2)
    outlines = [floor[0].exterior for world, triangles in worlds
                if (floor := find_floor(world - [*zero, 0.0], triangles)) is not None]
    sides = [np.diff(shapely.get_coordinates(outline), axis=0) for outline in outlines]
    return PlanOrigin(zero, find_turn(np.concatenate(sides)) if sides else 0.0)


def find_floor(world: Floats, triangles: Any) -> tuple[shapely.Polygon, bool, bool] | None:
    """The largest part of a body's floor; whether it is level (else the body's footprint); whether it is all of it.

    Args:
        world: (n, 3) corners [m].
        triangles: (m, 3) indices of corners.
    """
    if not len(triangles):
        return None
    corners = world[triangles]
    level = corners[(np.abs(corners[:, :, 2] - world[:, 2].min()) < LEVEL_TOLERANCE_M).all(axis=1)]
    for found, is_level in ((level, True), (corners, False)):
        parts = [p for p in shapely.get_parts(_unite_triangles(found)) if p.geom_type == "Polygon"]
        if parts:
            best = max(parts, key=lambda p: p.area)
            return best, is_level, shapely.union_all(parts).area < 1.05 * best.area
    return None


def _unite_triangles(corners: Floats) -> shapely.Geometry:
    """What triangles (m, 3, 3) cover on the plan."""
    shapes = [shapely.Polygon(t[:, :2]) for t in corners]
    shapes = [shape.buffer(1e-4, join_style="mitre") for shape in shapes if shape.area > 1e-6]
    return shapely.union_all(shapes).buffer(-1e-4, join_style="mitre") if shapes else shapely.Polygon()


def find_ring(body: Body) -> shapely.Polygon | None:
    """The largest polygon that the edges of a body enclose; None where they enclose none."""
    world = np.round(body.world[:, :2], 4)
    lines = [shapely.LineString(world[list(edge)]) for edge in body.edges if (world[edge[0]] != world[edge[1]]).any()]
    return max(shapely.get_parts(shapely.polygonize(lines)), key=lambda p: p.area, default=None)


@dataclass(frozen=True, eq=False)
class WallHole:
    """The hole of a door, window or passage in its wall: (2,) centre, (2,) direction on the plan, z of its sill [m]."""

    centre: Floats
    along: Floats
    width_m: float
    sill_m: float
    height_m: float


def find_hole(
    own: Body | None, opening: Body | None, wall: Callable[[], Body | None], stated_m: float | None
) -> WallHole:
    """The wall hole of an element; its opening counts first, as a door's frame is wider, or its leaf is drawn open.

    Args:
        own, opening: shape of the element and of the opening that it fills, where they have one.
        wall: reads the shape of the wall.
        stated_m: width according to the file, where it says so.

    Raises:
        ValueError: both shapes lack.
    """
    shape = opening or own
    if shape is None:
        raise ValueError("neither it nor its opening has a shape")
    stated_m = stated_m if stated_m is not None and stated_m > MIN_DOOR_WIDTH_M else None
    along = _find_direction(own or shape, shape, wall, stated_m)
    normal = np.array([-along[1], along[0]])
    across, deep = shape.world[:, :2] @ along, shape.world[:, :2] @ normal
    centre = along * (across.min() + across.max()) / 2 + normal * (deep.min() + deep.max()) / 2
    width = float(across.max() - across.min())
    width = stated_m if stated_m is not None and stated_m <= width + 0.01 else width
    low, high = float(shape.world[:, 2].min()), float(shape.world[:, 2].max())
    return WallHole(centre, along, width, low, high - low)


def _find_direction(own: Body, shape: Body, wall: Callable[[], Body | None], stated_m: float | None) -> Floats:
    """(2,) direction of the wall: the element's x axis, as in the standard, unless stated width or wall contradict."""
    axes = [axis[:2] / np.linalg.norm(axis[:2]) for axis in own.frame[:, :2].T if np.linalg.norm(axis[:2]) > 0.9]
    axes.append(_longer_side(own))
    if stated_m is not None:
        off = [abs(float(np.ptp(shape.world[:, :2] @ axis)) - stated_m) for axis in axes]
        best = int(np.argmin(off))
        others = [other for other, axis in zip(off, axes, strict=True) if abs(float(axis @ axes[best])) < 0.9]
        if off[best] < 0.15 and min(others, default=math.inf) > off[best] + 0.1:
            return np.asarray(axes[best])
    host = wall()
    wanted = _longer_side(host) if host is not None else axes[-1]
    return np.asarray(max(axes, key=lambda axis: round(abs(float(axis @ wanted)), 3)))


def _longer_side(body: Body) -> Floats:
    """(2,) direction of the longer side of the minimum rotated rectangle of a body's corners on the plan."""
    box = shapely.MultiPoint(body.world[:, :2]).minimum_rotated_rectangle
    if box.geom_type != "Polygon":
        line = shapely.get_coordinates(box)
        arm = line[-1] - line[0]
        return np.asarray(arm / np.linalg.norm(arm)) if np.linalg.norm(arm) > 1e-6 else np.array([1.0, 0.0])
    corners = shapely.get_coordinates(box)[:-1]
    sides = [side_of(corners, i) for i in (0, 1)]
    return np.asarray(max(sides, key=lambda side: side[2])[1])
