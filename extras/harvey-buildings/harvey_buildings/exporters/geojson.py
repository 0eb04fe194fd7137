"""A world as GeoJSON (RFC 7946): rooms, doorways, things and links as features, in metres of the world's frame.

RFC 7946 has longitude and latitude; section 4 lets others be used where both sides know. The member ``frame`` says so.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import shapely

from world_models.building.geometry.scene import Floats
from world_models.building.world import World

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
