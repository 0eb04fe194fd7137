"""What an IndoorGML file says: its XML, read with care, its cells, and its layers of states and transitions.

XML may come from anywhere: it is read without entities, external files or depth. Elements are known by their names,
whatever the namespace and version. A cell has the outline of its floor, its height, and boundaries that a way passes.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import networkx as nx
import numpy as np
import shapely

from harvey_buildings.fitting.building_plan import BuildingError, slug
from harvey_buildings.fitting.polygons import Floats, clean_outline, extract_outline, repair
from world_models.files.regular_files import read_regular

MAX_BYTES = 200_000_000
MAX_DEPTH = 200
MOST_OF_A_NAME = 1000
"""Letters of a cell's name that are read."""


def read_xml(path: Path) -> ET.Element:
    """The root element. Raises BuildingError for no XML, a document type declaration, or too large or deep a file."""
    try:
        data = read_regular(path, MAX_BYTES)
    except OSError as error:
        raise BuildingError(f"{path}: expected a readable file, got: {error.strerror}") from None
    return _Builder(path.name).build(data)


class _Builder:
    """Builds elements from expat's events; names are ``{namespace}name``."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._builder = ET.TreeBuilder()
        self._depth = 0

    def build(self, data: bytes) -> ET.Element:
        parser = expat.ParserCreate(namespace_separator="}")
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._builder.data
        parser.StartDoctypeDeclHandler = self._refuse
        try:
            parser.Parse(data, True)
            return self._builder.close()
        except BuildingError:
            raise
        except (expat.ExpatError, ValueError, LookupError, AssertionError) as error:
            raise BuildingError(f"{self._name}: expected XML, got: {error}") from None

    def _refuse(self, *_: object) -> None:
        raise BuildingError(f"{self._name}: expected XML without a document type declaration, got one; entities are "
                            "not expanded")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise BuildingError(f"{self._name}: expected at most {MAX_DEPTH} elements within one another, got more")
        self._builder.start(_qualified(tag), {_qualified(key): value for key, value in attributes.items()})

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._builder.end(_qualified(tag))


def _qualified(name: str) -> str:
    return "{" + name if "}" in name else name


HREF = "{http://www.w3.org/1999/xlink}href"
MAX_COORDINATE = 1e8
"""Projected coordinates have seven digits before the point."""


def elements(root: ET.Element, *names: str) -> list[ET.Element]:
    """All elements with one of these names below one, in the order of the file."""
    wanted = set(names)
    return [e for e in root.iter() if isinstance(e.tag, str) and local_name(e) in wanted]


def local_name(element: ET.Element) -> str:
    """The name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def identifier(element: ET.Element) -> str:
    """The id of an element; "" for none."""
    return next((text for key, text in element.attrib.items() if key.rpartition("}")[2] == "id"), "")


def references(element: ET.Element, name: str) -> list[str]:
    """Ids that the elements with this name refer to; a reversed boundary counts as that boundary."""
    found = [link_of(e) for e in elements(element, name)]
    return [text for text in found if text]


def link_of(element: ET.Element) -> str:
    """The id that an element refers to; "" for none."""
    return element.get(HREF, "").removeprefix("#").removesuffix("-REVERSE")


def texts(element: ET.Element, *names: str) -> list[str]:
    """Texts of an element's children with these names."""
    found = [(child.text or "").strip() for name in names for child in element
             if isinstance(child.tag, str) and local_name(child) == name]
    return [text for text in found if text]


def positions(element: ET.Element, origin: Floats) -> Floats:
    """(n, 3) the points of an element less ``origin`` (3,); z is 0 where it lacks; empty where they are no numbers."""
    rows: list[list[float]] = []
    try:
        for child in elements(element, "pos", "posList"):
            flat = [float(word) for word in (child.text or "").encode("ascii").split()]  # no digits of other scripts
            size = _dimension(child, len(flat))
            rows += [[*flat[i : i + size], 0.0, 0.0, 0.0][:3] for i in range(0, len(flat) - size + 1, size)]
    except ValueError:
        return np.zeros((0, 3))
    points = np.array(rows, float).reshape(-1, 3)
    good = np.isfinite(points).all() and np.abs(points).max(initial=0.0) < MAX_COORDINATE
    return points - origin if good else np.zeros((0, 3))


def _dimension(element: ET.Element, count: int) -> int:
    if local_name(element) == "pos":
        return max(count, 1)
    return 2 if element.get("srsDimension") == "2" else 3


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
    floor = shapely.union_all([repair(part) for part in parts])
    return _describe(element, floor, lowest, float(tall.max()))


def _describe(element: ET.Element, floor: shapely.Geometry, low: float, high: float) -> Cell | None:
    if floor.area <= 0.0:
        return None
    names, description = texts(element, "name"), " ".join(texts(element, "description"))
    said = dict(re.findall(r'(\w+)\s*=\s*"?([\w.-]+)', description))
    key, kind = identifier(element), local_name(element)
    label = (names[0] if names else key)[:MOST_OF_A_NAME]
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


STATES, TRANSITIONS = ("State", "Node"), ("Transition", "Edge")
"""Their names in IndoorGML 1 and 2."""
LAYERS = ("SpaceLayer", "spaceLayer", "DualSpaceLayer")


@dataclass(frozen=True, eq=False)
class Layer:
    """One space layer.

    Attributes:
        graph: a node for each state with ``at`` (3,), in the file's units, and ``text``; edges carry ``text`` and
            ``name``, the id.
        cell_of: the cell that a state is dual to, where it is to one.
    """

    name: str
    graph: nx.Graph
    cell_of: dict[str, str] = field(default_factory=dict)


def read_layers(root: ET.Element, origin: Floats) -> list[Layer]:
    """All layers, in the order of the file; places are less ``origin`` (3,)."""
    found = [layer for layer in elements(root, *LAYERS) if len(elements(layer, *LAYERS)) == 1]
    if not found and elements(root, *STATES):
        found = [root]
    return [_read_layer(element, origin) for element in found]


def _read_layer(element: ET.Element, origin: Floats) -> Layer:
    """A transition joins states; some writers name the cells instead."""
    graph: nx.Graph = nx.Graph()
    cells: dict[str, str] = {}
    for state in elements(element, *STATES):
        name, points = identifier(state), positions(state, origin)
        if name and len(points):
            graph.add_node(name, at=points[0], text=" ".join(texts(state, "name", "description")))
            cells.update((name, cell) for cell in references(state, "duality")[:1])
    state_of = {cell: state for state, cell in cells.items()}
    for transition in elements(element, *TRANSITIONS):
        ends = [end if end in graph else state_of.get(end, end) for end in references(transition, "connects")]
        if len(ends) == 2 and ends[0] != ends[1] and all(end in graph for end in ends):
            name, text = identifier(transition), " ".join(texts(transition, "name", "description"))
            graph.add_edge(*ends, text=text, name=name.removesuffix("-REVERSE"))
    return Layer(identifier(element) or "layer", graph, cells)
