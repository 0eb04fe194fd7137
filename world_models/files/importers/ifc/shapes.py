"""What the shapes of an IFC file tell: the floor of a space, the hole of a door, the shadow of a wall."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from world_models.files.importers.outlines import Floats, side_of

FAR_M = 1000.0
"""A building that is further from the file's zero is brought near it."""
LEAST_TURN = math.radians(0.2)
LEVEL_M = 0.05
NARROWEST_DOOR_M = 0.3


@dataclass(frozen=True, eq=False)
class Body:
    """The shape of an element: corners (n, 3) in its own frame, triangles (m, 3), world_from_element (3, 4) [m].

    ``edges`` (k, 2) are of interest where there are no triangles.
    """

    points: Floats
    triangles: Any
    frame: Floats
    edges: Any = ()

    @property
    def world(self) -> Floats:
        return np.asarray(self.points @ self.frame[:, :3].T + self.frame[:, 3])

    @property
    def shadow(self) -> shapely.Geometry:
        """What it covers on the plan."""
        return _joined(self.world[self.triangles])


@dataclass(frozen=True, eq=False)
class Ground:
    """Where the plan lies in the file: (2,) its zero [m], and the angle from the file's x axis to its own."""

    zero: Floats
    turn_rad: float

    def under(self, body: Body) -> Body:
        """The body as it stands on the plan; as it is where the plan lies as the file does."""
        if not self.zero.any() and self.turn_rad == 0.0:
            return body
        c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
        frame = body.frame.copy()
        frame[:2, 3] -= self.zero
        frame[:2] = np.array([[c, s], [-s, c]]) @ frame[:2]
        return Body(body.points, body.triangles, frame, body.edges)


def ground_under(bodies: Iterable[Body]) -> Ground:
    """A plan that has these rooms near its zero, and most of their walls along x and y."""
    worlds = [(body.world, body.triangles) for body in bodies]
    if not worlds:
        return Ground(np.zeros(2), 0.0)
    middle = np.median([world[:, :2].mean(axis=0) for world, _ in worlds], axis=0)
    zero = np.round(middle) if np.abs(middle).max() > FAR_M else np.zeros(2)
    outlines = [floor[0].exterior for world, triangles in worlds
                if (floor := floor_of(world - [*zero, 0.0], triangles)) is not None]
    sides = [np.diff(shapely.get_coordinates(outline), axis=0) for outline in outlines]
    return Ground(zero, _turn_of(np.concatenate(sides)) if sides else 0.0)


def _turn_of(sides: Floats) -> float:
    """The angle [rad] within 45 degrees by which most of these sides (n, 2) are off x and y; 0 where they are not."""
    quarter = math.pi / 2
    length, angle = np.linalg.norm(sides, axis=1), np.mod(np.arctan2(sides[:, 1], sides[:, 0]), quarter)
    away = np.abs(np.mod(angle[:, None] - angle + quarter / 2, quarter) - quarter / 2) < math.radians(1.0)
    best = int(np.argmax(away @ length))
    if length[away[best]].sum() < 0.25 * length.sum():
        return 0.0
    off = np.mod(angle[away[best]] - angle[best] + quarter / 2, quarter) - quarter / 2
    turn = float(np.average(off, weights=length[away[best]]) + angle[best])
    turn = (turn + quarter / 2) % quarter - quarter / 2
    return turn if abs(turn) > LEAST_TURN else 0.0


def floor_of(world: Floats, triangles: Any) -> tuple[shapely.Polygon, bool, bool] | None:
    """The floor of a body (n, 3), whether it is level (else it is the body's shadow), and whether it is all of it."""
    if not len(triangles):
        return None
    corners = world[triangles]
    level = corners[(np.abs(corners[:, :, 2] - world[:, 2].min()) < LEVEL_M).all(axis=1)]
    for found, is_level in ((level, True), (corners, False)):
        parts = [p for p in shapely.get_parts(_joined(found)) if p.geom_type == "Polygon"]
        if parts:
            best = max(parts, key=lambda p: p.area)
            return best, is_level, shapely.union_all(parts).area < 1.05 * best.area
    return None


def _joined(corners: Floats) -> shapely.Geometry:
    """What triangles (m, 3, 3) cover on the plan."""
    shapes = [shapely.Polygon(t[:, :2]) for t in corners]
    shapes = [shape.buffer(1e-4, join_style="mitre") for shape in shapes if shape.area > 1e-6]
    return shapely.union_all(shapes).buffer(-1e-4, join_style="mitre") if shapes else shapely.Polygon()


def ring_of(body: Body) -> shapely.Polygon | None:
    """The largest area that the edges of a body, drawn as lines only, go round."""
    world = np.round(body.world[:, :2], 4)
    lines = [shapely.LineString(world[list(edge)]) for edge in body.edges if (world[edge[0]] != world[edge[1]]).any()]
    return max(shapely.get_parts(shapely.polygonize(lines)), key=lambda p: p.area, default=None)


@dataclass(frozen=True, eq=False)
class Hole:
    """What a door, a window or a passage takes of its wall: (2,) centre, (2,) direction; z of its sill [m]."""

    centre: Floats
    along: Floats
    width_m: float
    sill_m: float
    height_m: float


def hole_of(own: Body | None, opening: Body | None, wall: Callable[[], Body | None],
            told_m: float | None) -> Hole:
    """From the shape of what fills a wall, of the opening made for it, of that wall, and the width that it is told.

    The opening counts: a leaf has a frame wider than its opening, or hangs open. Raises ValueError where both lack.
    """
    shape = opening or own
    if shape is None:
        raise ValueError("neither it nor its opening has a shape")
    told_m = told_m if told_m is not None and told_m > NARROWEST_DOOR_M else None
    along = _along(own or shape, shape, wall, told_m)
    normal = np.array([-along[1], along[0]])
    across, deep = shape.world[:, :2] @ along, shape.world[:, :2] @ normal
    centre = along * (across.min() + across.max()) / 2 + normal * (deep.min() + deep.max()) / 2
    width = float(across.max() - across.min())
    width = told_m if told_m is not None and told_m <= width + 0.01 else width
    low, high = float(shape.world[:, 2].min()), float(shape.world[:, 2].max())
    return Hole(centre, along, width, low, high - low)


def _along(own: Body, shape: Body, wall: Callable[[], Body | None], told_m: float | None) -> Floats:
    """(2,) the direction of the wall: along the element's own x axis, as the standard has it, unless that cannot be."""
    axes = [axis[:2] / np.linalg.norm(axis[:2]) for axis in own.frame[:, :2].T if np.linalg.norm(axis[:2]) > 0.9]
    axes.append(_longer_side(own))
    if told_m is not None:
        off = [abs(float(np.ptp(shape.world[:, :2] @ axis)) - told_m) for axis in axes]
        best = int(np.argmin(off))
        rivals = [other for other, axis in zip(off, axes, strict=True) if abs(float(axis @ axes[best])) < 0.9]
        if off[best] < 0.15 and min(rivals, default=math.inf) > off[best] + 0.1:
            return np.asarray(axes[best])
    host = wall()
    wanted = _longer_side(host) if host is not None else axes[-1]
    return np.asarray(max(axes, key=lambda axis: round(abs(float(axis @ wanted)), 3)))


def _longer_side(body: Body) -> Floats:
    """(2,) the direction of the longer side of the smallest rectangle round a body's shadow."""
    box = shapely.MultiPoint(body.world[:, :2]).minimum_rotated_rectangle
    if box.geom_type != "Polygon":
        line = shapely.get_coordinates(box)
        arm = line[-1] - line[0]
        return np.asarray(arm / np.linalg.norm(arm)) if np.linalg.norm(arm) > 1e-6 else np.array([1.0, 0.0])
    corners = shapely.get_coordinates(box)[:-1]
    sides = [side_of(corners, i) for i in (0, 1)]
    return np.asarray(max(sides, key=lambda side: side[2])[1])
