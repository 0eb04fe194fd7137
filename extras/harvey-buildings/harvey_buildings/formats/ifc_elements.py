"""The elements of an opened IFC file read into its building plan.

Storeys and spaces first, then doors, openings, windows and places without a wall between them, then furniture, stairs
and elevators.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from harvey_buildings.fitting.building_plan import BuildingError, RoomLink, Space, Storey, WallOpening, Window, slug
from harvey_buildings.fitting.layout import neighbours_without_wall
from harvey_buildings.fitting.polygons import extract_outline
from harvey_buildings.formats.ifc_file import (
    MAX_LISTED,
    READ_ERRORS,
    ElementShape,
    IfcFile,
    WallHole,
    build_box,
    build_column,
    build_stairs,
    containers,
    filling,
    find_climbed_spaces,
    find_floor,
    find_hole,
    find_plan_origin,
    find_ring,
    host,
    name_of,
)

MIN_HEIGHT_M, MAX_HEIGHT_M, DEFAULT_HEIGHT_M = 1.0, 20.0, 2.5
"""Lower spaces are left out; where half of them are higher, the unit is wrong; height of spaces drawn as lines."""
MAX_COLUMN_M2 = 4.0
"""A smaller hole in a floor, with no space in it, is a column or a shaft that stands in the room."""
STEP_M = 0.05
MAX_COORDINATE_M = 5000.0
OTHER_KINDS = ("IfcWall", "IfcDoor", "IfcBuildingStorey")
"""What the error for a file without spaces counts."""


class Spaces:
    """Reads storeys and spaces, and finds the storey of other elements."""

    def __init__(self, file: IfcFile) -> None:
        self._file, self._plan = file, file.plan
        self._storey_of: dict[int, str] = {}
        self._level_m: dict[str, float] = {}
        self._holes: list[tuple[str, shapely.Polygon]] = []

    def read(self) -> None:
        """Read storeys and spaces into the file's plan. Raises BuildingError where it has no usable space."""
        self._read_storeys()
        self._read_spaces()

    def _read_storeys(self) -> None:
        found = []
        for storey in self._file.all("IfcBuildingStorey"):
            elevation, frame = getattr(storey, "Elevation", None), self._file.placement(storey)
            placed = None if frame is None else float(frame[2, 3])
            height = elevation if elevation is not None else placed
            found.append((float(height or 0.0) * self._file.unit_m, storey, placed))
        apart = len({placed for _, _, placed in found}) == len(found)
        for height, storey, placed in sorted(found, key=lambda row: (row[0], row[1].id())):
            name = self._file.names.new(name_of(storey), "storey")
            self._storey_of[storey.id()] = name
            self._level_m[name] = placed * self._file.unit_m if apart and placed is not None else height
            self._plan.storeys.append(Storey(name, round(height, 3)))

    def storey_of(self, element: Any, z_m: float) -> str:
        """The storey that an element is contained in, or else the highest one below it."""
        for above in containers(element):
            if above.id() in self._storey_of:
                return self._storey_of[above.id()]
            if above.is_a("IfcSpace") and above.id() in self._file.by_id:
                return self._plan.space(self._file.by_id[above.id()]).storey
        if not self._plan.storeys:
            self._plan.storeys.append(Storey(self._file.names.new("storey", "storey"), 0.0))
        below = [s for s in self._plan.storeys if self._level_m.get(s.name, s.elevation_m) <= z_m + 0.5]
        return (below or self._plan.storeys)[-1 if below else 0].name

    def _read_spaces(self) -> None:
        bodies: dict[int, ElementShape] = {}

        def read_shape(element: Any) -> None:
            try:
                bodies[element.id()] = self._file.shape(element, False)
            except READ_ERRORS:
                bodies[element.id()] = self._file.shape(element, True)

        self._file.each("IfcSpace", read_shape)
        self._file.origin = find_plan_origin(bodies.values())
        guessed = self._plan.report.guessed
        if self._file.origin.zero.any():
            guessed.append("far from the file's zero: the plan's is at x {:.0f}, y {:.0f} m of the file".format(
                *self._file.origin.zero))
        if turn := -np.degrees(self._file.origin.turn_rad):
            guessed.append(f"turned by {turn:.1f} degrees, so that most walls run along x and y")
        self._file.each("IfcSpace", lambda element: self._read_space(element, bodies.get(element.id())))
        self._add_columns()
        self._split_stacked_storeys()
        count, source = len(self._file.all("IfcSpace")), self._file.source
        if not count:
            found = ", ".join(f"{len(self._file.all(kind))} {kind}" for kind in OTHER_KINDS)
            raise BuildingError(f"{source}: expected rooms (IfcSpace), got none, only {found}; most programs ask at"
                                " export whether rooms, spaces or zones go into the file")
        if not self._plan.spaces:
            why = self._plan.report.left_out[:MAX_LISTED]
            raise BuildingError(f"{source}: expected spaces with a floor, got none that can be used of {count}: "
                                f"{'; '.join(why)}")
        if (usual := float(np.median([space.height_m for space in self._plan.spaces]))) > MAX_HEIGHT_M:
            raise BuildingError(f"{source}: expected rooms up to {MAX_HEIGHT_M:.0f} m high, got half of them higher "
                                f"than {usual:.0f} m: is its unit of length, {self._file.unit_m:g} m, right?")

    def _read_space(self, element: Any, raw: ElementShape | None) -> None:
        if raw is None:
            return
        body, name = self._file.origin.place_on_plan(raw), name_of(element)
        world = body.world
        low, high = float(world[:, 2].min()), float(world[:, 2].max())
        found, drawn = find_floor(world, body.triangles), None
        if found is None and high - low < STEP_M and (drawn := find_ring(body)) is not None:
            found, high = (drawn, True, True), low + DEFAULT_HEIGHT_M
        if found is None or np.abs(world).max() > MAX_COORDINATE_M:
            raise ValueError("it has no floor with an area")
        if high - low < MIN_HEIGHT_M:
            raise ValueError(f"it is only {high - low:.2f} m high")
        floor, is_level, is_all = found
        columns = [h for ring in floor.interiors if (h := shapely.Polygon(ring)).area < MAX_COLUMN_M2]
        rings = [ring for ring in floor.interiors if shapely.Polygon(ring).area >= MAX_COLUMN_M2]
        outline = extract_outline(shapely.Polygon(floor.exterior, rings))
        if outline is None:
            raise ValueError("it has no floor with an area")
        label = str(getattr(element, "LongName", None) or name)
        made = self._file.names.new(name if label == name else f"{name} {label}", "space")
        self._file.by_id[element.id()] = made
        self._file.floors[made] = floor
        self._holes += [(made, hole) for hole in columns]
        self._plan.spaces.append(Space(made, slug(label.rstrip("0123456789 ")) or "room", label,
                                      self.storey_of(element, low), outline, low, round(high - low, 4)))
        for holds, why in ((drawn is not None, f"drawn as lines only; taken to be {DEFAULT_HEIGHT_M} m high"),
                          (not is_level, "its shape has no level floor; its shadow on the plan"),
                          (not is_all, "its floor is in several parts; the largest"),
                          (bool(rings), "it goes round what is no part of it; a thin wall across it, as rooms here have"
                                        " one border")):
            if holds:
                self._plan.report.guessed.append(f"space {made}: {why}")

    def _add_columns(self) -> None:
        """Small holes in floors become columns, unless a space lies in them."""
        for number, (name, hole) in enumerate(self._holes):
            own = self._plan.space(name)
            others = [s.name for s in self._plan.on(own.storey) if s.name != name]
            if any(self._file.floors[other].representative_point().within(hole) for other in others):
                continue
            self._plan.furnishings.append(build_column(f"column-{number + 1}", own, hole))

    def _split_stacked_storeys(self) -> None:
        """Give spaces above others of their storey a storey of their own: some files have one storey for all."""
        for storey in list(self._plan.storeys):
            lower: list[Space] = []
            upper: list[Space] = []
            for space in sorted(self._plan.on(storey.name), key=lambda s: s.floor_m):
                floor = self._file.floors[space.name]
                over = [s for s in lower if space.floor_m - s.floor_m > s.height_m - STEP_M
                        and self._file.floors[s.name].intersection(floor).area > 0.5 * floor.area]
                (upper if over else lower).append(space)
            if not upper:
                continue
            raised = Storey(self._file.names.new(f"{storey.name} upper", "storey"), round(upper[0].floor_m, 3))
            self._plan.storeys.insert(self._plan.storeys.index(storey) + 1, raised)
            moved = {space.name for space in upper}
            self._plan.spaces = [replace(s, storey=raised.name) if s.name in moved else s for s in self._plan.spaces]
            self._plan.report.guessed.append(f"{', '.join(space.name for space in upper)}: over other spaces of "
                                             f"{storey.name}; in a storey of their own, {raised.name}")


MIN_PASSAGE_WIDTH_M, MIN_PASSAGE_HEIGHT_M, MAX_SILL_M = 0.6, 1.8, 0.3
"""What an opening without a door must have to be a passage."""
MAX_BESIDE_M = 1.2
"""A space further from a door is not beside it."""
BARRIERS = ("IfcWall", "IfcCurtainWall", "IfcPlate", "IfcRailing")
"""Kinds of elements that may stand between spaces that touch."""
MAX_RAILING_M = 1.5
"""A railing that is higher goes up with stairs."""


class Passages:
    """Reads doors, openings and windows between known spaces."""

    def __init__(self, file: IfcFile, spaces: Spaces) -> None:
        self._file, self._plan, self._spaces = file, file.plan, spaces
        self._virtual: set[str] = set()
        self._bounds: dict[int, list[str]] = {}
        self._stated = 0

    def read(self) -> None:
        """Read everything into the file's plan."""
        self._read_boundaries()
        self._file.each("IfcDoor", self._read_door)
        self._file.each("IfcOpeningElement", self._read_passage)
        for storey in self._plan.storeys:
            self._find_meetings(storey.name)
        self._file.each("IfcWindow", self._read_window)
        if self._stated:
            self._plan.report.guessed.append(f"{self._stated} doors and windows have no shape: their stated width and "
                                             "height, from where they are placed")

    def _read_boundaries(self) -> None:
        """Read which spaces a door bounds, and which spaces have a virtual boundary."""
        for relation in self._file.all("IfcRelSpaceBoundary"):
            try:
                space, element = relation.RelatingSpace, relation.RelatedBuildingElement
                name = self._file.by_id.get(space.id()) if space is not None else None
                if name is None:
                    continue
                if element is None or element.is_a("IfcVirtualElement"):
                    self._virtual |= {name} if relation.PhysicalOrVirtualBoundary == "VIRTUAL" or element else set()
                    continue
                for bounded in (element, *filling(element)):
                    known = self._bounds.setdefault(bounded.id(), [])
                    known += [] if name in known else [name]
            except READ_ERRORS:
                self._plan.report.left_out.append(f"IfcRelSpaceBoundary #{relation.id()}: cannot be read")
        if not self._file.all("IfcRelSpaceBoundary"):
            self._plan.report.guessed.append(
                "no space boundaries in the file: doors joined to the spaces next to them")

    def _find_meetings(self, storey: str) -> None:
        """Find spaces that meet without a wall: nothing stands between them, and boundaries do not say otherwise.

        A virtual boundary may be one of several of its space: walls may stand beside it.
        """
        spaces = self._plan.on(storey)
        names = self._virtual or {space.name for space in spaces}
        pairs = neighbours_without_wall(spaces, names)
        if not pairs:
            return
        footprints = []
        for element in self._file.all(*BARRIERS):
            self._file.report_progress(element)
            body = self._file.body_of(element)
            if body is not None and self._stands_on(element, body, spaces):
                footprints.append(body.footprint)
        self._plan.barriers[storey] = [footprint for footprint in footprints if not footprint.is_empty]
        self._plan.without_wall |= neighbours_without_wall(spaces, names, self._plan.barriers[storey])

    @staticmethod
    def _stands_on(element: Any, body: ElementShape, spaces: list[Space]) -> bool:
        """Whether an element stops a robot on the floor of these spaces; a railing of stairs does not."""
        low, high = float(body.world[:, 2].min()), float(body.world[:, 2].max())
        if element.is_a("IfcRailing") and high - low > MAX_RAILING_M:
            return False
        return any(low < space.floor_m + 1.0 and high > space.floor_m + 0.3 for space in spaces)

    def _find_hole(self, element: Any, opening: Any, stated_m: float | None) -> WallHole:
        own = self._file.body_of(element) if element is not None else None
        made = self._file.body_of(opening) if opening is not None else None
        if own is None and made is None and element is not None:
            own = self._file.stated_box(element)
            self._stated += own is not None
        wall = host(opening)
        return find_hole(own, made, lambda: self._file.body_of(wall) if wall is not None else None, stated_m)

    def _find_filled_hole(self, element: Any) -> WallHole:
        fills, width = getattr(element, "FillsVoids", ()), getattr(element, "OverallWidth", None)
        return self._find_hole(element, fills[0].RelatingOpeningElement if fills else None,
                               float(width) * self._file.unit_m if width else None)

    def _read_door(self, element: Any) -> None:
        hole = self._find_filled_hole(element)
        rooms = tuple(self._bounds.get(element.id(), ()))
        if len(rooms) > 2:
            self._plan.report.guessed.append(f"door {name_of(element)}: bounds {', '.join(rooms)}; the two nearest")
        self._plan.openings.append(self._build_opening(f"door {element.id()}", element, hole, rooms, True))

    def _read_passage(self, element: Any) -> None:
        """An opening in a wall without door or window, if a robot can pass through it."""
        wall = host(element)
        kind = f"{getattr(element, 'PredefinedType', None)} {getattr(element, 'ObjectType', None)}".upper()
        if element.HasFillings or wall is None or not wall.is_a("IfcWall") or "RECESS" in kind:
            return
        hole = self._find_hole(None, element, None)
        rooms = tuple(self._bounds.get(element.id(), ()))
        opening = self._build_opening(f"passage {element.id()}", wall, hole, rooms, False)
        floors = [space.floor_m for space in self._plan.on(opening.storey)
                  if self._file.distance_m(space.name, hole.centre) < MAX_BESIDE_M]
        sill = hole.sill_m - min(floors, default=hole.sill_m, key=lambda floor: abs(floor - hole.sill_m))
        if sill <= MAX_SILL_M and hole.height_m + sill >= MIN_PASSAGE_HEIGHT_M and hole.width_m >= MIN_PASSAGE_WIDTH_M:
            self._plan.openings.append(opening)

    def _build_opening(
        self, title: str, element: Any, hole: WallHole, rooms: tuple[str, ...], has_leaf: bool
    ) -> WallOpening:
        storey = self._plan.space(rooms[0]).storey if rooms else self._find_storey(element, hole)
        return WallOpening(
            self._file.names.new(title, "door"), storey, hole.centre, round(hole.width_m, 4), hole.height_m,
            rooms if len(rooms) <= 2 else (), hole.along, has_leaf)

    def _find_storey(self, element: Any, hole: WallHole) -> str:
        """The storey of a door: the file's, unless only another storey has a space beside the door."""
        stated = self._spaces.storey_of(element, hole.sill_m)
        beside = {s.name: s.storey for s in self._plan.spaces
                  if abs(s.floor_m - hole.sill_m) < 0.5 and self._file.distance_m(s.name, hole.centre) < MAX_BESIDE_M}
        if stated in beside.values() or not beside:
            return stated
        return beside[min(beside, key=lambda name: self._file.distance_m(name, hole.centre))]

    def _read_window(self, element: Any) -> None:
        hole = self._find_filled_hole(element)
        rooms = self._bounds.get(element.id(), ())
        storey = self._plan.space(rooms[0]).storey if rooms else self._spaces.storey_of(element, hole.sill_m)
        self._plan.windows.append(Window(f"window-{element.id()}", storey, hole.centre, hole.along, hole.width_m,
                                        hole.sill_m, hole.height_m))


FURNITURE = ("IfcFurnishingElement", "IfcColumn", "IfcSanitaryTerminal")


class Contents:
    """Reads stairs, elevators and furniture among known spaces.

    Attributes:
        flights: number of stairs that join spaces; stairs: number of all stairs.
        lifts: pairs of spaces that an elevator joins.
        pieces: number of pieces of furniture.
    """

    def __init__(self, file: IfcFile) -> None:
        self._file, self._plan = file, file.plan
        self.flights = self.stairs = self.pieces = 0
        self.lifts: set[frozenset[str]] = set()

    def read(self) -> None:
        """Read everything into the file's plan."""
        self._file.each("IfcStair", self._read_stairs)
        self._file.each("IfcStairFlight", self._read_stairs)
        self._file.each("IfcTransportElement", self._read_elevator)
        for kind in FURNITURE:
            self._file.each(kind, self._read_furnishing)

    def _read_stairs(self, element: Any) -> None:
        if element.is_a("IfcStairFlight") and any(above.is_a("IfcStair") for above in containers(element)):
            return
        self.stairs += 1
        parts = [p for r in getattr(element, "IsDecomposedBy", ()) for p in r.RelatedObjects
                 if p.is_a("IfcStairFlight") or p.is_a("IfcSlab")]
        bodies = [body for part in (element, *parts) if (body := self._file.body_of(part)) is not None]
        if not bodies:
            raise ValueError("it has no shape")
        points = np.concatenate([body.world for body in bodies])
        ways = find_climbed_spaces(points, self._plan.spaces)
        if not ways:
            raise ValueError("it does not lead from a space to one of another storey")
        name = self._file.names.new(f"stairs {element.id()}", "stairs")
        for number, (below, above) in enumerate(ways):
            self._plan.links.append(RoomLink(name if not number else self._file.names.new(name, "stairs"), "stairs",
                                      (below.name, above.name)))
        self._plan.furnishings.append(build_stairs(name, ways[0][0].name, points))
        self.flights += 1

    def _read_elevator(self, element: Any) -> None:
        """An elevator joins the spaces above each other at its place, storey by storey."""
        kind = getattr(element, "PredefinedType", None) or getattr(element, "OperationType", None) or "ELEVATOR"
        if kind != "ELEVATOR":
            raise ValueError(f"it is no lift ({kind})")
        world = self._file.body(element).world
        middle = (world.min(axis=0) + world.max(axis=0))[:2] / 2
        upwards = sorted(self._plan.spaces, key=lambda space: space.floor_m)
        shaft = [space for space in upwards if self._file.distance_m(space.name, middle) == 0.0]
        if len({space.storey for space in shaft}) < 2:
            raise ValueError("there are no spaces of two storeys where it is")
        for below, above in pairwise(shaft):
            if below.storey != above.storey and frozenset((below.name, above.name)) not in self.lifts:
                self.lifts.add(frozenset((below.name, above.name)))
                self._plan.links.append(RoomLink(self._file.names.new(f"lift {element.id()}", "lift"), "elevator",
                                          (below.name, above.name)))

    def _read_furnishing(self, element: Any) -> None:
        name = name_of(element) or element.is_a().removeprefix("Ifc")
        room, body = self._find_container(element), None
        if room is None:
            body = self._file.body(element)
            room = self._find_room_below(body)
        if room is None:
            raise ValueError("it stands in no space")
        kind = slug(name.split(":")[0]) or "furniture"
        self._plan.furnishings.append(build_box(f"{kind}-{element.id()}", kind, room, body or self._file.body(element)))
        self.pieces += 1

    def _find_container(self, element: Any) -> str | None:
        for relation in getattr(element, "ContainedInStructure", ()):
            if (name := self._file.by_id.get(relation.RelatingStructure.id())) is not None:
                return name
        return None

    def _find_room_below(self, body: ElementShape) -> str | None:
        """The space with the middle of a thing above its floor; the smallest, where spaces lie in each other."""
        low, high = body.world.min(axis=0), body.world.max(axis=0)
        middle = (low + high) / 2
        over = [s for s in self._plan.spaces if s.floor_m - 0.5 < middle[2] < s.floor_m + s.height_m
                and self._file.distance_m(s.name, middle[:2]) == 0.0]
        return min(over, key=lambda s: self._file.floors[s.name].area).name if over else None
