"""The navigation graph of an IndoorGML file: places on the floors of a building, joined by edges."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import combinations, pairwise

import networkx as nx
import numpy as np

from harvey_buildings.indoor_gml.gml import elements, identifier, positions, references, texts
from harvey_buildings.polygons import Floats

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
