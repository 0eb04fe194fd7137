"""An opened IFC file: names and relations of its elements, and what their shapes are on a plan.

The floor of a space, the wall hole of a door, the footprint of a wall; boxes for stairs, furniture and columns, and the
spaces that stairs join.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely

from harvey_buildings.fitting.building_plan import BuildingPlan, Furnishing, Names, Space, slug
from harvey_buildings.fitting.placement import build_bounding_boxes
from harvey_buildings.fitting.polygons import Floats, find_turn, side_of


def name_of(element: Any) -> str:
    """Its name, or an empty text."""
    return str(getattr(element, "Name", None) or "").strip()


def containers(element: Any) -> Iterator[Any]:
    """The elements that this one is part of or contained in, from the nearest up."""
    seen: set[int] = set()
    while element is not None and element.id() not in seen:
        seen.add(element.id())
        above = [getattr(relation, "RelatingObject", None) or getattr(relation, "RelatingStructure", None)
                 for way in ("Decomposes", "ContainedInStructure") for relation in getattr(element, way, None) or ()]
        element = next((one for one in above if one is not None), None)
        if element is not None:
            yield element


def host(opening: Any) -> Any:
    """The wall that an opening is in; None where there is none."""
    voids = getattr(opening, "VoidsElements", None) or ()
    return voids[0].RelatingBuildingElement if voids else None


def filling(opening: Any) -> list[Any]:
    """The doors and windows in an opening; some programs bound a space by the opening alone."""
    return [relation.RelatedBuildingElement for relation in getattr(opening, "HasFillings", ())]


MAX_ORIGIN_DISTANCE_M = 1000.0
"""A building further from the file's zero is moved near it."""
LEVEL_TOLERANCE_M = 0.05
MIN_DOOR_WIDTH_M = 0.3


@dataclass(frozen=True, eq=False)
class ElementShape:
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

    def place_on_plan(self, body: ElementShape) -> ElementShape:
        """The body in the plan's frame."""
        if not self.zero.any() and self.turn_rad == 0.0:
            return body
        c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
        frame = body.frame.copy()
        frame[:2, 3] -= self.zero
        frame[:2] = np.array([[c, s], [-s, c]]) @ frame[:2]
        return ElementShape(body.points, body.triangles, frame, body.edges)


def find_plan_origin(bodies: Iterable[ElementShape]) -> PlanOrigin:
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


def find_ring(body: ElementShape) -> shapely.Polygon | None:
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
    own: ElementShape | None, opening: ElementShape | None, wall: Callable[[], ElementShape | None],
    stated_m: float | None,
) -> WallHole:
    """The wall hole of an element; its opening counts first, as a door's frame is wider, or its leaf is drawn open.

    Args:
        own, opening: shape of the element (else its stated size, where it stands) and of the opening that it fills,
            where they have one.
        wall: reads the shape of the wall.
        stated_m: width according to the file, where it says so.

    Raises:
        ValueError: both shapes lack.
    """
    shape = opening or own
    if shape is None:
        raise ValueError("neither it nor its opening has a shape, and its place, width and height are not all stated")
    stated_m = stated_m if stated_m is not None and stated_m > MIN_DOOR_WIDTH_M else None
    along = _find_direction(own or shape, shape, wall, stated_m)
    normal = np.array([-along[1], along[0]])
    across, deep = shape.world[:, :2] @ along, shape.world[:, :2] @ normal
    centre = along * (across.min() + across.max()) / 2 + normal * (deep.min() + deep.max()) / 2
    width = float(across.max() - across.min())
    width = stated_m if stated_m is not None and stated_m <= width + 0.01 else width
    low, high = float(shape.world[:, 2].min()), float(shape.world[:, 2].max())
    return WallHole(centre, along, width, low, high - low)


def _find_direction(
    own: ElementShape, shape: ElementShape, wall: Callable[[], ElementShape | None], stated_m: float | None
) -> Floats:
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


def _longer_side(body: ElementShape) -> Floats:
    """(2,) direction of the longer side of the minimum rotated rectangle of a body's corners on the plan."""
    box = shapely.MultiPoint(body.world[:, :2]).minimum_rotated_rectangle
    if box.geom_type != "Polygon":
        line = shapely.get_coordinates(box)
        arm = line[-1] - line[0]
        return np.asarray(arm / np.linalg.norm(arm)) if np.linalg.norm(arm) > 1e-6 else np.array([1.0, 0.0])
    corners = shapely.get_coordinates(box)[:-1]
    sides = [side_of(corners, i) for i in (0, 1)]
    return np.asarray(max(sides, key=lambda side: side[2])[1])


READ_ERRORS = (RuntimeError, ValueError, TypeError, AttributeError, IndexError, KeyError, OverflowError)
"""What ifcopenshell and the geometry of a broken file raise."""
ELEMENT_S = 20.0
"""Time limit to read one element; beyond it the file is given up."""
MAX_LISTED = 3
"""More elements that are left out for the same reason are reported together."""


class ReadingProgress(NamedTuple):
    """What the reading process does next, and its time limit."""

    doing: str
    limit_s: float


def first_line(error: Exception) -> str:
    """The first line of an error's text, shortened."""
    return (str(error).strip() or type(error).__name__).splitlines()[0][:200]


@dataclass
class IfcFile:
    """The file, and what is known of it while it is read.

    Attributes:
        stem, source: name of the file without and with its suffix.
        model: the file as ifcopenshell has it.
        shape: reads the shape of an element; with True also roughly, from its bounding box or its lines on the plan.
        placement: reads the placement (4, 4) of an element, in the file's unit; None where it has none.
        send: takes progress messages. doing: what is read now, with its entity.
        unit_m: the file's unit of length [m].
        origin: origin and direction of the plan in the file; known once the spaces are.
        by_id: the plan's name of each space, by the file's id.
        floors: the floor polygon of each space, by name.
    """

    stem: str
    source: str
    model: Any
    shape: Callable[[Any, bool], ElementShape]
    placement: Callable[[Any], Floats | None]
    send: Callable[[ReadingProgress], None]
    unit_m: float = 1.0
    doing: str = "reading its unit of length"
    plan: BuildingPlan = field(init=False)
    names: Names = field(init=False)
    origin: PlanOrigin = field(init=False)
    by_id: dict[int, str] = field(default_factory=dict)
    floors: dict[str, shapely.Polygon] = field(default_factory=dict)

    def __post_init__(self) -> None:
        title = slug(self.stem) or "building"
        self.plan, self.names = BuildingPlan(title, self.source), Names(title)

    def all(self, *kinds: str) -> list[Any]:
        """All elements of these kinds; kinds that the schema does not know have none."""
        found: list[Any] = []
        for kind in kinds:
            try:
                found += self.model.by_type(kind)
            except RuntimeError:
                continue
        return found

    def each(self, kind: str, read: Callable[[Any], None]) -> None:
        """Read every element of a kind; those that cannot be read are left out and reported."""
        failed: dict[str, list[str]] = {}
        for element in self.all(kind):
            self.report_progress(element)
            try:
                read(element)
            except READ_ERRORS as error:
                failed.setdefault(first_line(error), []).append(f"#{element.id()} {name_of(element)}".rstrip())
        for why, which in failed.items():
            if len(which) > MAX_LISTED:
                listed = ", ".join(which[:MAX_LISTED])
                self.plan.report.left_out.append(f"{len(which)} of {kind}: {why} ({listed}, ...)")
            else:
                self.plan.report.left_out += [f"{kind} {label}: {why}" for label in which]

    def report_progress(self, element: Any) -> None:
        """Report that an element is read now, which starts its time limit."""
        self.doing = f"reading {element.is_a()} #{element.id()}"
        self.send(ReadingProgress(self.doing, ELEMENT_S))

    def body(self, element: Any) -> ElementShape:
        """Shape of an element on the plan. Raises ValueError, or what ifcopenshell raises, where it has none."""
        return self.origin.place_on_plan(self.shape(element, False))

    def body_of(self, element: Any) -> ElementShape | None:
        """Shape of an element on the plan; None where it has none."""
        try:
            return self.body(element)
        except READ_ERRORS:
            return None

    def stated_box(self, element: Any) -> ElementShape | None:
        """The hole of a door or window without a shape: its stated size, from its placement along x and up, as the
        standard has it; None where the file does not say it whole."""
        frame = self.placement(element)
        size = [getattr(element, name, None) for name in ("OverallWidth", "OverallHeight")]
        if frame is None or not all(size):
            return None
        corners = np.array([[x, 0.0, z] for x in (0.0, size[0]) for z in (0.0, size[1])]) * self.unit_m
        frame[:3, 3] *= self.unit_m
        return self.origin.place_on_plan(ElementShape(corners, (), frame[:3]))

    def distance_m(self, space: str, point: Floats) -> float:
        """Distance on the plan of a point (2,) from the floor of a space [m]."""
        return float(self.floors[space].distance(shapely.Point(point)))


STAIR_BOXES = 8
"""Boxes of a flight of stairs."""
MAX_REACH_M = 0.5
"""Distance, in height and on the plan, within which stairs begin or end at a floor."""
MAX_RAIL_M = 1.3
"""How far the shape of stairs, with its railing, may reach above the upper floor."""


def build_box(name: str, kind: str, room: str, body: ElementShape) -> Furnishing:
    """A thing as its bounding box in its own frame."""
    turn = math.atan2(body.frame[1, 0], body.frame[0, 0])
    c, s = math.cos(turn), math.sin(turn)
    own = body.world @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    low, high = own.min(axis=0), own.max(axis=0)
    middle = np.array([*((low + high) / 2)[:2], 0.0])
    at = np.array([[c, -s], [s, c]]) @ middle[:2]
    return Furnishing(name, kind, room, at, turn, build_bounding_boxes(own - middle, 1))


def build_column(name: str, space: Space, hole: shapely.Polygon) -> Furnishing:
    """A column from floor to ceiling in a hole of a floor."""
    corners = shapely.get_coordinates(hole.minimum_rotated_rectangle)[:-1]
    arm = corners[1] - corners[0]
    points = np.array([(x, y, z) for x, y in corners for z in (space.floor_m, space.floor_m + space.height_m)])
    body = ElementShape(points, (), np.eye(4)[:3])
    turn = math.atan2(arm[1], arm[0])
    c, s = math.cos(turn), math.sin(turn)
    frame = np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    return build_box(name, "column", space.name, ElementShape(body.points @ frame[:, :3], (), frame))


def build_stairs(name: str, room: str, points: Floats) -> Furnishing:
    """Stairs with corners (n, 3) as a row of boxes."""
    centre = np.array([points[:, 0].min() + points[:, 0].max(), points[:, 1].min() + points[:, 1].max()]) / 2
    boxes = build_bounding_boxes(points - np.array([*centre, 0.0]), STAIR_BOXES)
    return Furnishing(name, "stairs", room, centre, 0.0, boxes)


def find_climbed_spaces(points: Floats, spaces: Sequence[Space]) -> list[tuple[Space, Space]]:
    """The pairs of spaces, lower first, of consecutive floors that stairs with corners (n, 3) join."""
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    footprint = shapely.MultiPoint(points[:, :2]).envelope
    ends = [_at(footprint, z, spaces) for z in (low, high)]
    if ends[0] is not None and ends[1] is not None and ends[0].storey != ends[1].storey:
        return [(ends[0], ends[1])]
    levels = sorted({round(s.floor_m, 1) for s in spaces if low - MAX_REACH_M < s.floor_m < high + MAX_REACH_M})
    found: list[Space] = []
    for level in levels:
        space = _at(footprint, level, spaces)
        if space is not None and space.storey not in {other.storey for other in found}:
            found.append(space)
    reaches = len(found) > 1 and high - found[-1].floor_m < MAX_RAIL_M and abs(low - found[0].floor_m) < MAX_REACH_M
    return list(pairwise(found)) if reaches else []


def _at(footprint: shapely.Geometry, z_m: float, spaces: Sequence[Space]) -> Space | None:
    """The space with its floor at a height whose outline holds most of a footprint, or is next to it."""
    level = [s for s in spaces if abs(s.floor_m - z_m) < MAX_REACH_M]
    shapes = {s.name: shapely.Polygon(s.outline) for s in level}
    near = [s for s in level if shapes[s.name].distance(footprint) < MAX_REACH_M]
    return max(near, key=lambda s: (round(shapes[s.name].intersection(footprint).area, 3),
                                    -shapes[s.name].distance(footprint)), default=None)
