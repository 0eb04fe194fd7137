"""The cells of an IndoorGML file: the outline of each floor, its height, and the boundaries that a way passes."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np
import shapely

from harvey_buildings.building_plan import slug
from harvey_buildings.indoor_gml.gml import (
    elements,
    identifier,
    link_of,
    local_name,
    positions,
    references,
    texts,
)
from harvey_buildings.polygons import Floats, clean_outline, extract_outline

CELLS = frozenset({"CellSpace", "NavigableSpace", "GeneralSpace", "TransferSpace", "TransitionSpace", "ConnectionSpace",
                   "AnchorSpace", "NonNavigableSpace"})
"""Classes of cells in core and navigation, 1.0 to 2.0; a ConnectionSpace or AnchorSpace is a door."""
BOUNDARIES = frozenset({"CellSpaceBoundary", "NavigableBoundary", "TransferBoundary", "ConnectionBoundary",
                        "AnchorBoundary"})
POLYGONS = ("Polygon", "PolygonPatch")
MAX_LOCAL_COORDINATE = 4000.0
"""Beyond it coordinates are projected ones, and the origin is moved to the building [units of the file]."""
MAX_SLOPE = math.cos(math.radians(10.0))
MAX_FLOOR_STEP = 0.3
"""A face that is level within 10 degrees, and no more than this above the lowest, is floor [units of the file]."""


@dataclass(frozen=True, eq=False)
class Cell:
    """One cell.

    Attributes:
        kind: what the file says that it is: the class of its element, or the word of ``indoor="..."``.
        storey: the storey that the file names; "" for none.
        floor: its floor on the plan. low, high: its z. All in the units of the file, less the file's origin.
    """

    id: str
    label: str
    kind: str
    storey: str
    is_door: bool
    is_solid: bool
    floor: shapely.Geometry
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Boundary:
    """A boundary that a way passes: (2, 2) its ends on the plan, z from ``low`` to ``high``, in the file's units."""

    way: str
    ends: Floats
    low: float
    high: float


def read_cells(root: ET.Element, origin: Floats) -> list[Cell]:
    """The cells that have a floor, in the order of the file; ``origin`` (3,) is subtracted."""
    named = {name: element for element in elements(root, *POLYGONS) if (name := identifier(element))}
    found = [_read_cell(element, named, origin) for element in elements(root, *CELLS)]
    return [cell for cell in found if cell is not None]


def find_origin(root: ET.Element) -> Floats:
    """(3,) near the building's middle where its coordinates are projected ones (thousands of kilometres), else 0."""
    points = [p[0] for ring in elements(root, "LinearRing") if len(p := positions(ring, np.zeros(3)))]
    middle = np.median(points, axis=0) if points else np.zeros(3)
    return np.array([*np.round(middle[:2]), 0.0]) if np.abs(middle[:2]).max() > MAX_LOCAL_COORDINATE else np.zeros(3)


def _read_cell(element: ET.Element, named: dict[str, ET.Element], origin: Floats) -> Cell | None:
    """None for one that has no level face with an area."""
    polygons = elements(element, *POLYGONS)
    polygons += [named[link] for member in elements(element, "surfaceMember", "baseSurface")
                 if (link := link_of(member)) in named]
    in_polygons = {ring for polygon in polygons for ring in elements(polygon, "LinearRing")}
    polygons += [ring for ring in elements(element, "LinearRing") if ring not in in_polygons]
    faces = [rings for polygon in polygons if (rings := _read_rings(polygon, origin))]
    if not faces:
        return None
    tall = np.concatenate([rings[0] for rings in faces])[:, 2]
    levels = [(float(rings[0][:, 2].mean()), rings) for rings in faces if _is_level(rings[0])]
    if not levels:
        return None
    lowest = min(height for height, _ in levels)
    parts = [shapely.Polygon(rings[0][:, :2], [ring[:, :2] for ring in rings[1:]])
             for height, rings in levels if height < lowest + MAX_FLOOR_STEP]
    floor = shapely.union_all([shapely.make_valid(part) for part in parts])
    return _describe(element, floor, lowest, float(tall.max()))


def _describe(element: ET.Element, floor: shapely.Geometry, low: float, high: float) -> Cell | None:
    if floor.area <= 0.0:
        return None
    names, description = texts(element, "name"), " ".join(texts(element, "description"))
    said = dict(re.findall(r'(\w+)\s*=\s*"?([\w.-]+)', description))
    key, kind = identifier(element), local_name(element)
    label = names[0] if names else key
    is_door = (slug(key).startswith("door") or slug(label).startswith("door") or said.get("indoor") == "door"
               or kind in ("ConnectionSpace", "AnchorSpace", "Door"))
    is_solid = kind == "NonNavigableSpace" or said.get("indoor") == "wall" or slug(label).startswith("wall")
    return Cell(key, label, said.get("indoor", kind), said.get("storey", ""), is_door, is_solid, floor, low, high)


def _read_rings(polygon: ET.Element, origin: Floats) -> list[Floats]:
    """The rings (k, 3) of a polygon, the outer one first; empty where that is none."""
    rings = [positions(ring, origin) for ring in elements(polygon, "LinearRing")]
    return [ring for ring in rings if len(ring) > 2] if rings and len(rings[0]) > 2 else []


def _is_level(ring: Floats) -> bool:
    """By Newell's normal, which holds for rings that are not quite flat."""
    ahead = np.roll(ring, -1, axis=0)
    normal = np.sum(np.cross(ring - ring[0], ahead - ring[0]), axis=0)
    size = float(np.linalg.norm(normal))
    return size > 1e-9 and abs(float(normal[2])) >= MAX_SLOPE * size


def find_outline(floor: shapely.Geometry, scale: float, turn_rad: float) -> Floats | None:
    """(k, 2) the outline of a floor in metres, turned by ``turn_rad`` clockwise; None where it has no area."""
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    placed = shapely.transform(floor, lambda points: scale * points @ np.array([[c, -s], [s, c]]))
    if placed.geom_type == "Polygon" and not placed.interiors:
        return clean_outline(shapely.get_coordinates(placed)[:-1])
    return extract_outline(placed)


def read_boundaries(root: ET.Element, origin: Floats) -> list[Boundary]:
    """The upright boundaries that are dual to a transition; others are walls."""
    found = []
    for element in elements(root, *BOUNDARIES):
        ways = references(element, "duality")
        points = [p for ring in elements(element, "LinearRing", "LineString") if len(p := positions(ring, origin)) > 1]
        if not ways or not points:
            continue
        corners = np.concatenate(points)
        middle = corners[:, :2].mean(axis=0)
        first = corners[int(np.argmax(np.linalg.norm(corners[:, :2] - middle, axis=1))), :2]
        second = corners[int(np.argmax(np.linalg.norm(corners[:, :2] - first, axis=1))), :2]
        found.append(Boundary(ways[0], np.array([first, second]), float(corners[:, 2].min()),
                              float(corners[:, 2].max())))
    return found
