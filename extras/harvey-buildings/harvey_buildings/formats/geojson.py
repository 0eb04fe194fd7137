"""GeoJSON (RFC 7946) as a building plan, and a world as GeoJSON.

RFC 7946 has longitude and latitude; section 4 lets others be used where both sides know. The member ``frame`` of what
is written says that it is in metres of the world's frame: rooms, doorways, things and links as features. IMDF's units,
openings, levels and relationships are read too (https://register.apple.com/resources/imdf/): a unit is a room, an
opening a doorway drawn as a line; units of lifts and stairs over one another, or in one relationship, are links.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from harvey_buildings.fitting.building_plan import (
    TRACED_M,
    BuildingError,
    BuildingPlan,
    Floats,
    Furnishing,
    Names,
    RoomLink,
    Space,
    Storey,
    WallOpening,
    slug,
)
from harvey_buildings.fitting.polygons import MAX_COORDINATE_M, MOST_CROSSINGS, extract_outline, repair
from world_models.building.checks import Watched, pass_on
from world_models.building.world import World
from world_models.files.construction.specs import DOOR_SIZES_M, ROOM_HEIGHTS_M
from world_models.files.regular_files import read_regular

MAX_BYTES = 100_000_000
EARTH_RADIUS_M = 6_371_008.8
"""Mean radius (IUGG)."""
MERCATOR_RADIUS_M = 6_378_137.0
DEGREES, MERCATOR = (4326, 4258, 4269, 4979), (3857, 3785, 900913, 102100, 102113)
UTM = (range(32601, 32661), range(32701, 32761), range(25828, 25839), range(26901, 26924))
"""EPSG's codes of coordinates that are read: longitude and latitude, the Mercator projection of maps in browsers, and
the zones of UTM (WGS 84 north and south, ETRS89, NAD83)."""
BESIDE = ("unit", "opening", "level", "relationship")
"""The files of an IMDF archive that are read together."""


@dataclass(frozen=True, eq=False, slots=True)
class Feature:
    """One feature.

    Attributes:
        id: of the feature, or empty.
        kind: room, doorway, thing, link (``feature`` of our own files), or unit, opening, level (IMDF's).
        geometry: on the plan [m]; None where the file has none.
        properties: as in the file.
    """

    id: str
    kind: str
    geometry: shapely.Geometry | None
    properties: Mapping[str, Any]

    def number(self, key: str, otherwise: float, low: float, high: float) -> float:
        """A property that is a number from ``low`` to ``high``, or else ``otherwise``."""
        value = self.properties.get(key)
        return float(value) if isinstance(value, int | float) and low <= value <= high else otherwise

    def names(self, key: str) -> tuple[str, ...]:
        """A property that is a list of names."""
        value = self.properties.get(key)
        return tuple(item for item in value if isinstance(item, str)) if isinstance(value, list) else ()

    @property
    def label(self) -> str:
        """Its name: a text, or IMDF's by language; its id where it has none."""
        name = self.properties.get("name")
        if isinstance(name, dict):
            name = name.get("en") or next(iter(name.values()), None)
        return name if isinstance(name, str) and name else self.id


def read_features(path: Path) -> tuple[list[Feature], str]:
    """The features of a file, and of those of an IMDF archive beside it; where x, y came from. Raises BuildingError."""
    paths = [path]
    if path.stem in BESIDE:
        paths = [other for stem in BESIDE if (other := path.with_name(f"{stem}{path.suffix}")).is_file()]
    texts = [_read(each) for each in paths]
    said = sorted({how for each, text in zip(paths, texts, strict=True) if (how := _find_frame(each, text))})
    if len(said) > 1:
        raise BuildingError(f"{path.name}: expected files that agree in their coordinates, got {' and '.join(said)}")
    frame = said[0] if said else "longitude and latitude"
    features = [_read_feature(each, number, item) for each, text in zip(paths, texts, strict=True)
                for number, item in enumerate(text["features"], 1)]
    if frame != "metres":
        features = _project(path, features, frame)
    _expect_within(path, features, MAX_COORDINATE_M)
    return features, ("metres, as the file says" if frame == "metres" else
                      f"metres east and north of the south-west corner, from {frame}")


def _find_frame(path: Path, text: Mapping[str, Any]) -> str:
    """What a collection says of its coordinates: metres, longitude and latitude, EPSG:3857 or UTM; empty: nothing.

    Raises BuildingError for others: those of national grids may be in feet, or turned.
    """
    if text.get("units") == "metres":
        return "metres"
    crs = text.get("crs")
    told = crs.get("properties") if isinstance(crs, dict) else None
    name = str(told.get("name") or told.get("code") or "") if isinstance(told, dict) else ""
    code = int(found[1]) if (found := re.search(r"(?<!\d)(\d{4,6})$", name, re.ASCII)) else 0
    if code in DEGREES or name.endswith("CRS84"):
        return "longitude and latitude"
    if code in MERCATOR:
        return "EPSG:3857"
    if any(code in zones for zones in UTM):
        return "UTM"
    if crs is not None:
        raise BuildingError(f"{path.name}: expected coordinates (crs) in longitude and latitude, EPSG:3857 or a zone "
                            f"of UTM, got {name[:60] or str(crs)[:60]!r}")
    return ""


def _read(path: Path) -> dict[str, Any]:
    try:
        text = json.loads(read_regular(path, MAX_BYTES))
    except OSError as error:
        raise BuildingError(f"{path.name}: expected a file to read, got: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise BuildingError(f"{path.name}: expected GeoJSON, got what is no JSON: {str(error)[:80]}") from None
    if not isinstance(text, dict) or text.get("type") != "FeatureCollection" or not isinstance(
            text.get("features"), list):
        raise BuildingError(f"{path.name}: expected a FeatureCollection with features, got none")
    return text


def _read_feature(path: Path, number: int, item: Any) -> Feature:
    if not isinstance(item, dict) or item.get("type") != "Feature":
        raise BuildingError(f"{path.name}: feature {number}: expected a Feature, got {str(item)[:60]!r}")
    said = item.get("properties")
    more: dict[str, Any] = said if isinstance(said, dict) else {}
    kind = more.get("feature") or item.get("feature_type") or ""
    geometry = None
    if item.get("geometry") is not None:
        try:
            geometry = shapely.from_geojson(json.dumps(item["geometry"]))
        except (shapely.GEOSException, ValueError) as error:
            raise BuildingError(f"{path.name}: feature {number}: expected a geometry, got {str(error)[:80]}") from None
        if not np.isfinite(shapely.get_coordinates(geometry)).all():
            raise BuildingError(f"{path.name}: feature {number}: expected finite coordinates, got others")
    return Feature(str(item.get("id", "")), kind if isinstance(kind, str) else "", geometry, more)


def _expect_within(path: Path, features: list[Feature], limit_m: float) -> None:
    for feature in features:
        if feature.geometry is not None and (np.abs(shapely.get_coordinates(feature.geometry)) > limit_m).any():
            raise BuildingError(f"{path.name}: {feature.label or 'a feature'}: expected coordinates up to "
                                f"{limit_m:g} m, got larger ones")


def _project(path: Path, features: list[Feature], frame: str) -> list[Feature]:
    """Coordinates of a frame to metres: an equirectangular projection, good to millimetres on a building; UTM's are."""
    at = [shapely.get_coordinates(f.geometry) for f in features if f.geometry is not None]
    points = np.concatenate([np.zeros((0, 2)), *at])
    if not len(points):
        return features
    raw = _to_degrees(points) if frame == "EPSG:3857" else points
    if frame != "UTM" and (np.abs(raw).max(axis=0) > [180.0, 90.0]).any():
        raise BuildingError(f'{path.name}: expected longitude and latitude in degrees, "units": "metres" in the '
                            "collection, or its crs (EPSG:3857 or a zone of UTM), got coordinates up to "
                            f"{np.abs(points).max():g}")
    low, middle = raw.min(axis=0), float(raw[:, 1].min() + raw[:, 1].max()) / 2
    scale = np.ones(2) if frame == "UTM" else (
        math.radians(EARTH_RADIUS_M) * np.array([math.cos(math.radians(middle)), 1.0]))

    def to_metres(xy: Floats) -> Floats:
        return np.asarray(((_to_degrees(xy) if frame == "EPSG:3857" else xy) - low) * scale)

    return [Feature(f.id, f.kind, None if f.geometry is None else shapely.transform(f.geometry, to_metres),
                    f.properties) for f in features]


def _to_degrees(xy: Floats) -> Floats:
    """Longitude and latitude of Mercator's x and y (n, 2), whose metres grow with the latitude."""
    x, y = xy.T / MERCATOR_RADIUS_M
    north = 2.0 * np.arctan(np.exp(np.clip(y, -20.0, 20.0))) - math.pi / 2.0
    return np.asarray(np.degrees(np.column_stack([x, north])))


WALL_HEIGHT_M, DOOR_HEIGHT_M, STOREY_M = 2.5, 2.05, 3.0
THING_M = 1.0
"""Heights of walls, doorways, storeys and things where the file does not say."""
MIN_HEIGHT_M, MAX_HEIGHT_M = 1.0, ROOM_HEIGHTS_M[1]
MAX_FLOOR_M, MAX_STOREYS = 1000.0, 200.0
"""What is beyond these counts as not said; rooms and doors may be as high as in a world file."""
SOLID = ("opentobelow", "structure", "wall", "column")
"""Categories of units that are no rooms."""
LEVEL_STEP_M = 0.5
"""Rooms whose floors differ by no more are on one storey."""
LIFTS, CLIMBS = ("elevator",), ("stairs", "steps", "escalator", "ramp", "movingwalkway")
"""Categories of IMDF's units, and of its relationships, that lead to other levels."""
SAME_PLACE = 0.3
"""Units of two levels are over one another from this share of the smaller one on."""


def read_geojson(path: Path, *, watched: Watched = pass_on) -> BuildingPlan:
    """The plan of a GeoJSON file. Raises BuildingError where it cannot be read or has no room."""
    features, frame = read_features(path)
    plan = BuildingPlan(slug(path.stem) or "building", path.name, sigma_m=TRACED_M)
    reader = _Reader(plan, features)
    reader.add_rooms(watched)
    if not plan.spaces:
        raise BuildingError(f"{path.name}: expected features that are rooms (property feature: room, or feature_type: "
                            f"unit) with polygons, got none among {len(features)} features"
                            f"{''.join(f' ({line})' for line in plan.report.left_out[:1])}")
    reader.add_doorways()
    reader.add_things()
    reader.add_links()
    reader.join_levels()
    plan.report.used.insert(0, f"{len(plan.spaces)} rooms, {len(plan.openings)} doorways, {len(plan.furnishings)} "
                               f"things, {len(plan.links)} links of {len(features)} features; x and y are {frame}")
    return plan


class _Reader:
    """Adds the features to a plan, one kind after another."""

    def __init__(self, plan: BuildingPlan, features: list[Feature]) -> None:
        self._plan, self._features = plan, features
        self._names = Names(plan.name)
        self._rooms: dict[str, str] = {}
        self._units: list[tuple[Feature, Space]] = []
        self._levels = {level.id: level for level in self._of("level")}
        self._floors = self._find_floors()

    def _of(self, *kinds: str) -> list[Feature]:
        return [feature for feature in self._features if feature.kind in kinds]

    def _find_floors(self) -> dict[str, float]:
        """Heights [m] of IMDF's levels by their ids. Raises BuildingError where units are on levels that lack."""
        levels = {level.id: STOREY_M * level.number("ordinal", 0.0, -MAX_STOREYS, MAX_STOREYS)
                  for level in self._levels.values()}
        named = {str(unit.properties["level_id"]) for unit in self._of("unit") if unit.properties.get("level_id")}
        if len(named) > 1 and (lacking := sorted(named - set(levels))):
            raise BuildingError(f"{self._plan.source}: expected each level that a unit is on (level.geojson beside "
                                f"it), got none with the id {lacking[0]!r}")
        if levels:
            self._plan.report.guessed.append(f"storeys are {STOREY_M:g} m apart: levels have an ordinal only")
        return levels

    def _floor_of(self, feature: Feature) -> float:
        level_m = self._floors.get(str(feature.properties.get("level_id")), 0.0)
        return feature.number("floor_m", level_m, -MAX_FLOOR_M, MAX_FLOOR_M)

    def _storey_title(self, floor_m: float) -> str:
        """IMDF's name of the first level at this height; a number where it has none."""
        names = (level.label for level in self._levels.values() if self._floors[level.id] == floor_m
                 and level.label != level.id)
        return slug(next(names, "")) or f"storey-{len(self._plan.storeys) + 1}"

    def _storey_at(self, floor_m: float) -> str:
        """The storey with the floor nearest to this height."""
        return min(self._plan.storeys, key=lambda storey: abs(storey.elevation_m - floor_m)).name

    def add_rooms(self, watched: Watched) -> None:
        """Rooms and units with polygons, on storeys by the heights of their floors."""
        plan = self._plan
        rooms = [(f, o) for f in watched(self._of("room", "unit"), "rooms read") if (o := self._outline(f)) is not None]
        for floor_m in sorted({self._floor_of(feature) for feature, _ in rooms}):
            if not plan.storeys or floor_m - plan.storeys[-1].elevation_m > LEVEL_STEP_M:
                plan.storeys.append(Storey(self._names.new(self._storey_title(floor_m), "storey"), floor_m))
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
            if feature.kind == "unit":
                self._units.append((feature, plan.spaces[-1]))

    def _outline(self, feature: Feature) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None:
        category = feature.properties.get("category")
        if feature.kind == "unit" and category in SOLID:
            self._plan.report.left_out.append(f"{feature.label}: a unit of the category {category} is no room")
            return None
        shape = feature.geometry
        outline = None if shape is None else extract_outline(repair(shape))
        if outline is None:
            self._plan.report.left_out.append(f"{feature.label or 'a room'}: expected a polygon whose sides cross at "
                                              f"most {MOST_CROSSINGS} times, got none")
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
                feature.number("width_m", 0.0, 0.0, MAX_COORDINATE_M))
            if width_m <= 0.0:
                self._plan.report.left_out.append(f"{feature.label or 'a doorway'}: it has no width")
                continue
            centre = ends.mean(axis=0) if is_line else shapely.get_coordinates(shape.centroid)[0]
            self._plan.openings.append(WallOpening(
                self._names.new(feature.label, "door"), self._storey_at(self._floor_of(feature)), centre, width_m,
                feature.number("height_m", DOOR_HEIGHT_M, *DOOR_SIZES_M),
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
        """Elevators and stairs; their stops are chosen again."""
        for feature in self._of("link"):
            rooms = [self._rooms[room] for room in feature.names("between") if room in self._rooms]
            if len(rooms) == 2:
                kind = "elevator" if feature.properties.get("kind") == "elevator" else "stairs"
                self._plan.links.append(RoomLink(self._names.new(feature.label, "link"), kind, (rooms[0], rooms[1])))

    def join_levels(self) -> None:
        """IMDF's lifts and stairs: units over one another, and those that a relationship names."""
        for categories, kind in ((LIFTS, "elevator"), (CLIMBS, "stairs")):
            units = [space for unit, space in self._units if unit.properties.get("category") in categories]
            for lower in units:
                over = [space for space in units if space.floor_m > lower.floor_m and _is_over(lower, space)]
                for upper in sorted(over, key=lambda space: space.floor_m)[:1]:
                    if kind == "elevator" or self._is_next(lower, upper):
                        self._join(kind, lower, upper)
        known = {unit.id: space for unit, space in self._units}
        for feature in self._of("relationship"):
            category, more = feature.properties.get("category"), feature.properties
            between = more.get("intermediary")
            ends = [more.get("origin"), *(between if isinstance(between, list) else ()), more.get("destination")]
            stops = [known[key] for end in ends if isinstance(end, dict) and (key := str(end.get("id"))) in known]
            if category in LIFTS or category in CLIMBS:
                for lower, upper in pairwise(sorted(stops, key=lambda space: space.floor_m)):
                    if lower.storey != upper.storey:
                        self._join("elevator" if category in LIFTS else "stairs", lower, upper)
        if self._units and self._plan.links:
            self._plan.report.guessed.append("lifts and stairs: between units of their category that lie over one "
                                             "another, and those of a relationship; ramps and escalators are stairs")

    def _is_next(self, lower: Space, upper: Space) -> bool:
        names = [storey.name for storey in self._plan.storeys]
        return names.index(upper.storey) - names.index(lower.storey) == 1

    def _join(self, kind: str, lower: Space, upper: Space) -> None:
        if all(set(link.between) != {lower.name, upper.name} for link in self._plan.links):
            title = f"{'lift' if kind == 'elevator' else kind}-{lower.name}-{upper.name}"
            self._plan.links.append(RoomLink(self._names.new(title, "link"), kind, (lower.name, upper.name)))


def _is_over(lower: Space, upper: Space) -> bool:
    a, b = shapely.Polygon(lower.outline), shapely.Polygon(upper.outline)
    return bool(a.intersection(b).area > SAME_PLACE * min(a.area, b.area))


FRAME = "metres in the building's frame: x to the east, y to the north; neither longitude nor latitude"
DECIMALS = 4
"""Tenths of a millimetre."""


def world_geojson(world: World) -> str:
    """The text of a FeatureCollection; the property ``feature`` is room, doorway, thing or link."""
    head = {"type": "FeatureCollection", "name": world.name, "frame": FRAME, "units": "metres"}
    lines = ",\n".join(json.dumps(feature, ensure_ascii=False, allow_nan=False) for feature in _features(world))
    return f"{json.dumps(head, ensure_ascii=False)[:-1]}, \"features\": [\n{lines}\n]}}\n"


def _features(world: World) -> Iterator[dict[str, Any]]:
    for name in world.rooms:
        locale, outline = world.locale(name), world.outline(name)
        yield _feature("room", name, _polygon(outline), {
            "kind": locale.kind, "in": locale.parent, "floor_m": _round(world.floor_m(name)),
            "height_m": _round(locale.height_m), "area_m2": _round(shapely.Polygon(outline).area),
            **{key: value for key, value in locale.properties.items() if isinstance(value, str | int | float)}})
    for door in world.doorways:
        yield _feature("doorway", door.name, _polygon(door.thresholds_world.reshape(-1, 2)), {
            "between": list(door.between), "floor_m": _round(world.floor_m(door.between[0])),
            "width_m": _round(door.width_m), "height_m": _round(door.height_m)})
    for thing in world.things:
        yield _feature("thing", thing.name, _polygon(thing.footprint_world), {
            "kind": thing.kind, "in": thing.locale, "floor_m": _round(world.floor_m(thing.locale)),
            "low_m": _round(thing.low_m), "high_m": _round(thing.high_m), "obstacle": thing.is_obstacle})
    for link in world.links:
        stops = [[_round(x) for x in stop] for stop in link.stops_world[:, :2].tolist()]
        yield _feature("link", link.name, {"type": "MultiPoint", "coordinates": stops},
                       {"kind": link.kind, "between": list(link.between)})


def _feature(what: str, name: str, geometry: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "id": f"{what}/{name}", "geometry": geometry,
            "properties": {**more, "feature": what, "name": name}}


def _polygon(corners: Floats) -> dict[str, Any]:
    """A polygon (k, 2) [m] as RFC 7946 has it: closed and counter-clockwise."""
    ring = shapely.Polygon(corners)
    ring = ring if ring.exterior.is_ccw else ring.reverse()
    return {"type": "Polygon", "coordinates": [[[_round(x), _round(y)] for x, y in ring.exterior.coords]]}


def _round(value: float) -> float:
    return round(float(value), DECIMALS)
