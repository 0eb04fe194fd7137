"""Doors, openings and places without a wall between the spaces of an IFC file; and its windows."""

from __future__ import annotations

from typing import Any

from harvey_buildings.building_plan import Space, WallOpening, Window
from harvey_buildings.ifc.opened_file import READ_ERRORS, IfcFile
from harvey_buildings.ifc.relations import filling, host, name_of
from harvey_buildings.ifc.shapes import Body, WallHole, find_hole
from harvey_buildings.ifc.spaces import Spaces
from harvey_buildings.layout import neighbours_without_wall

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

    def read(self) -> None:
        """Read everything into the file's plan."""
        self._read_boundaries()
        self._file.each("IfcDoor", self._read_door)
        self._file.each("IfcOpeningElement", self._read_passage)
        for storey in self._plan.storeys:
            self._find_meetings(storey.name)
        self._file.each("IfcWindow", self._read_window)

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
    def _stands_on(element: Any, body: Body, spaces: list[Space]) -> bool:
        """Whether an element stops a robot on the floor of these spaces; a railing of stairs does not."""
        low, high = float(body.world[:, 2].min()), float(body.world[:, 2].max())
        if element.is_a("IfcRailing") and high - low > MAX_RAILING_M:
            return False
        return any(low < space.floor_m + 1.0 and high > space.floor_m + 0.3 for space in spaces)

    def _find_hole(self, element: Any, opening: Any, stated_m: float | None) -> WallHole:
        own = self._file.body_of(element) if element is not None else None
        made = self._file.body_of(opening) if opening is not None else None
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
