"""What joins the spaces of an IFC file: doors, openings, places without a wall; and the windows."""

from __future__ import annotations

from typing import Any

from world_models.files.importers.ifc.opened_file import READ_ERRORS, IfcFile
from world_models.files.importers.ifc.relations import filling, host, name_of
from world_models.files.importers.ifc.shapes import Body, Hole, hole_of
from world_models.files.importers.ifc.spaces import Spaces
from world_models.files.importers.layout import neighbours_without_wall
from world_models.files.importers.plan import Gap, Space, Window

PASSAGE_M, PASSAGE_HIGH_M, SILL_M = 0.6, 1.8, 0.3
"""An opening without a door is a way through if it is so wide and high, and its sill is no higher."""
BESIDE_M = 1.2
BARRIERS = ("IfcWall", "IfcCurtainWall", "IfcPlate", "IfcRailing")
"""What may stand between spaces that touch."""
CLIMBING_M = 1.5
"""A railing that is higher goes up with stairs."""


class Passages:
    """Reads doors, openings and windows between the spaces that are known."""

    def __init__(self, file: IfcFile, spaces: Spaces) -> None:
        self._file, self._plan, self._spaces = file, file.plan, spaces
        self._virtual: set[str] = set()
        self._bounds: dict[int, list[str]] = {}

    def read(self) -> None:
        """Into the file's plan."""
        self._boundaries()
        self._file.each("IfcDoor", self._door)
        self._file.each("IfcOpeningElement", self._passage)
        for storey in self._plan.storeys:
            self._meetings(storey.name)
        self._file.each("IfcWindow", self._window)

    def _boundaries(self) -> None:
        """Which spaces a door bounds, and which meet another without a wall."""
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
                self._plan.account.left_out.append(f"IfcRelSpaceBoundary #{relation.id()}: cannot be read")
        if not self._file.all("IfcRelSpaceBoundary"):
            self._plan.account.guessed.append(
                "no space boundaries in the file: doors joined to the spaces next to them")

    def _meetings(self, storey: str) -> None:
        """Which spaces meet without a wall: where nothing stands between them, and the boundaries do not say otherwise.

        A boundary that is told to be virtual may be one of several of its space: walls may stand beside it.
        """
        spaces = self._plan.on(storey)
        names = self._virtual or {space.name for space in spaces}
        pairs = neighbours_without_wall(spaces, names)
        if not pairs:
            return
        shadows = []
        for element in self._file.all(*BARRIERS):
            self._file.next(element)
            body = self._file.body_of(element)
            if body is not None and self._stands_on(element, body, spaces):
                shadows.append(body.shadow)
        self._plan.barriers[storey] = [shadow for shadow in shadows if not shadow.is_empty]
        self._plan.without_wall |= neighbours_without_wall(spaces, names, self._plan.barriers[storey])

    @staticmethod
    def _stands_on(element: Any, body: Body, spaces: list[Space]) -> bool:
        """Whether something would stop one who walks on the floor of these spaces; a railing of stairs leads up."""
        low, high = float(body.world[:, 2].min()), float(body.world[:, 2].max())
        if element.is_a("IfcRailing") and high - low > CLIMBING_M:
            return False
        return any(low < space.floor_m + 1.0 and high > space.floor_m + 0.3 for space in spaces)

    def _hole(self, element: Any, opening: Any, told_m: float | None) -> Hole:
        own = self._file.body_of(element) if element is not None else None
        made = self._file.body_of(opening) if opening is not None else None
        wall = host(opening)
        return hole_of(own, made, lambda: self._file.body_of(wall) if wall is not None else None, told_m)

    def _filled(self, element: Any) -> Hole:
        fills, told = getattr(element, "FillsVoids", ()), getattr(element, "OverallWidth", None)
        return self._hole(element, fills[0].RelatingOpeningElement if fills else None,
                          float(told) * self._file.unit_m if told else None)

    def _door(self, element: Any) -> None:
        hole = self._filled(element)
        rooms = tuple(self._bounds.get(element.id(), ()))
        if len(rooms) > 2:
            self._plan.account.guessed.append(f"door {name_of(element)}: bounds {', '.join(rooms)}; the two nearest")
        self._plan.gaps.append(self._gap(f"door {element.id()}", element, hole, rooms, True))

    def _passage(self, element: Any) -> None:
        """An opening in a wall that no door or window fills, if one can walk through it."""
        wall = host(element)
        kind = f"{getattr(element, 'PredefinedType', None)} {getattr(element, 'ObjectType', None)}".upper()
        if element.HasFillings or wall is None or not wall.is_a("IfcWall") or "RECESS" in kind:
            return
        hole = self._hole(None, element, None)
        gap = self._gap(f"passage {element.id()}", wall, hole, tuple(self._bounds.get(element.id(), ())), False)
        floors = [s.floor_m for s in self._plan.on(gap.storey) if self._file.away(s.name, hole.centre) < BESIDE_M]
        sill = hole.sill_m - min(floors, default=hole.sill_m, key=lambda floor: abs(floor - hole.sill_m))
        if sill <= SILL_M and hole.height_m + sill >= PASSAGE_HIGH_M and hole.width_m >= PASSAGE_M:
            self._plan.gaps.append(gap)

    def _gap(self, title: str, element: Any, hole: Hole, rooms: tuple[str, ...], has_leaf: bool) -> Gap:
        storey = self._plan.space(rooms[0]).storey if rooms else self._storey_at(element, hole)
        return Gap(self._file.names.new(title, "door"), storey, hole.centre, round(hole.width_m, 4), hole.height_m,
                   rooms if len(rooms) <= 2 else (), hole.along, has_leaf)

    def _storey_at(self, element: Any, hole: Hole) -> str:
        """The storey a door is in; another than the file says where only that one has a space beside it."""
        told = self._spaces.storey_of(element, hole.sill_m)
        beside = {s.name: s.storey for s in self._plan.spaces
                  if abs(s.floor_m - hole.sill_m) < 0.5 and self._file.away(s.name, hole.centre) < BESIDE_M}
        if told in beside.values() or not beside:
            return told
        return beside[min(beside, key=lambda name: self._file.away(name, hole.centre))]

    def _window(self, element: Any) -> None:
        hole = self._filled(element)
        rooms = self._bounds.get(element.id(), ())
        storey = self._plan.space(rooms[0]).storey if rooms else self._spaces.storey_of(element, hole.sill_m)
        self._plan.windows.append(Window(f"window-{element.id()}", storey, hole.centre, hole.along, hole.width_m,
                                        hole.sill_m, hole.height_m))
