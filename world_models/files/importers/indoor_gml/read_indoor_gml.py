"""Reading IndoorGML (OGC 14-005): rooms and doors from cells, links and the navigation graph from layers."""

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

from world_models.files.importers.building_plan import (
    BuildingError,
    BuildingPlan,
    Names,
    RoomLink,
    Space,
    Storey,
    WallOpening,
    slug,
)
from world_models.files.importers.indoor_gml.navigation_graph import (
    GML,
    Layer,
    NavigationGraph,
    elements,
    positions,
    read_layers,
    texts,
)
from world_models.files.importers.indoor_gml.xml_reader import read_xml
from world_models.files.importers.polygons import Floats, clean_outline, find_facing_stretches, side_of, square_outline

STOREY_M = 3.5
CEILING_M = 2.8
DOOR_M = (1.2, 2.1)
"""Width and height of a door where the file does not give its size."""
MAX_ROOM_DISTANCE_M = 1.5
"""A node further from every room is between rooms."""
MAX_NODE_DISTANCE_M = 8.0
"""A node further from a room does not represent it."""
MAX_CELLS = 5000
MAX_NEIGHBOURS = 8
"""Neighbours of a node between rooms that are joined directly when it is removed."""

Place = tuple[str, Floats]
"""A room and a point (3,) in it, in the file's units."""


def read_indoor_gml(path: Path) -> tuple[BuildingPlan, NavigationGraph | None]:
    """The building plan of an IndoorGML file, and its navigation graph, if any. Raises BuildingError."""
    root = read_xml(path)
    cells = [cell for element in elements(root, "CellSpace") if (cell := _read_cell(element)) is not None]
    if not cells or len(cells) > MAX_CELLS:
        raise BuildingError(f"{path.name}: expected an IndoorGML file with 1 to {MAX_CELLS} cells that have a floor, "
                            f"got {len(cells)}")
    return _Reader(path, root, cells).read()


@dataclass(frozen=True, eq=False)
class _Cell:
    """A cell of the file: outline (k, 2) of its floor, z from ``low`` to ``high``, in the file's units; its texts."""

    id: str
    label: str
    storey: str
    is_door: bool
    outline: Floats
    low: float
    high: float


def _read_cell(element: ET.Element) -> _Cell | None:
    """None for one that has no level face with an area."""
    faces = [p for ring in elements(element, "LinearRing") if len(p := positions(ring)) > 3]
    level = [p for p in faces if np.ptp(p[:, 2]) < 1e-3]
    if not level:
        return None
    floor = min(level, key=lambda p: float(p[0, 2]))
    outline = clean_outline(floor[:, :2])
    if outline is None:
        return None
    names, description = texts(element, "name"), " ".join(texts(element, "description"))
    storey = re.search(r'storey\s*=\s*"?([\w.-]+)', description)
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
    plan: BuildingPlan = field(init=False)
    rooms: dict[str, str] = field(default_factory=dict)
    floors: dict[float, str] = field(default_factory=dict)
    shapes: dict[str, shapely.Geometry] = field(default_factory=dict)
    is_index: bool = False

    def read(self) -> tuple[BuildingPlan, NavigationGraph | None]:
        title = slug(self.path.stem) or "building"
        self.plan, names = BuildingPlan(title, self.path.name), Names(title)
        self._read_storeys(names)
        self._read_spaces(names)
        layers = read_layers(self.root)
        self._read_doors([layer for layer in layers if layer.cell_of])
        network = self._build_navigation_graph(layers)
        self._read_crossings(layers)
        self._write_report(layers, network)
        return self.plan, network

    # -- floors and rooms --------------------------------------------------------------------------------------------

    def _read_storeys(self, names: Names) -> None:
        levels = sorted({round(cell.low, 3) for cell in self.cells})
        whole = all(float(level).is_integer() for level in levels)
        self.is_index = whole and all(cell.high - cell.low <= 1.01 for cell in self.cells)
        for level in levels:
            given = [c.storey for c in self.cells if round(c.low, 3) == level and c.storey]
            name = names.new(max(sorted(set(given)), key=given.count) if given else f"floor {level:g}", "floor")
            self.floors[level] = name
            self.plan.storeys.append(Storey(name, level * STOREY_M if self.is_index else level))
        if self.is_index:
            self.plan.report.guessed.append(f"z counts floors; each is taken to be {STOREY_M} m high, a ceiling "
                                             f"{CEILING_M} m; x and y are taken to be metres")

    def _read_spaces(self, names: Names) -> None:
        moved = 0.0
        for cell in self.cells:
            if cell.is_door:
                continue
            outline = square_outline(cell.outline)
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
        self.plan.report.guessed.append("walls within 8 degrees of the axes are made straight: corners moved by up "
                                         f"to {moved:.2f} m")

    def _find_floor(self, z: float) -> str:
        return self.floors[min(self.floors, key=lambda level: (abs(level - z), level))]

    def _find_room(self, at: Floats, near_m: float) -> str | None:
        """The room that a place (3,) is in, or else the nearest one on its floor."""
        point, floor = shapely.Point(at[:2]), self._find_floor(float(at[2]))
        on_floor = [space.name for space in self.plan.spaces if space.storey == floor]
        away = {name: float(self.shapes[name].distance(point)) for name in on_floor}
        best = min(away, key=lambda name: (away[name], self.shapes[name].area), default=None)
        return best if best is not None and away[best] <= near_m else None

    # -- doors -------------------------------------------------------------------------------------------------------

    def _read_doors(self, layers: list[Layer]) -> None:
        """Cells that are doors, between the rooms that the graph joins them to; and rooms joined directly."""
        joined: nx.Graph = nx.Graph()
        for layer in layers:
            for a, b in layer.graph.edges:
                if a in layer.cell_of and b in layer.cell_of:
                    joined.add_edge(layer.cell_of[a], layer.cell_of[b])
        for cell in (cell for cell in self.cells if cell.is_door):
            low, high = cell.outline.min(axis=0), cell.outline.max(axis=0)
            rooms = [self.rooms[c] for c in joined.adj.get(cell.id, ()) if c in self.rooms]
            self._add_opening(cell.id, self.floors[round(cell.low, 3)], (low + high) / 2, float((high - low).max()),
                      tuple(rooms) if len(rooms) == 2 else ())
        for a, b in joined.edges:
            if a in self.rooms and b in self.rooms:
                one, other = self.rooms[a], self.rooms[b]
                if self.plan.space(one).storey == self.plan.space(other).storey:
                    self.plan.without_wall.add(frozenset((one, other)))

    def _add_opening(self, name: str, storey: str, centre: Floats, width: float, rooms: tuple[str, ...]) -> None:
        self.plan.openings.append(WallOpening(slug(name) or "door", storey, centre, width, DOOR_M[1], rooms))

    def _read_crossings(self, layers: list[Layer]) -> None:
        """Ways of the graphs between rooms that no door joins: through a wall on a floor, or from floor to floor."""
        joined = {frozenset(gap.rooms) for gap in self.plan.openings} | set(self.plan.without_wall)
        for layer in layers:
            for a, b, text in self._room_edges(layer):
                if frozenset((a[0], b[0])) not in joined and a[0] != b[0]:
                    joined.add(frozenset((a[0], b[0])))
                    self._add_crossing(a, b, text)

    def _room_edges(self, layer: Layer) -> Iterator[tuple[Place, Place, str]]:
        """The ways of a layer between places in rooms, straight through those that are in none."""
        graph = layer.graph.copy()
        rooms = {n: self.rooms.get(layer.cell_of.get(n, "")) or self._find_room(data["at"], MAX_ROOM_DISTANCE_M)
                 for n, data in graph.nodes(data=True)}
        for node in [n for n in graph if rooms[n] is None]:
            graph.add_edges_from(combinations(list(graph.adj[node])[:MAX_NEIGHBOURS], 2))
            graph.remove_node(node)
        for a, b in graph.edges:
            text = f"{graph.nodes[a]['text']} {graph.nodes[b]['text']}"
            yield (str(rooms[a]), graph.nodes[a]["at"]), (str(rooms[b]), graph.nodes[b]["at"]), text

    def _add_crossing(self, start: Place, end: Place, text: str) -> None:
        one, other = self.plan.space(start[0]), self.plan.space(end[0])
        kind, report = self._link_kind(text, one.name, other.name), self.plan.report
        if one.storey != other.storey:
            self.plan.links.append(RoomLink(f"{kind}-{one.name}-{other.name}", kind, (one.name, other.name)))
            return
        place = _find_crossing(np.array([start[1][:2], end[1][:2]]), one, other)
        if place is not None:
            self._add_opening(f"{one.name}-to-{other.name}", one.storey, place, DOOR_M[0], (one.name, other.name))
            report.guessed.append(f"a door of {DOOR_M[0]} m where the graph passes from {one.name} to {other.name}")
        elif "stair" in f"{one.name} {other.name}":
            self.plan.links.append(RoomLink(f"way-{one.name}-{other.name}", "stairs", (one.name, other.name)))
            report.guessed.append(
                f"{one.name} and {other.name} share no wall, the graph joins them: part of the stairs")
        else:
            report.left_out.append(f"a way of the graph from {one.name} to {other.name}, which share no wall")

    def _link_kind(self, text: str, *rooms: str) -> str:
        words = f"{text} {' '.join(f'{room} {self.plan.space(room).label}' for room in rooms)}".lower()
        return "elevator" if re.search(r"elev|lift", words) and "stair" not in text.lower() else "stairs"

    # -- the network -------------------------------------------------------------------------------------------------

    def _build_navigation_graph(self, layers: list[Layer]) -> NavigationGraph | None:
        """The layer that joins most of its places, with lengths in metres."""
        if not any(layer.graph.number_of_edges() for layer in layers):
            return None
        best = max(layers, key=lambda layer: max(map(len, nx.connected_components(layer.graph)), default=0))
        graph: nx.Graph = nx.Graph()
        for node, data in best.graph.nodes(data=True):
            room = self.rooms.get(best.cell_of.get(node, "")) or self._find_room(data["at"], MAX_ROOM_DISTANCE_M)
            graph.add_node(node, floor=self._find_floor(float(data["at"][2])), room=room)
        tall = STOREY_M if self.is_index else 1.0
        for a, b in best.graph.edges:
            start, end = (best.graph.nodes[n]["at"] * (1.0, 1.0, tall) for n in (a, b))
            level = graph.nodes[a]["floor"] == graph.nodes[b]["floor"]
            text = " ".join(best.graph.nodes[n]["text"] + " " + str(graph.nodes[n]["room"]) for n in (a, b))
            kind = "floor" if level else "elevator" if re.search("elev|lift", text.lower()) else "stairs"
            graph.add_edge(a, b, length_m=float(np.linalg.norm(end - start)), kind=kind)
        return NavigationGraph(best.name, graph, self._find_room_nodes(best, graph))

    def _find_room_nodes(self, layer: Layer, graph: nx.Graph) -> dict[str, str]:
        """For each room the node in it that is nearest to its middle, or else the nearest one on its floor."""
        places = {node: shapely.Point(data["at"][:2]) for node, data in layer.graph.nodes(data=True)}
        chosen = {}
        for space in self.plan.spaces:
            shape = self.shapes[space.name]
            own = [n for n in places if graph.nodes[n]["room"] == space.name]
            near = own or [n for n in places if graph.nodes[n]["floor"] == space.storey
                           and places[n].distance(shape) < MAX_NODE_DISTANCE_M]
            if near:
                chosen[space.name] = min(near, key=lambda n: (
                    places[n].distance(shape), places[n].distance(shape.representative_point())))
        return chosen

    def _write_report(self, layers: list[Layer], network: NavigationGraph | None) -> None:
        plan, report = self.plan, self.plan.report
        doors = len([cell for cell in self.cells if cell.is_door])
        report.used.append(f"IndoorGML: {len(plan.storeys)} floors, {len(self.cells)} of "
                            f"{len(elements(self.root, 'CellSpace'))} cells, {doors} of them doors, layers "
                            f"{', '.join(layer.name for layer in layers)}")
        report.guessed.append("all doors between rooms stand open; colours are ours")
        landmarks = [layer.name for layer in layers if network is None or layer.name != network.layer]
        report.left_out.append(f"the places of the layers {', '.join(landmarks) or 'none'}, textures, weights")
        if network is not None:
            floor_of = {space.name: space.storey for space in plan.spaces}
            found, total, longest = network.count_routes_across_floors(floor_of)
            report.used.append(f"layer {network.layer} to plan on: {network.graph.number_of_nodes()} places, "
                                f"{network.graph.number_of_edges()} ways; {found} of {total} pairs of rooms on "
                                "different floors have one")
            if longest is not None:
                report.used.append(f"  as {longest[0]} to {longest[1]}: {network.describe(longest[2])}")
            lost = [name for name in floor_of if name not in network.rooms]
            if lost:
                report.left_out.append(f"on layer {network.layer}: no place near {', '.join(lost)}")


def _find_crossing(line: Floats, one: Space, other: Space) -> Floats | None:
    """(2,) where a way (2, 2) from room to room passes a wall that they share: as near to it as there is wall."""
    best: tuple[float, Floats] | None = None
    for stretch in find_facing_stretches(one.name, one.outline, other.name, other.outline, min_gap_m=-0.2):
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
