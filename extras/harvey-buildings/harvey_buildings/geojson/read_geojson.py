"""Rooms, doorways, things and links from the features of a GeoJSON file.

IMDF: https://register.apple.com/resources/imdf/ ; a unit is a room, an opening a doorway drawn as a line.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from harvey_buildings.building_plan import (
    BuildingError,
    BuildingPlan,
    Furnishing,
    Names,
    RoomLink,
    Space,
    Storey,
    WallOpening,
    slug,
)
from harvey_buildings.geojson.features import Feature, read_features
from harvey_buildings.polygons import extract_outline

WALL_HEIGHT_M, DOOR_HEIGHT_M, STOREY_M = 2.5, 2.05, 3.0
THING_M = 1.0
"""Heights of walls, doorways, storeys and things where the file does not say."""
MIN_HEIGHT_M, MAX_HEIGHT_M = 1.0, 50.0
MAX_FLOOR_M, MAX_STOREYS = 1000.0, 200.0
"""What is beyond these counts as not said."""
SOLID = ("opentobelow", "structure", "wall", "column")
"""Categories of units that are no rooms."""
LEVEL_STEP_M = 0.5
"""Rooms whose floors differ by no more are on one storey."""


def read_geojson(path: Path) -> BuildingPlan:
    """The plan of a GeoJSON file. Raises BuildingError where it cannot be read or has no room."""
    features, frame = read_features(path)
    plan = BuildingPlan(slug(path.stem) or "building", path.name)
    reader = _Reader(plan, features)
    reader.add_rooms()
    if not plan.spaces:
        raise BuildingError(f"{path.name}: expected features that are rooms (property feature: room, or feature_type: "
                            f"unit) with polygons, got none among {len(features)} features")
    reader.add_doorways()
    reader.add_things()
    reader.add_links()
    plan.report.used.insert(0, f"{len(plan.spaces)} rooms, {len(plan.openings)} doorways, {len(plan.furnishings)} "
                               f"things, {len(plan.links)} links of {len(features)} features; x and y are {frame}")
    return plan


class _Reader:
    """Adds the features to a plan, one kind after another."""

    def __init__(self, plan: BuildingPlan, features: list[Feature]) -> None:
        self._plan, self._features = plan, features
        self._names = Names(plan.name)
        self._rooms: dict[str, str] = {}
        self._floors = self._find_floors()

    def _of(self, *kinds: str) -> list[Feature]:
        return [feature for feature in self._features if feature.kind in kinds]

    def _find_floors(self) -> dict[str, float]:
        """Heights [m] of IMDF's levels by their ids."""
        levels = {level.id: STOREY_M * level.number("ordinal", 0.0, -MAX_STOREYS, MAX_STOREYS)
                  for level in self._of("level")}
        if levels:
            self._plan.report.guessed.append(f"storeys are {STOREY_M:g} m apart: levels have an ordinal only")
        return levels

    def _floor_of(self, feature: Feature) -> float:
        level_m = self._floors.get(str(feature.properties.get("level_id")), 0.0)
        return feature.number("floor_m", level_m, -MAX_FLOOR_M, MAX_FLOOR_M)

    def _storey_at(self, floor_m: float) -> str:
        """The storey with the floor nearest to this height."""
        return min(self._plan.storeys, key=lambda storey: abs(storey.elevation_m - floor_m)).name

    def add_rooms(self) -> None:
        """Rooms and units with polygons, on storeys by the heights of their floors."""
        plan = self._plan
        rooms = [(f, o) for f in self._of("room", "unit") if (o := self._outline(f)) is not None]
        for floor_m in sorted({self._floor_of(feature) for feature, _ in rooms}):
            if not plan.storeys or floor_m - plan.storeys[-1].elevation_m > LEVEL_STEP_M:
                plan.storeys.append(Storey(self._names.new(f"storey-{len(plan.storeys) + 1}", "storey"), floor_m))
        if any("height_m" not in feature.properties for feature, _ in rooms):
            plan.report.guessed.append(f"rooms are {WALL_HEIGHT_M:g} m high where the file does not say")
        for feature, outline in rooms:
            name = self._names.new(feature.label, "room")
            kind = feature.properties.get("kind") or feature.properties.get("category")
            floor_m = self._floor_of(feature)
            self._rooms[feature.label] = name
            plan.spaces.append(Space(name, (slug(kind) if isinstance(kind, str) else "") or "room", feature.label,
                                     self._storey_at(floor_m), outline, floor_m,
                                     feature.number("height_m", WALL_HEIGHT_M, MIN_HEIGHT_M, MAX_HEIGHT_M)))

    def _outline(self, feature: Feature) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None:
        category = feature.properties.get("category")
        if feature.kind == "unit" and category in SOLID:
            self._plan.report.left_out.append(f"{feature.label}: a unit of the category {category} is no room")
            return None
        shape = feature.geometry
        outline = None if shape is None else extract_outline(shape if shape.is_valid else shapely.make_valid(shape))
        if outline is None:
            self._plan.report.left_out.append(f"{feature.label or 'a room'}: expected a polygon, got none")
        return outline

    def add_doorways(self) -> None:
        """Doorways of our own files, polygons, and openings, lines."""
        for feature in self._of("doorway", "opening"):
            shape = feature.geometry
            if shape is None or shape.is_empty:
                self._plan.report.left_out.append(f"{feature.label or 'a doorway'}: it has no place")
                continue
            ends = shapely.get_coordinates(shape)
            is_line = shape.geom_type.endswith("LineString")
            along = ends[-1] - ends[0] if is_line and np.linalg.norm(ends[-1] - ends[0]) > 0.0 else None
            rooms = tuple(self._rooms[room] for room in feature.names("between") if room in self._rooms)
            width_m = float(np.linalg.norm(along)) if along is not None else (
                feature.number("width_m", 0.0, 0.0, MAX_HEIGHT_M))
            if width_m <= 0.0:
                self._plan.report.left_out.append(f"{feature.label or 'a doorway'}: it has no width")
                continue
            centre = ends.mean(axis=0) if is_line else shapely.get_coordinates(shape.centroid)[0]
            self._plan.openings.append(WallOpening(
                self._names.new(feature.label, "door"), self._storey_at(self._floor_of(feature)), centre, width_m,
                feature.number("height_m", DOOR_HEIGHT_M, MIN_HEIGHT_M, MAX_HEIGHT_M),
                rooms if len(rooms) == 2 else (), along))
        if any("height_m" not in feature.properties for feature in self._of("doorway", "opening")):
            self._plan.report.guessed.append(f"doorways are {DOOR_HEIGHT_M:g} m high where the file does not say")

    def add_things(self) -> None:
        """Things that a robot could hit, as boxes; what hangs flat on walls is left out."""
        flat = 0
        for feature in self._of("thing"):
            room = self._rooms.get(str(feature.properties.get("in")))
            if feature.properties.get("obstacle") is not True or room is None or feature.geometry is None:
                flat += 1
                continue
            corners = shapely.get_coordinates(feature.geometry.minimum_rotated_rectangle)[:4]
            if len(corners) < 4:
                flat += 1
                continue
            one, other = corners[1] - corners[0], corners[3] - corners[0]
            half, deep = float(np.linalg.norm(one)) / 2, float(np.linalg.norm(other)) / 2
            floor_m = self._plan.space(room).floor_m
            low_m = floor_m + feature.number("low_m", 0.0, 0.0, MAX_HEIGHT_M)
            high_m = floor_m + feature.number("high_m", THING_M, 0.0, MAX_HEIGHT_M)
            self._plan.furnishings.append(Furnishing(
                self._names.new(feature.label, "thing"), slug(str(feature.properties.get("kind") or "")) or "thing",
                room, corners.mean(axis=0), float(np.arctan2(one[1], one[0])),
                ((-half, half, -deep, deep, low_m, high_m),)))
        if flat:
            self._plan.report.left_out.append(f"{flat} things that hang flat on walls, or are in no room")

    def add_links(self) -> None:
        """Elevators and stairs; their stops are chosen anew."""
        for feature in self._of("link"):
            rooms = [self._rooms[room] for room in feature.names("between") if room in self._rooms]
            if len(rooms) == 2:
                kind = "elevator" if feature.properties.get("kind") == "elevator" else "stairs"
                self._plan.links.append(RoomLink(self._names.new(feature.label, "link"), kind, (rooms[0], rooms[1])))
