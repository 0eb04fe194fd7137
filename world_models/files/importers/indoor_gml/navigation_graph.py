"""The navigation graph of an IndoorGML file: places on the floors of a building, joined by edges."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import combinations, pairwise

import networkx as nx
import numpy as np

from world_models.files.importers.polygons import Floats

GML = "{http://www.opengis.net/gml/3.2}"
HREF = "{http://www.w3.org/1999/xlink}href"


@dataclass(frozen=True, eq=False)
class Layer:
    """One space layer.

    Attributes:
        graph: a node for each state with ``at`` (3,), in the file's units, and ``text``; edges carry ``text``.
        cell_of: the cell that a state is dual to, where it is to one.
    """

    name: str
    graph: nx.Graph
    cell_of: dict[str, str] = field(default_factory=dict)


def read_layers(root: ET.Element) -> list[Layer]:
    """All layers, in the order of the file."""
    return [_read_layer(element) for element in elements(root, "SpaceLayer")]


def _read_layer(element: ET.Element) -> Layer:
    graph: nx.Graph = nx.Graph()
    cells: dict[str, str] = {}
    for state in elements(element, "State"):
        name, points = state.get(f"{GML}id", ""), positions(state)
        if name and len(points):
            graph.add_node(name, at=points[0], text=" ".join(texts(state, "name", "description")))
            cells.update((name, cell) for cell in references(state, "duality")[:1])
    for transition in elements(element, "Transition"):
        ends = references(transition, "connects")
        if len(ends) == 2 and ends[0] != ends[1] and all(end in graph for end in ends):
            graph.add_edge(*ends, text=" ".join(texts(transition, "name", "description")))
    return Layer(element.get(f"{GML}id", "") or "layer", graph, cells)


def elements(root: ET.Element, name: str) -> list[ET.Element]:
    """All elements with this name below one, whatever their namespace."""
    return [e for e in root.iter() if isinstance(e.tag, str) and e.tag.rpartition("}")[2] == name]


def references(element: ET.Element, name: str) -> list[str]:
    """Ids that the elements with this name refer to; a reversed boundary counts as that boundary."""
    found = [e.get(HREF, "").removeprefix("#").removesuffix("-REVERSE") for e in elements(element, name)]
    return [text for text in found if text]


def texts(element: ET.Element, *names: str) -> list[str]:
    """Texts of an element's GML children with these names."""
    return [text.strip() for name in names if (text := element.findtext(f"{GML}{name}"))]


def positions(element: ET.Element) -> Floats:
    """(n, 3) the points of an element; z is 0 where it lacks; empty where they are not numbers."""
    rows: list[list[float]] = []
    try:
        for child in element.iter():
            kind = child.tag.rpartition("}")[2] if isinstance(child.tag, str) else ""
            if kind == "pos":
                rows.append(([float(word) for word in (child.text or "").split()] + [0.0, 0.0, 0.0])[:3])
            elif kind == "posList":
                flat = [float(word) for word in (child.text or "").split()]
                rows += [flat[i : i + 3] for i in range(0, len(flat) - 2, 3)]
    except ValueError:
        return np.zeros((0, 3))
    points = np.array(rows, float).reshape(-1, 3)
    return points if np.isfinite(points).all() and np.abs(points).max(initial=0.0) < 1e6 else np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class NavigationGraph:
    """A graph to plan on, in metres: edges carry ``length_m`` and ``kind`` (floor, stairs, elevator).

    Attributes:
        layer: name of the layer that it is made from.
        graph: nodes carry ``floor`` and ``room``, the room that the place is in or next to (None: too far from any).
        rooms: the node of each room; absent where none is near.
    """

    layer: str
    graph: nx.Graph
    rooms: dict[str, str]

    def find_route(self, origin: str, destination: str) -> list[str] | None:
        """The nodes of the shortest path from room to room; None where there is none or a room has no node."""
        if origin not in self.rooms or destination not in self.rooms:
            return None
        try:
            path: list[str] = nx.shortest_path(self.graph, self.rooms[origin], self.rooms[destination], "length_m")
        except nx.NetworkXNoPath:
            return None
        return path

    def describe(self, way: Iterable[str]) -> str:
        """A path in words: rooms with their floors, in order, and its length."""
        names: list[str] = []
        nodes = list(way)
        for node in nodes:
            data = self.graph.nodes[node]
            here = f"{data['room'] or node} ({data['floor']})"
            if not names or names[-1] != here:
                names.append(here)
        length = float(np.sum([self.graph.edges[a, b]["length_m"] for a, b in pairwise(nodes)]))
        return f"{' - '.join(names)}: {length:.0f} m"

    def count_routes_across_floors(
        self, floor_of: dict[str, str]
    ) -> tuple[int, int, tuple[str, str, list[str]] | None]:
        """Pairs of rooms on different floors: how many have a path, of how many; and the path with the most nodes."""
        total, found, longest = 0, 0, None
        for a, b in combinations(floor_of, 2):
            if floor_of[a] == floor_of[b]:
                continue
            total += 1
            way = self.find_route(a, b)
            found += way is not None
            if way is not None and (longest is None or len(way) > len(longest[2])):
                longest = a, b, way
        return found, total, longest
