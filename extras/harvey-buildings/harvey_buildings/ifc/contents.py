"""Furniture in the spaces of an IFC file, and the stairs and elevators that lead to other storeys."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from harvey_buildings.building_plan import RoomLink, slug
from harvey_buildings.ifc.boxes import build_box, build_stairs, find_climbed_spaces
from harvey_buildings.ifc.opened_file import IfcFile
from harvey_buildings.ifc.relations import containers, name_of
from harvey_buildings.ifc.shapes import Body

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

    def _find_room_below(self, body: Body) -> str | None:
        """The space with the middle of a thing above its floor; the smallest, where spaces lie in each other."""
        low, high = body.world.min(axis=0), body.world.max(axis=0)
        middle = (low + high) / 2
        over = [s for s in self._plan.spaces if s.floor_m - 0.5 < middle[2] < s.floor_m + s.height_m
                and self._file.distance_m(s.name, middle[:2]) == 0.0]
        return min(over, key=lambda s: self._file.floors[s.name].area).name if over else None
