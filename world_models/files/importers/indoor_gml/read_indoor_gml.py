"""IndoorGML building files (OGC 14-005): cells, doors and the graphs that join them."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

import networkx as nx
import numpy as np
import shapely

from world_models.files.importers.indoor_gml.network import (
    GML,
    Layer,
    Network,
    elements,
    layers_of,
    positions,
    texts,
)
from world_models.files.importers.indoor_gml.xml_reader import read_xml
from world_models.files.importers.outlines import Floats, cleaned, facing, side_of, squared
from world_models.files.importers.plan import BuildingError, Gap, Names, Plan, Space, Storey, Way, slug

STOREY_M = 3.5
CEILING_M = 2.8
DOOR_M = (1.2, 2.1)
"""Width and height of a way through a wall of which the file does not tell how large it is."""
NEAR_M = 8.0
"""A node that is further from every room belongs to none."""
MOST_CELLS = 5000
MOST_WAYS = 8
"""From a place between rooms."""

Place = tuple[str, Floats]
"""A room and where in it (3,), as the file has it."""


def read_indoor_gml(path: Path) -> tuple[Plan, Network | None]:
    """What is in an IndoorGML file, and its network. Raises BuildingError where it cannot be read."""
    root = read_xml(path)
    cells = [cell for element in elements(root, "CellSpace") if (cell := _cell(element)) is not None]
    if not cells or len(cells) > MOST_CELLS:
        raise BuildingError(f"{path.name}: expected an IndoorGML file with 1 to {MOST_CELLS} cells that have a floor, "
                            f"got {len(cells)}")
    return _Reader(path, root, cells).read()


@dataclass(frozen=True, eq=False)
class _Cell:
    """A cell of the file: its floor's outline (k, 2), at z as the file has it, and what it says of itself."""

    id: str
    label: str
    storey: str
    is_door: bool
    outline: Floats
    low: float
    high: float


def _cell(element: ET.Element) -> _Cell | None:
    """None for one that has no level face with an area."""
    faces = [p for ring in elements(element, "LinearRing") if len(p := positions(ring)) > 3]
    level = [p for p in faces if np.ptp(p[:, 2]) < 1e-3]
    if not level:
        return None
    floor = min(level, key=lambda p: float(p[0, 2]))
    outline = cleaned(floor[:, :2])
    if outline is None:
        return None
    names, told = texts(element, "name"), " ".join(texts(element, "description"))
    storey = re.search(r'storey\s*=\s*"?([\w.-]+)', told)
    label = names[0] if names else element.get(f"{GML}id", "")
    key = element.get(f"{GML}id", "")
    tall = np.concatenate(faces)[:, 2]
    kind = element.tag.rpartition("}")[2]
    is_door = slug(key).startswith("door") or slug(label).startswith("door") or kind in ("ConnectionSpace", "Door")
    return _Cell(key, label, storey.group(1) if storey else "", is_door, outline, float(floor[0, 2]), float(tall.max()))


@dataclass
class _Reader:
    path: Path
    root: ET.Element
    cells: list[_Cell]
    plan: Plan = field(init=False)
    rooms: dict[str, str] = field(default_factory=dict)
    floors: dict[float, str] = field(default_factory=dict)
    shapes: dict[str, shapely.Geometry] = field(default_factory=dict)
    is_index: bool = False

    def read(self) -> tuple[Plan, Network | None]:
        title = slug(self.path.stem) or "building"
        self.plan, names = Plan(title, self.path.name), Names(title)
        self._storeys(names)
        self._spaces(names)
        layers = layers_of(self.root)
        self._doors([layer for layer in layers if layer.cell_of])
        network = self._network(layers)
        self._crossings(layers)
        self._told(layers, network)
        return self.plan, network

    # -- floors and rooms --------------------------------------------------------------------------------------------

    def _storeys(self, names: Names) -> None:
        levels = sorted({round(cell.low, 3) for cell in self.cells})
        whole = all(float(level).is_integer() for level in levels)
        self.is_index = whole and all(cell.high - cell.low <= 1.01 for cell in self.cells)
        for level in levels:
            told = [c.storey for c in self.cells if round(c.low, 3) == level and c.storey]
            name = names.new(max(sorted(set(told)), key=told.count) if told else f"floor {level:g}", "floor")
            self.floors[level] = name
            self.plan.storeys.append(Storey(name, level * STOREY_M if self.is_index else level))
        if self.is_index:
            self.plan.account.guessed.append(f"z counts floors; each is taken to be {STOREY_M} m high, a ceiling "
                                             f"{CEILING_M} m; x and y are taken to be metres")

    def _spaces(self, names: Names) -> None:
        moved = 0.0
        for cell in self.cells:
            if cell.is_door:
                continue
            outline = squared(cell.outline)
            before, after = shapely.Polygon(cell.outline), shapely.Polygon(outline)
            moved = max(moved, float(shapely.hausdorff_distance(after, before)))
            title = cell.id if slug(cell.id) == slug(cell.label) or not cell.label.isascii() else (
                f"{cell.id} {cell.label}")
            name = names.new(title, "room")
            self.rooms[cell.id] = name
            level = round(cell.low, 3)
            low = level * STOREY_M if self.is_index else level
            high = CEILING_M if self.is_index or cell.high - cell.low < 1.5 else cell.high - cell.low
            kind = re.sub(r"\d+", "", slug(cell.id)) or "room"
            self.plan.spaces.append(Space(name, kind, cell.label, self.floors[level], outline, low, round(high, 3)))
            self.shapes[name] = shapely.Polygon(outline)
        self.plan.account.guessed.append("walls within 8 degrees of the axes are made straight: corners moved by up "
                                         f"to {moved:.2f} m")

    def _floor_of(self, z: float) -> str:
        return self.floors[min(self.floors, key=lambda level: (abs(level - z), level))]

    def _room_at(self, at: Floats, near_m: float) -> str | None:
        """The room that a place (3,) is in, or else the nearest one on its floor."""
        point, floor = shapely.Point(at[:2]), self._floor_of(float(at[2]))
        on_floor = [space.name for space in self.plan.spaces if space.storey == floor]
        away = {name: float(self.shapes[name].distance(point)) for name in on_floor}
        best = min(away, key=lambda name: (away[name], self.shapes[name].area), default=None)
        return best if best is not None and away[best] <= near_m else None

    # -- doors -------------------------------------------------------------------------------------------------------

    def _doors(self, layers: list[Layer]) -> None:
        """Cells that are doors, between the rooms that the graph joins them to; and rooms joined directly."""
        joined: nx.Graph = nx.Graph()
        for layer in layers:
            for a, b in layer.graph.edges:
                if a in layer.cell_of and b in layer.cell_of:
                    joined.add_edge(layer.cell_of[a], layer.cell_of[b])
        for cell in (cell for cell in self.cells if cell.is_door):
            low, high = cell.outline.min(axis=0), cell.outline.max(axis=0)
            rooms = [self.rooms[c] for c in joined.adj.get(cell.id, ()) if c in self.rooms]
            self._gap(cell.id, self.floors[round(cell.low, 3)], (low + high) / 2, float((high - low).max()),
                      tuple(rooms) if len(rooms) == 2 else ())
        for a, b in joined.edges:
            if a in self.rooms and b in self.rooms:
                one, other = self.rooms[a], self.rooms[b]
                if self.plan.space(one).storey == self.plan.space(other).storey:
                    self.plan.without_wall.add(frozenset((one, other)))

    def _gap(self, name: str, storey: str, centre: Floats, width: float, rooms: tuple[str, ...]) -> None:
        self.plan.gaps.append(Gap(slug(name) or "door", storey, centre, width, DOOR_M[1], rooms))

    def _crossings(self, layers: list[Layer]) -> None:
        """Ways of the graphs between rooms that no door joins: through a wall on a floor, or from floor to floor."""
        joined = {frozenset(gap.rooms) for gap in self.plan.gaps} | set(self.plan.without_wall)
        for layer in layers:
            for a, b, told in self._room_ways(layer):
                if frozenset((a[0], b[0])) not in joined and a[0] != b[0]:
                    joined.add(frozenset((a[0], b[0])))
                    self._cross(a, b, told)

    def _room_ways(self, layer: Layer) -> Iterator[tuple[Place, Place, str]]:
        """The ways of a layer between places in rooms, straight through those that are in none."""
        graph = layer.graph.copy()
        rooms = {n: self.rooms.get(layer.cell_of.get(n, "")) or self._room_at(data["at"], 1.5)
                 for n, data in graph.nodes(data=True)}
        for node in [n for n in graph if rooms[n] is None]:
            graph.add_edges_from(combinations(list(graph.adj[node])[:MOST_WAYS], 2))
            graph.remove_node(node)
        for a, b in graph.edges:
            told = f"{graph.nodes[a]['told']} {graph.nodes[b]['told']}"
            yield (str(rooms[a]), graph.nodes[a]["at"]), (str(rooms[b]), graph.nodes[b]["at"]), told

    def _cross(self, start: Place, end: Place, told: str) -> None:
        one, other = self.plan.space(start[0]), self.plan.space(end[0])
        kind, account = self._kind(told, one.name, other.name), self.plan.account
        if one.storey != other.storey:
            self.plan.ways.append(Way(f"{kind}-{one.name}-{other.name}", kind, (one.name, other.name)))
            return
        place = _through(np.array([start[1][:2], end[1][:2]]), one, other)
        if place is not None:
            self._gap(f"{one.name}-to-{other.name}", one.storey, place, DOOR_M[0], (one.name, other.name))
            account.guessed.append(f"a door of {DOOR_M[0]} m where the graph passes from {one.name} to {other.name}")
        elif "stair" in f"{one.name} {other.name}":
            self.plan.ways.append(Way(f"way-{one.name}-{other.name}", "stairs", (one.name, other.name)))
            account.guessed.append(
                f"{one.name} and {other.name} share no wall, the graph joins them: part of the stairs")
        else:
            account.left_out.append(f"a way of the graph from {one.name} to {other.name}, which share no wall")

    def _kind(self, told: str, *rooms: str) -> str:
        words = f"{told} {' '.join(f'{room} {self.plan.space(room).label}' for room in rooms)}".lower()
        return "elevator" if re.search(r"elev|lift", words) and "stair" not in told.lower() else "stairs"

    # -- the network -------------------------------------------------------------------------------------------------

    def _network(self, layers: list[Layer]) -> Network | None:
        """The layer that joins most of its places, with lengths in metres."""
        if not any(layer.graph.number_of_edges() for layer in layers):
            return None
        best = max(layers, key=lambda layer: max(map(len, nx.connected_components(layer.graph)), default=0))
        graph: nx.Graph = nx.Graph()
        for node, data in best.graph.nodes(data=True):
            room = self.rooms.get(best.cell_of.get(node, "")) or self._room_at(data["at"], 1.5)
            graph.add_node(node, floor=self._floor_of(float(data["at"][2])), room=room)
        tall = STOREY_M if self.is_index else 1.0
        for a, b in best.graph.edges:
            start, end = (best.graph.nodes[n]["at"] * (1.0, 1.0, tall) for n in (a, b))
            level = graph.nodes[a]["floor"] == graph.nodes[b]["floor"]
            told = " ".join(best.graph.nodes[n]["told"] + " " + str(graph.nodes[n]["room"]) for n in (a, b))
            kind = "floor" if level else "elevator" if re.search("elev|lift", told.lower()) else "stairs"
            graph.add_edge(a, b, length_m=float(np.linalg.norm(end - start)), kind=kind)
        return Network(best.name, graph, self._nodes_of_rooms(best, graph))

    def _nodes_of_rooms(self, layer: Layer, graph: nx.Graph) -> dict[str, str]:
        """For each room the node in it that is nearest to its middle, or else the nearest one on its floor."""
        places = {node: shapely.Point(data["at"][:2]) for node, data in layer.graph.nodes(data=True)}
        chosen = {}
        for space in self.plan.spaces:
            shape = self.shapes[space.name]
            own = [n for n in places if graph.nodes[n]["room"] == space.name]
            near = own or [n for n in places if graph.nodes[n]["floor"] == space.storey
                           and places[n].distance(shape) < NEAR_M]
            if near:
                chosen[space.name] = min(near, key=lambda n: (
                    places[n].distance(shape), places[n].distance(shape.representative_point())))
        return chosen

    def _told(self, layers: list[Layer], network: Network | None) -> None:
        plan, account = self.plan, self.plan.account
        doors = len([cell for cell in self.cells if cell.is_door])
        account.used.append(f"IndoorGML: {len(plan.storeys)} floors, {len(self.cells)} of "
                            f"{len(elements(self.root, 'CellSpace'))} cells, {doors} of them doors, layers "
                            f"{', '.join(layer.name for layer in layers)}")
        account.guessed.append("all doors between rooms stand open; colours are ours")
        landmarks = [layer.name for layer in layers if network is None or layer.name != network.layer]
        account.left_out.append(f"the places of the layers {', '.join(landmarks) or 'none'}, textures, weights")
        if network is not None:
            floor_of = {space.name: space.storey for space in plan.spaces}
            found, total, longest = network.across_floors(floor_of)
            account.used.append(f"layer {network.layer} to plan on: {network.graph.number_of_nodes()} places, "
                                f"{network.graph.number_of_edges()} ways; {found} of {total} pairs of rooms on "
                                "different floors have one")
            if longest is not None:
                account.used.append(f"  as {longest[0]} to {longest[1]}: {network.told(longest[2])}")
            lost = [name for name in floor_of if name not in network.rooms]
            if lost:
                account.left_out.append(f"on layer {network.layer}: no place near {', '.join(lost)}")


def _through(line: Floats, one: Space, other: Space) -> Floats | None:
    """(2,) where a way (2, 2) from room to room passes a wall that they share: as near to it as there is wall."""
    best: tuple[float, Floats] | None = None
    for stretch in facing(one.name, one.outline, other.name, other.outline, least_m=-0.2):
        start, along, _ = side_of(one.outline, stretch.side)
        half = DOOR_M[0] / 2 + 0.05
        if stretch.high_m - stretch.low_m < 2 * half:
            continue
        at = min(max(float((line.mean(axis=0) - start) @ along), stretch.low_m + half), stretch.high_m - half)
        place = start + at * along
        away = float(shapely.LineString(line).distance(shapely.Point(place)))
        if best is None or away < best[0]:
            best = away, place
    return best[1] if best else None
