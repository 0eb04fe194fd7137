"""Storeys and spaces of an IFC file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from harvey_buildings.building_plan import BuildingError, Space, Storey, slug
from harvey_buildings.ifc.boxes import build_column
from harvey_buildings.ifc.opened_file import MAX_LISTED, READ_ERRORS, IfcFile
from harvey_buildings.ifc.relations import containers, name_of
from harvey_buildings.ifc.shapes import Body, find_floor, find_plan_origin, find_ring
from harvey_buildings.polygons import extract_outline

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
            elevation, placed = getattr(storey, "Elevation", None), self._file.height(storey)
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
        bodies: dict[int, Body] = {}

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

    def _read_space(self, element: Any, raw: Body | None) -> None:
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
