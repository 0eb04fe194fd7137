"""IFC (ISO 16739) building files: spaces, doors, windows, stairs and furniture, read with ifcopenshell (an extra)."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely

from world_models.importers.layout import neighbours_without_wall
from world_models.importers.outlines import Floats, cleaned
from world_models.importers.plan import (
    BuildingError,
    Furnishing,
    Gap,
    Names,
    Plan,
    Space,
    Storey,
    Way,
    Window,
    slug,
)
from world_models.importers.things import bounding_steps

READ_ERRORS = (RuntimeError, ValueError, TypeError, AttributeError, IndexError, KeyError, OverflowError)
"""What ifcopenshell and the geometry of a spoilt file raise."""
OPEN_S, OPEN_S_PER_MB, ELEMENT_S = 10.0, 5.0, 20.0
"""A file that takes longer to open, or an element of it to be read, is given up."""
STEPS = 8
"""Boxes that stand for a flight of stairs."""


def read_ifc(path: Path) -> Plan:
    """What is in an IFC file. Raises BuildingError where it cannot be read, or ifcopenshell is not installed.

    The file is read in a process of its own: a spoilt one may end or hang the library's native code.
    """
    if find_spec("ifcopenshell") is None:
        raise BuildingError(f"{path.name}: reading IFC takes ifcopenshell, which is not installed: "
                            ".venv/bin/pip install '.[ifc]'")
    context = multiprocessing.get_context("spawn")
    answers, sender = context.Pipe(duplex=False)
    child = context.Process(target=_answer, args=(path, sender), daemon=True)
    child.start()
    sender.close()
    try:
        answer = heard(path, answers)
    except EOFError:
        answer = f"{path.name}: expected an IFC file, got one that ends ifcopenshell"
    finally:
        child.kill()
        child.join()
        answers.close()
    if isinstance(answer, Plan):
        return answer
    raise BuildingError(answer)


def heard(path: Path, answers: Connection) -> Plan | str:
    """What the reading process says in the end; on the way it tells what it is about to do."""
    limit_s, doing = ELEMENT_S, "starting to read"
    while answers.poll(limit_s):
        said: Next | Plan | str = answers.recv()
        if not isinstance(said, Next):
            return said
        limit_s, doing = said.limit_s, said.doing
    return (f"{path.name}: expected an IFC file, got one that ifcopenshell does not get done with: {doing} was given up"
            f" after {limit_s:.0f} s")


class Next(NamedTuple):
    """What the reading process does next, and how long that may take."""

    doing: str
    limit_s: float


def _answer(path: Path, sender: Connection) -> None:
    """What the reading process does: sends what it is about, and in the end a plan, or what is wrong with the file."""
    try:
        sender.send(_read(path, sender.send))
    except BuildingError as error:
        sender.send(str(error))


def _read(path: Path, tell: Callable[[Next], None]) -> Plan:
    import ifcopenshell
    import ifcopenshell.geom

    try:
        tell(Next("opening it", OPEN_S + OPEN_S_PER_MB * path.stat().st_size / 1e6))
        model = ifcopenshell.open(str(path))
    except (*READ_ERRORS, OSError, ifcopenshell.Error) as error:
        raise BuildingError(f"{path.name}: expected an IFC file, got: {_first_line(error)}") from None
    geometry: Any = ifcopenshell.geom
    settings = geometry.settings()
    reader = _Reader(path, model, lambda element: geometry.create_shape(settings, element), tell)
    try:
        return reader.read()
    except READ_ERRORS as error:
        if isinstance(error, BuildingError):
            raise
        raise BuildingError(f"{path.name}: expected an IFC file with spaces, got: {_first_line(error)}") from None


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0][:200]


@dataclass(frozen=True, eq=False)
class _Body:
    """The shape of an element: corners (n, 3) in its own frame, triangles (m, 3), world_from_element (3, 4) [m]."""

    points: Floats
    triangles: Any
    frame: Floats

    @property
    def world(self) -> Floats:
        return np.asarray(self.points @ self.frame[:, :3].T + self.frame[:, 3])


@dataclass
class _Reader:
    path: Path
    model: Any
    shape: Callable[[Any], Any]
    tell: Callable[[Next], None]
    plan: Plan = field(init=False)
    names: Names = field(init=False)
    by_id: dict[int, str] = field(default_factory=dict)
    storey_of: dict[int, str] = field(default_factory=dict)
    virtual: set[str] = field(default_factory=set)
    bounds: dict[int, list[str]] = field(default_factory=dict)

    def read(self) -> Plan:
        title = slug(self.path.stem) or "building"
        self.tell(Next("reading its storeys", ELEMENT_S))
        self.plan, self.names = Plan(title, self.path.name), Names(title)
        self._storeys()
        self._each("IfcSpace", self._space)
        self._boundaries()
        for storey in self.plan.storeys:
            self.plan.without_wall |= neighbours_without_wall(self.plan.on(storey.name), self.virtual)
        self._each("IfcDoor", self._door)
        self._each("IfcWindow", self._window)
        self._each("IfcStair", self._stairs)
        self._each("IfcFurnishingElement", self._furnishing)
        self._told()
        return self.plan

    def _each(self, kind: str, read: Callable[[Any], None]) -> None:
        """Read every element of a kind; those that cannot be read are left out and named."""
        for element in self.model.by_type(kind):
            self.tell(Next(f"reading {kind} #{element.id()}", ELEMENT_S))
            try:
                read(element)
            except READ_ERRORS as error:
                self.plan.account.left_out.append(f"{kind} #{element.id()} {_name(element)}: {_first_line(error)}")

    def _body(self, element: Any) -> _Body:
        made = self.shape(element)
        points = np.array(made.geometry.verts, float).reshape(-1, 3)
        frame = np.array(made.transformation.matrix, float).reshape(4, 4).T[:3]
        if not len(points) or not np.isfinite(points).all() or not np.isfinite(frame).all():
            raise ValueError("it has no shape")
        return _Body(points, np.array(made.geometry.faces, int).reshape(-1, 3), frame)

    # -- storeys and spaces ------------------------------------------------------------------------------------------

    def _storeys(self) -> None:
        unit = _unit_m(self.model)
        found = []
        for storey in self.model.by_type("IfcBuildingStorey"):
            height = getattr(storey, "Elevation", None)
            found.append((float(height or 0.0) * unit, storey))
        for height, storey in sorted(found, key=lambda pair: (pair[0], pair[1].id())):
            name = self.names.new(_name(storey), "storey")
            self.storey_of[storey.id()] = name
            self.plan.storeys.append(Storey(name, round(height, 3)))

    def _storey(self, element: Any, z_m: float) -> str:
        """The storey that an element is in, or else the highest one below it."""
        for relation in (*getattr(element, "Decomposes", ()), *getattr(element, "ContainedInStructure", ())):
            above = getattr(relation, "RelatingObject", None) or getattr(relation, "RelatingStructure", None)
            if above is not None and above.id() in self.storey_of:
                return self.storey_of[above.id()]
            if above is not None and above.is_a("IfcSpace") and above.id() in self.by_id:
                return self.plan.space(self.by_id[above.id()]).storey
        if not self.plan.storeys:
            self.plan.storeys.append(Storey(self.names.new("storey", "storey"), 0.0))
        below = [s for s in self.plan.storeys if s.elevation_m <= z_m + 0.5]
        return (below or self.plan.storeys)[-1 if below else 0].name

    def _space(self, element: Any) -> None:
        body = self._body(element)
        world = body.world
        low, high = float(world[:, 2].min()), float(world[:, 2].max())
        outline, flat = _floor(world, body.triangles)
        if outline is None:
            raise ValueError("it has no floor with an area")
        if high - low < 1.0:
            raise ValueError(f"it is only {high - low:.2f} m high")
        label = str(getattr(element, "LongName", None) or _name(element))
        title = _name(element) if label == _name(element) else f"{_name(element)} {label}"
        name = self.names.new(title, "space")
        self.by_id[element.id()] = name
        self.plan.spaces.append(Space(name, slug(label.rstrip("0123456789 ")) or "room", label,
                                      self._storey(element, low), outline, low, round(high - low, 4)))
        if not flat:
            self.plan.account.guessed.append(f"space {name}: its shape has no level floor; its shadow on the plan")

    def _boundaries(self) -> None:
        """Which spaces a door bounds, and which meet another without a wall."""
        for relation in self.model.by_type("IfcRelSpaceBoundary"):
            try:
                space, element = relation.RelatingSpace, relation.RelatedBuildingElement
                name = self.by_id.get(space.id()) if space is not None else None
                if name is None:
                    continue
                if element is not None:
                    known = self.bounds.setdefault(element.id(), [])
                    known += [] if name in known else [name]
                elif relation.PhysicalOrVirtualBoundary == "VIRTUAL":
                    self.virtual.add(name)
            except READ_ERRORS:
                self.plan.account.left_out.append(f"IfcRelSpaceBoundary #{relation.id()}: cannot be read")
        if not self.model.by_type("IfcRelSpaceBoundary"):
            self.virtual = {space.name for space in self.plan.spaces}
            self.plan.account.guessed.append("no space boundaries in the file: doors joined to the spaces next to them,"
                                             " spaces that touch taken to have no wall between them")

    # -- doors and windows -------------------------------------------------------------------------------------------

    def _hole(self, element: Any) -> tuple[Floats, Floats, float, float, float]:
        """(2,) centre and (2,) direction on the plan, width, sill and height of what fills a wall [m]."""
        body = self._body(element)
        along = body.frame[:2, 0] / np.linalg.norm(body.frame[:2, 0])
        fills = getattr(element, "FillsVoids", ())
        hole = self._body(fills[0].RelatingOpeningElement) if fills else body
        across = hole.world[:, :2] @ along
        normal = np.array([-along[1], along[0]])
        deep = hole.world[:, :2] @ normal
        centre = along * (across.min() + across.max()) / 2 + normal * (deep.min() + deep.max()) / 2
        width, unit = float(across.max() - across.min()), _unit_m(self.model)
        told = getattr(element, "OverallWidth", None)
        width = float(told) * unit if told and 0.3 < float(told) * unit <= width + 0.01 else width
        low, high = float(hole.world[:, 2].min()), float(hole.world[:, 2].max())
        return centre, along, width, low, high - low

    def _door(self, element: Any) -> None:
        centre, _, width, low, height = self._hole(element)
        rooms = tuple(self.bounds.get(element.id(), ()))
        storey = self.plan.space(rooms[0]).storey if rooms else self._storey(element, low)
        if len(rooms) > 2:
            self.plan.account.guessed.append(f"door {_name(element)}: bounds {', '.join(rooms)}; the two nearest")
        gap = Gap(self.names.new(f"door {element.id()}", "door"), storey, centre, round(width, 4), height,
                  rooms if len(rooms) <= 2 else ())
        self.plan.gaps.append(gap)

    def _window(self, element: Any) -> None:
        centre, along, width, low, height = self._hole(element)
        rooms = self.bounds.get(element.id(), ())
        storey = self.plan.space(rooms[0]).storey if rooms else self._storey(element, low)
        self.plan.windows.append(
            Window(f"window-{element.id()}", storey, centre, along, width, low, height))

    # -- stairs and furniture ----------------------------------------------------------------------------------------

    def _stairs(self, element: Any) -> None:
        parts = [p for r in getattr(element, "IsDecomposedBy", ()) for p in r.RelatedObjects
                 if p.is_a("IfcStairFlight") or p.is_a("IfcSlab")]
        bodies = [body for part in (element, *parts) if (body := self._body_of(part)) is not None]
        if not bodies:
            raise ValueError("it has no shape")
        points = np.concatenate([body.world for body in bodies])
        low, high = float(points[:, 2].min()), float(points[:, 2].max())
        shadow = shapely.MultiPoint(points[:, :2]).envelope
        below = self._nearest(shadow, low)
        above = self._nearest(shadow, high)
        if below is None or above is None or below.storey == above.storey:
            raise ValueError("it does not lead from a space to one of another storey")
        name = self.names.new(f"stairs {element.id()}", "stairs")
        self.plan.ways.append(Way(name, "stairs", (below.name, above.name)))
        centre = np.array([points[:, 0].min() + points[:, 0].max(), points[:, 1].min() + points[:, 1].max()]) / 2
        own = points - np.array([*centre, 0.0])
        self.plan.furnishings.append(Furnishing(name, "stairs", below.name, centre, 0.0, bounding_steps(own, STEPS)))

    def _body_of(self, element: Any) -> _Body | None:
        try:
            return self._body(element)
        except READ_ERRORS:
            return None

    def _nearest(self, shadow: shapely.Geometry, z_m: float) -> Space | None:
        """The space whose floor is at a height and whose outline holds most of a shadow, or is next to it."""
        level = [s for s in self.plan.spaces if abs(s.floor_m - z_m) < 0.5]
        shapes = {s.name: shapely.Polygon(s.outline) for s in level}
        near = [s for s in level if shapes[s.name].distance(shadow) < 0.5]
        return max(near, key=lambda s: (round(shapes[s.name].intersection(shadow).area, 3),
                                        -shapes[s.name].distance(shadow)), default=None)

    def _furnishing(self, element: Any) -> None:
        room = self._room_of(element)
        if room is None:
            raise ValueError("it stands in no space")
        body = self._body(element)
        turn = math.atan2(body.frame[1, 0], body.frame[0, 0])
        c, s = math.cos(turn), math.sin(turn)
        own = body.world @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        low, high = own.min(axis=0), own.max(axis=0)
        middle = np.array([*((low + high) / 2)[:2], 0.0])
        at = np.array([[c, -s], [s, c]]) @ middle[:2]
        kind = slug(_name(element).split(":")[0]) or "furniture"
        self.plan.furnishings.append(
            Furnishing(f"{kind}-{element.id()}", kind, room, at, turn, bounding_steps(own - middle, 1)))

    def _room_of(self, element: Any) -> str | None:
        for relation in getattr(element, "ContainedInStructure", ()):
            if (name := self.by_id.get(relation.RelatingStructure.id())) is not None:
                return name
        return None

    def _told(self) -> None:
        plan, account, count = self.plan, self.plan.account, self.model.by_type
        schema = str(self.model.schema)
        account.used.append(f"{schema}: {len(plan.storeys)} storeys, {len(plan.spaces)} of {len(count('IfcSpace'))} "
                            f"spaces, {len(plan.gaps)} of {len(count('IfcDoor'))} doors, {len(plan.windows)} of "
                            f"{len(count('IfcWindow'))} windows, {len(plan.ways)} of {len(count('IfcStair'))} stairs, "
                            f"{sum(f.kind != 'stairs' for f in plan.furnishings)} of "
                            f"{len(count('IfcFurnishingElement'))} pieces of furniture")
        account.used.append("which spaces a door joins: from space boundaries, and from what lies on both its sides")
        account.guessed.append("all doors between spaces stand open; furniture is its bounding box; colours are ours")
        account.left_out.append(f"the shapes of {len(count('IfcWall'))} walls (rooms are bounded by their spaces), "
                                "slabs, coverings, roofs, railings, materials")


def _name(element: Any) -> str:
    return str(getattr(element, "Name", None) or "").strip()


def _unit_m(model: Any) -> float:
    """The file's unit of length [m]."""
    try:
        import ifcopenshell.util.unit

        return float(ifcopenshell.util.unit.calculate_unit_scale(model))
    except (*READ_ERRORS, ImportError):
        return 1.0


def _floor(world: Floats, triangles: Any) -> tuple[Floats | None, bool]:
    """The outline of a body's floor, and whether it has one that is level; else of its shadow."""
    corners = world[triangles]
    low = world[:, 2].min()
    level = corners[(np.abs(corners[:, :, 2] - low) < 0.05).all(axis=1)]
    for found, flat in ((level, True), (corners, False)):
        shapes = [shapely.Polygon(t[:, :2]) for t in found]
        shapes = [shape.buffer(1e-4, join_style="mitre") for shape in shapes if shape.area > 1e-6]
        joined = shapely.union_all(shapes).buffer(-1e-4, join_style="mitre") if shapes else shapely.Polygon()
        parts = [p for p in shapely.get_parts(joined) if p.geom_type == "Polygon"]
        if parts:
            best = max(parts, key=lambda p: p.area)
            outline = cleaned(shapely.get_coordinates(best.exterior)[:-1])
            if outline is not None:
                return outline, flat
    return None, False
