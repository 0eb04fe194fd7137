"""From an opened IFC file to a plan: which spaces there are, and what joins them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely

from world_models.importers.ifc_relations import containers, filling, host, name_of
from world_models.importers.ifc_shapes import Body, Ground, Hole, floor_of, ground_under, hole_of, ring_of
from world_models.importers.ifc_things import boxed, climbed, column, flight
from world_models.importers.layout import neighbours_without_wall
from world_models.importers.outlines import Floats, outline_of
from world_models.importers.plan import BuildingError, Gap, Names, Plan, Space, Storey, Way, Window, slug

READ_ERRORS = (RuntimeError, ValueError, TypeError, AttributeError, IndexError, KeyError, OverflowError)
"""What ifcopenshell and the geometry of a spoilt file raise."""
ELEMENT_S = 20.0
"""An element that takes longer to be read is given up, and the file with it."""
LOWEST_M, HIGHEST_M, USUAL_M = 1.0, 20.0, 2.5
"""Spaces that are lower are left out; where half of them are higher, the unit is wrong; where none is told."""
COLUMN_M2 = 4.0
"""A smaller hole in a floor, with no space in it, is a column or a shaft that stands in the room."""
PASSAGE_M, PASSAGE_HIGH_M, SILL_M = 0.6, 1.8, 0.3
"""An opening without a door is a way through if it is so wide and high, and its sill is no higher."""
STEP_M = 0.05
BESIDE_M = 1.2
BARRIERS = ("IfcWall", "IfcCurtainWall", "IfcPlate", "IfcRailing")
"""What may stand between spaces that touch."""
CLIMBING_M = 1.5
"""A railing that is higher goes up with stairs."""
FURNITURE = ("IfcFurnishingElement", "IfcColumn", "IfcSanitaryTerminal")
MANY = 3
"""Elements that are left out for one reason are told together if they are more."""


class Next(NamedTuple):
    """What the reading process does next, and how long that may take."""

    doing: str
    limit_s: float


def first_line(error: Exception) -> str:
    """What an error says, in short."""
    return (str(error).strip() or type(error).__name__).splitlines()[0][:200]


@dataclass
class Reader:
    """Reads an IFC file once.

    Attributes:
        stem, source: name of the file, without and with its ending.
        model: the file as ifcopenshell has it.
        shape: the shape of an element; told to be rough, also from its bounding box or its lines on the plan.
        height: how high an element is placed, in the file's unit.
        tell: hears what is done next.
        unit_m: the file's unit of length [m].
    """

    stem: str
    source: str
    model: Any
    shape: Callable[[Any, bool], Body]
    height: Callable[[Any], float | None]
    tell: Callable[[Next], None]
    unit_m: float = 1.0
    plan: Plan = field(init=False)
    names: Names = field(init=False)
    ground: Ground = field(init=False)
    by_id: dict[int, str] = field(default_factory=dict)
    storey_of: dict[int, str] = field(default_factory=dict)
    level_m: dict[str, float] = field(default_factory=dict)
    virtual: set[str] = field(default_factory=set)
    bounds: dict[int, list[str]] = field(default_factory=dict)
    floors: dict[str, shapely.Polygon] = field(default_factory=dict)
    holes: list[tuple[str, shapely.Polygon]] = field(default_factory=list)
    lifts: set[frozenset[str]] = field(default_factory=set)
    flights: int = 0
    flights_told: int = 0
    pieces: int = 0

    def __post_init__(self) -> None:
        title = slug(self.stem) or "building"
        self.plan, self.names = Plan(title, self.source), Names(title)

    def read(self) -> Plan:
        """Everything that is used of the file. Raises BuildingError where it has no space that can be used."""
        self.tell(Next("reading its storeys", ELEMENT_S))
        self._storeys()
        self._spaces()
        self._boundaries()
        self._each("IfcDoor", self._door)
        self._each("IfcOpeningElement", self._passage)
        for storey in self.plan.storeys:
            self._meetings(storey.name)
        self._each("IfcWindow", self._window)
        self._each("IfcStair", self._stairs)
        self._each("IfcStairFlight", self._stairs)
        self._each("IfcTransportElement", self._lift)
        for kind in FURNITURE:
            self._each(kind, self._furnishing)
        self._told()
        return self.plan

    def _all(self, kind: str) -> list[Any]:
        """The elements of a kind; none where the schema does not know it."""
        try:
            return list(self.model.by_type(kind))
        except RuntimeError:
            return []

    def _each(self, kind: str, read: Callable[[Any], None]) -> None:
        """Read every element of a kind; those that cannot be read are left out and named."""
        failed: dict[str, list[str]] = {}
        for element in self._all(kind):
            self.tell(Next(f"reading {kind} #{element.id()}", ELEMENT_S))
            try:
                read(element)
            except READ_ERRORS as error:
                failed.setdefault(first_line(error), []).append(f"#{element.id()} {name_of(element)}".rstrip())
        for why, which in failed.items():
            if len(which) > MANY:
                self.plan.account.left_out.append(f"{len(which)} of {kind}: {why} ({', '.join(which[:MANY])}, ...)")
            else:
                self.plan.account.left_out += [f"{kind} {label}: {why}" for label in which]

    def _body(self, element: Any) -> Body:
        return self.ground.under(self.shape(element, False))

    def _body_of(self, element: Any) -> Body | None:
        """Its shape where it has one."""
        try:
            return self._body(element)
        except READ_ERRORS:
            return None

    # -- storeys and spaces ------------------------------------------------------------------------------------------

    def _storeys(self) -> None:
        found = []
        for storey in self.model.by_type("IfcBuildingStorey"):
            told, placed = getattr(storey, "Elevation", None), self.height(storey)
            height = told if told is not None else placed
            found.append((float(height or 0.0) * self.unit_m, storey, placed))
        apart = len({placed for _, _, placed in found}) == len(found)
        for height, storey, placed in sorted(found, key=lambda row: (row[0], row[1].id())):
            name = self.names.new(name_of(storey), "storey")
            self.storey_of[storey.id()] = name
            self.level_m[name] = placed * self.unit_m if apart and placed is not None else height
            self.plan.storeys.append(Storey(name, round(height, 3)))

    def _storey(self, element: Any, z_m: float) -> str:
        """The storey that an element is in, or else the highest one below it."""
        for above in containers(element):
            if above.id() in self.storey_of:
                return self.storey_of[above.id()]
            if above.is_a("IfcSpace") and above.id() in self.by_id:
                return self.plan.space(self.by_id[above.id()]).storey
        if not self.plan.storeys:
            self.plan.storeys.append(Storey(self.names.new("storey", "storey"), 0.0))
        below = [s for s in self.plan.storeys if self.level_m.get(s.name, s.elevation_m) <= z_m + 0.5]
        return (below or self.plan.storeys)[-1 if below else 0].name

    def _spaces(self) -> None:
        bodies: dict[int, Body] = {}

        def shape(element: Any) -> None:
            try:
                bodies[element.id()] = self.shape(element, False)
            except READ_ERRORS:
                bodies[element.id()] = self.shape(element, True)

        self._each("IfcSpace", shape)
        self.ground = ground_under(bodies.values())
        told = self.plan.account.guessed
        if self.ground.zero.any():
            told.append("far from the file's zero: the plan's is at x {:.0f}, y {:.0f} m of the file".format(
                *self.ground.zero))
        if turn := -np.degrees(self.ground.turn_rad):
            told.append(f"turned by {turn:.1f} degrees, so that most walls run along x and y")
        self._each("IfcSpace", lambda element: self._space(element, bodies.get(element.id())))
        self._stand_in_holes()
        self._unstack()
        count = len(self.model.by_type("IfcSpace"))
        if not count:
            found = ", ".join(f"{len(self._all(kind))} {kind}" for kind in ("IfcWall", "IfcDoor", "IfcBuildingStorey"))
            raise BuildingError(f"{self.source}: expected rooms (IfcSpace), got none, only {found}; most programs ask "
                                "at export whether rooms, spaces or zones go into the file")
        if not self.plan.spaces:
            why = self.plan.account.left_out[:MANY]
            raise BuildingError(f"{self.source}: expected spaces with a floor, got none that can be used of {count}: "
                                f"{'; '.join(why)}")
        if (usual := float(np.median([space.height_m for space in self.plan.spaces]))) > HIGHEST_M:
            raise BuildingError(f"{self.source}: expected rooms up to {HIGHEST_M:.0f} m high, got half of them higher "
                                f"than {usual:.0f} m: is its unit of length, {self.unit_m:g} m, right?")

    def _space(self, element: Any, raw: Body | None) -> None:
        if raw is None:
            return
        body, name = self.ground.under(raw), name_of(element)
        world = body.world
        low, high = float(world[:, 2].min()), float(world[:, 2].max())
        found, drawn = floor_of(world, body.triangles), None
        if found is None and high - low < STEP_M and (drawn := ring_of(body)) is not None:
            found, high = (drawn, True, True), low + USUAL_M
        if found is None or np.abs(world).max() > 5000.0:
            raise ValueError("it has no floor with an area")
        if high - low < LOWEST_M:
            raise ValueError(f"it is only {high - low:.2f} m high")
        floor, is_level, is_all = found
        columns = [h for ring in floor.interiors if (h := shapely.Polygon(ring)).area < COLUMN_M2]
        rings = [ring for ring in floor.interiors if shapely.Polygon(ring).area >= COLUMN_M2]
        outline = outline_of(shapely.Polygon(floor.exterior, rings))
        if outline is None:
            raise ValueError("it has no floor with an area")
        label = str(getattr(element, "LongName", None) or name)
        made = self.names.new(name if label == name else f"{name} {label}", "space")
        self.by_id[element.id()] = made
        self.floors[made] = floor
        self.holes += [(made, hole) for hole in columns]
        self.plan.spaces.append(Space(made, slug(label.rstrip("0123456789 ")) or "room", label,
                                      self._storey(element, low), outline, low, round(high - low, 4)))
        for told, why in ((drawn is not None, f"drawn as lines only; taken to be {USUAL_M} m high"),
                          (not is_level, "its shape has no level floor; its shadow on the plan"),
                          (not is_all, "its floor is in several parts; the largest"),
                          (bool(rings), "it goes round what is no part of it; a thin wall across it, as rooms here have"
                                        " one border")):
            if told:
                self.plan.account.guessed.append(f"space {made}: {why}")

    def _stand_in_holes(self) -> None:
        """Small holes in floors are things that stand there, unless a space lies in them."""
        for number, (name, hole) in enumerate(self.holes):
            own = self.plan.space(name)
            others = [s.name for s in self.plan.on(own.storey) if s.name != name]
            if any(self.floors[other].representative_point().within(hole) for other in others):
                continue
            self.plan.furnishings.append(column(f"column-{number + 1}", own, hole))

    def _unstack(self) -> None:
        """Spaces over others of their storey, as where a file has one storey for all, get a storey of their own."""
        for storey in list(self.plan.storeys):
            lower: list[Space] = []
            upper: list[Space] = []
            for space in sorted(self.plan.on(storey.name), key=lambda s: s.floor_m):
                floor = self.floors[space.name]
                over = [s for s in lower if space.floor_m - s.floor_m > s.height_m - STEP_M
                        and self.floors[s.name].intersection(floor).area > 0.5 * floor.area]
                (upper if over else lower).append(space)
            if not upper:
                continue
            raised = Storey(self.names.new(f"{storey.name} upper", "storey"), round(upper[0].floor_m, 3))
            self.plan.storeys.insert(self.plan.storeys.index(storey) + 1, raised)
            moved = {space.name for space in upper}
            self.plan.spaces = [replace(s, storey=raised.name) if s.name in moved else s for s in self.plan.spaces]
            self.plan.account.guessed.append(f"{', '.join(space.name for space in upper)}: over other spaces of "
                                             f"{storey.name}; in a storey of their own, {raised.name}")

    def _boundaries(self) -> None:
        """Which spaces a door bounds, and which meet another without a wall."""
        for relation in self.model.by_type("IfcRelSpaceBoundary"):
            try:
                space, element = relation.RelatingSpace, relation.RelatedBuildingElement
                name = self.by_id.get(space.id()) if space is not None else None
                if name is None:
                    continue
                if element is None or element.is_a("IfcVirtualElement"):
                    self.virtual |= {name} if relation.PhysicalOrVirtualBoundary == "VIRTUAL" or element else set()
                    continue
                for bounded in (element, *filling(element)):
                    known = self.bounds.setdefault(bounded.id(), [])
                    known += [] if name in known else [name]
            except READ_ERRORS:
                self.plan.account.left_out.append(f"IfcRelSpaceBoundary #{relation.id()}: cannot be read")
        if not self.model.by_type("IfcRelSpaceBoundary"):
            self.plan.account.guessed.append("no space boundaries in the file: doors joined to the spaces next to them")

    def _meetings(self, storey: str) -> None:
        """Which spaces meet without a wall: as the boundaries say, or else where nothing stands between them."""
        spaces = self.plan.on(storey)
        names = self.virtual or {space.name for space in spaces}
        pairs = neighbours_without_wall(spaces, names)
        if self.virtual or not pairs:
            self.plan.without_wall |= pairs
            return
        shadows = []
        for element in (element for kind in BARRIERS for element in self._all(kind)):
            self.tell(Next(f"reading {element.is_a()} #{element.id()}", ELEMENT_S))
            body = self._body_of(element)
            if body is not None and self._stands_on(element, body, spaces):
                shadows.append(body.shadow)
        self.plan.barriers[storey] = [shadow for shadow in shadows if not shadow.is_empty]
        self.plan.without_wall |= neighbours_without_wall(spaces, names, self.plan.barriers[storey])

    @staticmethod
    def _stands_on(element: Any, body: Body, spaces: list[Space]) -> bool:
        """Whether something would stop one who walks on the floor of these spaces; a railing of stairs leads up."""
        low, high = float(body.world[:, 2].min()), float(body.world[:, 2].max())
        if element.is_a("IfcRailing") and high - low > CLIMBING_M:
            return False
        return any(low < space.floor_m + 1.0 and high > space.floor_m + 0.3 for space in spaces)

    # -- doors, passages and windows ---------------------------------------------------------------------------------

    def _hole(self, element: Any, opening: Any, told_m: float | None) -> Hole:
        own = self._body_of(element) if element is not None else None
        made = self._body_of(opening) if opening is not None else None
        wall = host(opening)
        return hole_of(own, made, lambda: self._body_of(wall) if wall is not None else None, told_m)

    def _filled(self, element: Any) -> Hole:
        fills, told = getattr(element, "FillsVoids", ()), getattr(element, "OverallWidth", None)
        return self._hole(element, fills[0].RelatingOpeningElement if fills else None,
                          float(told) * self.unit_m if told else None)

    def _door(self, element: Any) -> None:
        hole = self._filled(element)
        rooms = tuple(self.bounds.get(element.id(), ()))
        if len(rooms) > 2:
            self.plan.account.guessed.append(f"door {name_of(element)}: bounds {', '.join(rooms)}; the two nearest")
        self.plan.gaps.append(self._gap(f"door {element.id()}", element, hole, rooms, True))

    def _passage(self, element: Any) -> None:
        """An opening in a wall that no door or window fills, if one can walk through it."""
        wall = host(element)
        kind = f"{getattr(element, 'PredefinedType', None)} {getattr(element, 'ObjectType', None)}".upper()
        if element.HasFillings or wall is None or not wall.is_a("IfcWall") or "RECESS" in kind:
            return
        hole = self._hole(None, element, None)
        gap = self._gap(f"passage {element.id()}", wall, hole, tuple(self.bounds.get(element.id(), ())), False)
        floors = [s.floor_m for s in self.plan.on(gap.storey) if self._away(s.name, hole.centre) < BESIDE_M]
        sill = hole.sill_m - min(floors, default=hole.sill_m, key=lambda floor: abs(floor - hole.sill_m))
        if sill <= SILL_M and hole.height_m + sill >= PASSAGE_HIGH_M and hole.width_m >= PASSAGE_M:
            self.plan.gaps.append(gap)

    def _gap(self, title: str, element: Any, hole: Hole, rooms: tuple[str, ...], has_leaf: bool) -> Gap:
        storey = self.plan.space(rooms[0]).storey if rooms else self._storey_at(element, hole)
        return Gap(self.names.new(title, "door"), storey, hole.centre, round(hole.width_m, 4), hole.height_m,
                   rooms if len(rooms) <= 2 else (), hole.along, has_leaf)

    def _storey_at(self, element: Any, hole: Hole) -> str:
        """The storey a door is in; another than the file says where only that one has a space beside it."""
        told = self._storey(element, hole.sill_m)
        beside = {s.name: s.storey for s in self.plan.spaces
                  if abs(s.floor_m - hole.sill_m) < 0.5 and self._away(s.name, hole.centre) < BESIDE_M}
        if told in beside.values() or not beside:
            return told
        return beside[min(beside, key=lambda name: self._away(name, hole.centre))]

    def _away(self, space: str, point: Floats) -> float:
        return float(self.floors[space].distance(shapely.Point(point)))

    def _window(self, element: Any) -> None:
        hole = self._filled(element)
        rooms = self.bounds.get(element.id(), ())
        storey = self.plan.space(rooms[0]).storey if rooms else self._storey(element, hole.sill_m)
        self.plan.windows.append(Window(f"window-{element.id()}", storey, hole.centre, hole.along, hole.width_m,
                                        hole.sill_m, hole.height_m))

    # -- stairs and furniture ----------------------------------------------------------------------------------------

    def _stairs(self, element: Any) -> None:
        if element.is_a("IfcStairFlight") and any(above.is_a("IfcStair") for above in containers(element)):
            return
        self.flights_told += 1
        parts = [p for r in getattr(element, "IsDecomposedBy", ()) for p in r.RelatedObjects
                 if p.is_a("IfcStairFlight") or p.is_a("IfcSlab")]
        bodies = [body for part in (element, *parts) if (body := self._body_of(part)) is not None]
        if not bodies:
            raise ValueError("it has no shape")
        points = np.concatenate([body.world for body in bodies])
        ways = climbed(points, self.plan.spaces)
        if not ways:
            raise ValueError("it does not lead from a space to one of another storey")
        name = self.names.new(f"stairs {element.id()}", "stairs")
        for number, (below, above) in enumerate(ways):
            self.plan.ways.append(Way(name if not number else self.names.new(name, "stairs"), "stairs",
                                      (below.name, above.name)))
        self.plan.furnishings.append(flight(name, ways[0][0].name, points))
        self.flights += 1

    def _lift(self, element: Any) -> None:
        """A lift joins the spaces of all storeys that are over each other where it is."""
        kind = getattr(element, "PredefinedType", None) or getattr(element, "OperationType", None) or "ELEVATOR"
        if kind != "ELEVATOR":
            raise ValueError(f"it is no lift ({kind})")
        world = self._body(element).world
        middle = (world.min(axis=0) + world.max(axis=0))[:2] / 2
        shaft = [s for s in sorted(self.plan.spaces, key=lambda s: s.floor_m) if self._away(s.name, middle) == 0.0]
        if len({space.storey for space in shaft}) < 2:
            raise ValueError("there are no spaces of two storeys where it is")
        for below, above in pairwise(shaft):
            if below.storey != above.storey and frozenset((below.name, above.name)) not in self.lifts:
                self.lifts.add(frozenset((below.name, above.name)))
                self.plan.ways.append(Way(self.names.new(f"lift {element.id()}", "lift"), "elevator",
                                          (below.name, above.name)))

    def _furnishing(self, element: Any) -> None:
        name = name_of(element) or element.is_a().removeprefix("Ifc")
        room, body = self._room_of(element), None
        if room is None:
            body = self._body(element)
            room = self._room_at(body)
        if room is None:
            raise ValueError("it stands in no space")
        kind = slug(name.split(":")[0]) or "furniture"
        self.plan.furnishings.append(boxed(f"{kind}-{element.id()}", kind, room, body or self._body(element)))
        self.pieces += 1

    def _room_of(self, element: Any) -> str | None:
        for relation in getattr(element, "ContainedInStructure", ()):
            if (name := self.by_id.get(relation.RelatingStructure.id())) is not None:
                return name
        return None

    def _room_at(self, body: Body) -> str | None:
        """The space whose floor has the middle of a thing over it; the smallest, where spaces lie in each other."""
        low, high = body.world.min(axis=0), body.world.max(axis=0)
        middle = (low + high) / 2
        over = [s for s in self.plan.spaces if s.floor_m - 0.5 < middle[2] < s.floor_m + s.height_m
                and self._away(s.name, middle[:2]) == 0.0]
        return min(over, key=lambda s: self.floors[s.name].area).name if over else None

    def _told(self) -> None:
        plan, account = self.plan, self.plan.account

        def count(*kinds: str) -> int:
            return len([element for kind in kinds for element in self._all(kind)])

        doors = len([gap for gap in plan.gaps if gap.has_leaf])
        passages = f"{len(plan.gaps) - doors} openings without a door, " if len(plan.gaps) > doors else ""
        account.used.append(f"{self.model.schema}: {len(plan.storeys)} storeys, {len(plan.spaces)} of "
                            f"{count('IfcSpace')} spaces, {doors} of {count('IfcDoor')} doors, {passages}"
                            f"{len(plan.windows)} of {count('IfcWindow')} windows, {self.flights} of "
                            f"{self.flights_told} stairs, {self.pieces} of {count(*FURNITURE)} pieces of furniture")
        if lifts := count("IfcTransportElement"):
            account.used.append(f"{lifts} lifts: {len(self.lifts)} rides from a storey to the next")
        account.used.append(f"its unit of length: {self.unit_m:g} m")
        account.used.append("which spaces a door joins: from space boundaries, and from what lies on both its sides")
        account.guessed.append("all doors between spaces stand open; furniture is its bounding box; colours are ours")
        account.left_out.append(f"the shapes of {count('IfcWall')} walls (rooms are bounded by their spaces), "
                                "slabs, coverings, roofs, railings, materials")
