"""The navigation graph of an IndoorGML file: places on the floors of a building and the ways between them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import combinations, pairwise

import networkx as nx
import numpy as np

from world_models.files.importers.outlines import Floats

GML = "{http://www.opengis.net/gml/3.2}"
HREF = "{http://www.w3.org/1999/xlink}href"


@dataclass(frozen=True, eq=False)
class Layer:
    """One space layer: ``graph`` has a node for each state, with ``at`` (3,) as the file has it and ``told`` of it."""

    name: str
    graph: nx.Graph
    cell_of: dict[str, str] = field(default_factory=dict)


def layers_of(root: ET.Element) -> list[Layer]:
    """All layers, in the order of the file; ``cell_of`` says which cell a state is dual to."""
    return [_layer(element) for element in elements(root, "SpaceLayer")]


def _layer(element: ET.Element) -> Layer:
    graph: nx.Graph = nx.Graph()
    cells: dict[str, str] = {}
    for state in elements(element, "State"):
        name, points = state.get(f"{GML}id", ""), positions(state)
        if name and len(points):
            graph.add_node(name, at=points[0], told=" ".join(texts(state, "name", "description")))
            cells.update((name, cell) for cell in references(state, "duality")[:1])
    for transition in elements(element, "Transition"):
        ends = references(transition, "connects")
        if len(ends) == 2 and ends[0] != ends[1] and all(end in graph for end in ends):
            graph.add_edge(*ends, told=" ".join(texts(transition, "name", "description")))
    return Layer(element.get(f"{GML}id", "") or "layer", graph, cells)


def elements(root: ET.Element, name: str) -> list[ET.Element]:
    """All elements of this name below one, whatever their namespace."""
    return [e for e in root.iter() if isinstance(e.tag, str) and e.tag.rpartition("}")[2] == name]


def references(element: ET.Element, name: str) -> list[str]:
    """Ids that the elements of this name refer to; a reversed boundary is that boundary."""
    found = [e.get(HREF, "").removeprefix("#").removesuffix("-REVERSE") for e in elements(element, name)]
    return [text for text in found if text]


def texts(element: ET.Element, *names: str) -> list[str]:
    """What GML says directly of an element under these names."""
    return [text.strip() for name in names if (text := element.findtext(f"{GML}{name}"))]


def positions(element: ET.Element) -> Floats:
    """(n, 3) the points of an element, flat ones on floor 0; empty where they are not numbers."""
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
class Network:
    """Ways through a building on one layer, in metres: edges carry ``length_m`` and ``kind`` (floor, stairs, elevator).

    Attributes:
        layer: its name.
        graph: nodes carry ``floor`` and ``room``, the room that the place is in or next to (None: too far from any).
        rooms: for each room the node that stands for it; absent where none does.
    """

    layer: str
    graph: nx.Graph
    rooms: dict[str, str]

    def way(self, origin: str, destination: str) -> list[str] | None:
        """The nodes of the shortest way from room to room; None where there is none or a room has no node."""
        if origin not in self.rooms or destination not in self.rooms:
            return None
        try:
            way: list[str] = nx.shortest_path(self.graph, self.rooms[origin], self.rooms[destination], "length_m")
        except nx.NetworkXNoPath:
            return None
        return way

    def told(self, way: Iterable[str]) -> str:
        """A way in words: rooms in order, how floors are changed, and how long it is."""
        names: list[str] = []
        nodes = list(way)
        for node in nodes:
            data = self.graph.nodes[node]
            here = f"{data['room'] or node} ({data['floor']})"
            if not names or names[-1] != here:
                names.append(here)
        length = float(np.sum([self.graph.edges[a, b]["length_m"] for a, b in pairwise(nodes)]))
        return f"{' - '.join(names)}: {length:.0f} m"

    def across_floors(self, floor_of: dict[str, str]) -> tuple[int, int, tuple[str, str, list[str]] | None]:
        """How many pairs of rooms on different floors have a way, of how many; and the one with the longest chain."""
        total, found, longest = 0, 0, None
        for a, b in combinations(floor_of, 2):
            if floor_of[a] == floor_of[b]:
                continue
            total += 1
            way = self.way(a, b)
            found += way is not None
            if way is not None and (longest is None or len(way) > len(longest[2])):
                longest = a, b, way
        return found, total, longest
