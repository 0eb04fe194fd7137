"""Reading IndoorGML (OGC 14-005): rooms and doors from cells, links and the navigation graph from layers."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import shapely

from harvey_buildings.fitting.building_plan import (
    TRACED_M,
    BuildingError,
    BuildingPlan,
    Names,
    NavigationGraph,
    RoomLink,
    Space,
    Storey,
    WallOpening,
    slug,
)
from harvey_buildings.fitting.placement import MIN_DOOR_M
from harvey_buildings.fitting.polygons import (
    Floats,
    find_facing_stretches,
    find_turn,
    side_of,
    square_outline,
)
from harvey_buildings.formats.indoor_gml_file import (
    CELLS,
    Boundary,
    Cell,
    Layer,
    elements,
    find_origin,
    find_outline,
    read_boundaries,
    read_cells,
    read_layers,
    read_xml,
)

STOREY_M = 3.5
CEILING_M = 2.8
DOOR_M = (1.2, 2.1)
"""Width and height of a door where the file does not give its size."""
USUAL_DOOR_M = 0.9
"""Width of most doors, by which a file whose unit is not the metre is scaled."""
MAX_CEILING_M = 8.0
"""Where the middle one of all ceilings is higher, the unit is not the metre."""
MIN_STOREY_M = 1.2
"""Floors whose heights differ by less are one storey, with steps."""
MAX_STEP_M = 0.3
TOUCHING_M = 0.01
MAX_DOORWAY_M = 1.6
"""Rooms that touch along more are not parted by a wall; along less they are joined by a doorway of that width."""
MAX_ROOM_DISTANCE_M = 1.5
"""A node further from every room is between rooms."""
MAX_NODE_DISTANCE_M = 8.0
"""A node further from a room does not represent it."""
MAX_CELLS = 5000
MAX_NEIGHBOURS = 8
"""Neighbours of a node between rooms that are joined directly when it is removed."""

Place = tuple[str, Floats]
"""A room and a point (3,) in it [m]."""


def read_gml(path: Path) -> BuildingPlan:
    """The building plan of an IndoorGML file, with its navigation graph, if any. Raises BuildingError."""
    plan, network = read_indoor_gml(path)
    plan.network = network
    return plan


def read_indoor_gml(path: Path) -> tuple[BuildingPlan, NavigationGraph | None]:
    """The building plan of an IndoorGML file, and its navigation graph, if any. Raises BuildingError."""
    root = read_xml(path)
    origin = find_origin(root)
    cells = read_cells(root, origin)
    if not cells or len(cells) > MAX_CELLS:
        raise BuildingError(f"{path.name}: expected an IndoorGML file with 1 to {MAX_CELLS} cells that have a floor, "
                            f"got {len(cells)}")
    return _Reader(path, root, origin, cells).read()


@dataclass
class _Reader:
    path: Path
    root: ET.Element
    origin: Floats
    cells: list[Cell]
    plan: BuildingPlan = field(init=False)
    rooms: dict[str, str] = field(default_factory=dict)
    floors: dict[float, str] = field(default_factory=dict)
    """Storeys by the height of their lowest floor [m]."""
    shapes: dict[str, shapely.Geometry] = field(default_factory=dict)
    boundaries: list[Boundary] = field(default_factory=list)
    is_index: bool = False
    scale: float = 1.0
    turn_rad: float = 0.0

    def read(self) -> tuple[BuildingPlan, NavigationGraph | None]:
        title = slug(self.path.stem) or "building"
        self.plan, names = BuildingPlan(title, self.path.name, sigma_m=TRACED_M), Names(title)
        self.boundaries = read_boundaries(self.root, self.origin)
        self._find_units()
        self._read_storeys(names)
        self._read_spaces(names)
        if not self.plan.spaces:
            raise BuildingError(f"{self.path.name}: expected cells that are rooms, got only doors and walls")
        layers = [self._place_layer(layer) for layer in read_layers(self.root, self.origin)]
        self._read_doors([layer for layer in layers if layer.cell_of])
        network = self._build_navigation_graph(layers)
        self._read_crossings(layers)
        self._write_report(layers, network)
        return self.plan, network

    # -- units and axes ----------------------------------------------------------------------------------------------

    def _find_units(self) -> None:
        """What one unit of the file is in metres, whether z counts floors, and how the building is turned."""
        levels = {round(cell.low, 3) for cell in self.cells}
        tall = [cell.high - cell.low for cell in self.cells]
        self.is_index = all(level.is_integer() for level in levels) and max(tall) <= 1.01
        guessed = self.plan.report.guessed
        if self.is_index:
            guessed.append(f"z counts floors; each is taken to be {STOREY_M} m high, a ceiling {CEILING_M} m; x and y "
                           "are taken to be metres")
        elif float(np.median(tall)) > MAX_CEILING_M:
            widths = [float(np.linalg.norm(b.ends[1] - b.ends[0])) for b in self.boundaries]
            widths = [width for width in widths if width > 0.0]
            self.scale = USUAL_DOOR_M / float(np.median(widths)) if widths else STOREY_M / float(np.median(tall))
            by = f"doors are {USUAL_DOOR_M} m wide" if widths else f"storeys are {STOREY_M} m high"
            guessed.append(f"ceilings are {np.median(tall):g} units high, so the unit is not the metre; a unit is "
                           f"taken to be {self.scale:.3f} m, so that most {by}")
        if self.origin.any():
            guessed.append(f"projected coordinates: the plan's origin is ({self.origin[0]:.0f}, {self.origin[1]:.0f})")
        rings = [shapely.get_coordinates(part.exterior) for cell in self.cells
                 for part in shapely.get_parts(cell.floor) if part.geom_type == "Polygon"]
        self.turn_rad = find_turn(np.concatenate([np.diff(ring, axis=0) for ring in rings])) if rings else 0.0
        if self.turn_rad:
            guessed.append(f"the plan is turned by {math.degrees(-self.turn_rad):.1f} degrees, so that most walls run "
                           "along x and y")

    def _place(self, points: Floats) -> Floats:
        """Points (..., 2 or 3) of the file in the plan's frame [m]."""
        c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
        flat = self.scale * points[..., :2] @ np.array([[c, -s], [s, c]])
        return np.concatenate([flat, self._height_m(points[..., 2:])], axis=-1)

    def _height_m(self, z: Any) -> Any:
        return z * (STOREY_M if self.is_index else self.scale)

    def _place_layer(self, layer: Layer) -> Layer:
        for _, data in layer.graph.nodes(data=True):
            data["at"] = self._place(data["at"])
        return layer

    # -- floors and rooms --------------------------------------------------------------------------------------------

    def _read_storeys(self, names: Names) -> None:
        """Floors less than MIN_STOREY_M apart are one storey; the name is the one that most of its cells give."""
        groups: list[list[Cell]] = []
        for cell in sorted(self.cells, key=lambda cell: cell.low):
            if groups and self._height_m(cell.low - groups[-1][0].low) < MIN_STOREY_M:
                groups[-1].append(cell)
            else:
                groups.append([cell])
        for group in groups:
            given = [cell.storey for cell in group if cell.storey]
            name = names.new(max(sorted(set(given)), key=given.count) if given else f"floor {group[0].low:g}", "floor")
            low_m = float(self._height_m(group[0].low))
            self.floors[low_m] = name
            self.plan.storeys.append(Storey(name, low_m))

    def _read_spaces(self, names: Names) -> None:
        moved = 0.0
        for cell in self.cells:
            if cell.is_door or cell.is_solid:
                continue
            outline = find_outline(cell.floor, self.scale, self.turn_rad)
            if outline is None:
                self.plan.report.left_out.append(f"cell {cell.id}: its floor has no simple border")
                continue
            before = shapely.Polygon(outline)
            outline = square_outline(outline)
            moved = max(moved, float(shapely.hausdorff_distance(shapely.Polygon(outline), before)))
            title = cell.id if slug(cell.id) == slug(cell.label) or not cell.label.isascii() else (
                f"{cell.id} {cell.label}")
            name = names.new(title, "room")
            self.rooms[cell.id] = name
            low_m, tall_m = float(self._height_m(cell.low)), float(self._height_m(cell.high - cell.low))
            high_m = CEILING_M if self.is_index or not tall_m >= 1.5 else min(tall_m, MAX_CEILING_M)
            kind = cell.kind if cell.kind not in CELLS else re.sub(r"\d+", "", slug(cell.id)) or "room"
            self.plan.spaces.append(Space(name, slug(kind) or "room", cell.label, self._find_floor(low_m), outline,
                                          low_m, round(high_m, 3)))
            self.shapes[name] = shapely.Polygon(outline)
        self.plan.report.guessed.append("walls within 8 degrees of the axes are made straight: corners moved by up "
                                         f"to {moved:.2f} m")

    def _find_floor(self, z_m: float) -> str:
        """The storey of a height: the highest whose floor is not above it by more than a step."""
        return self.floors[max((low for low in self.floors if low <= z_m + MAX_STEP_M), default=min(self.floors))]

    def _find_room(self, at: Floats, near_m: float) -> str | None:
        """The room that a place (3,) is in, or else the nearest one on its floor."""
        point, floor = shapely.Point(at[:2]), self._find_floor(float(at[2]))
        on_floor = [space.name for space in self.plan.spaces if space.storey == floor]
        away = {name: float(self.shapes[name].distance(point)) for name in on_floor}
        best = min(away, key=lambda name: (away[name], self.shapes[name].area), default=None)
        return best if best is not None and away[best] <= near_m else None

    # -- doors -------------------------------------------------------------------------------------------------------

    def _read_doors(self, layers: list[Layer]) -> None:
        """Doors: cells that are one, boundaries that a way passes, and short stretches where joined rooms touch."""
        joined: nx.Graph = nx.Graph()
        cells_of: dict[str, tuple[str, str]] = {}
        for layer in layers:
            for a, b, way in layer.graph.edges(data="name"):
                if a in layer.cell_of and b in layer.cell_of:
                    joined.add_edge(layer.cell_of[a], layer.cell_of[b])
                    cells_of[way] = layer.cell_of[a], layer.cell_of[b]
        for cell in (cell for cell in self.cells if cell.is_door):
            rooms = [self.rooms[c] for c in joined.adj.get(cell.id, ()) if c in self.rooms]
            self._add_door_cell(cell, tuple(rooms) if len(rooms) == 2 else ())
        with_door = self._read_door_boundaries(cells_of)
        for a, b in joined.edges:
            if a in self.rooms and b in self.rooms and frozenset((a, b)) not in with_door:
                self._join(self.rooms[a], self.rooms[b])

    def _add_door_cell(self, cell: Cell, rooms: tuple[str, ...]) -> None:
        corners = self._place(np.column_stack([shapely.get_coordinates(cell.floor), np.zeros(
            shapely.count_coordinates(cell.floor))]))[:, :2]
        low, high = corners.min(axis=0), corners.max(axis=0)
        storey = self._find_floor(float(self._height_m(cell.low)))
        self._add_opening(cell.id, storey, (low + high) / 2, float((high - low).max()), rooms)

    def _read_door_boundaries(self, cells_of: dict[str, tuple[str, str]]) -> set[frozenset[str]]:
        """The doors that boundaries dual to a transition are; and the pairs of cells that they join."""
        found = set()
        for boundary in self.boundaries:
            pair = cells_of.get(boundary.way, ("", ""))
            ends = self._place(np.column_stack([boundary.ends, [boundary.low] * 2]))
            width_m = float(np.linalg.norm(ends[1, :2] - ends[0, :2]))
            if frozenset(pair) in found or not all(cell in self.rooms for cell in pair) or width_m > 2 * MAX_DOORWAY_M:
                continue
            one, other = (self.plan.space(self.rooms[cell]) for cell in pair)
            if one.storey == other.storey:
                found.add(frozenset(pair))
                self._add_opening(f"{one.name}-to-{other.name}", one.storey, ends[:, :2].mean(axis=0),
                                  max(width_m, MIN_DOOR_M), (one.name, other.name))
        return found

    def _join(self, one: str, other: str) -> None:
        """Two rooms that a way joins, with no door of the file between them."""
        storey = self.plan.space(one).storey
        if storey != self.plan.space(other).storey:
            return
        shared = self.shapes[one].boundary.intersection(self.shapes[other].buffer(TOUCHING_M, join_style="mitre"))
        pieces = [piece for piece in shapely.get_parts(shapely.line_merge(shared)) if piece.length > 0.3]
        widest = max(pieces, key=lambda piece: piece.length, default=None)
        if widest is None or widest.length > MAX_DOORWAY_M:
            self.plan.without_wall.add(frozenset((one, other)))
            return
        middle = shapely.get_coordinates(widest.interpolate(0.5, normalized=True))[0]
        self._add_opening(f"{one}-to-{other}", storey, middle, widest.length, (one, other))

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
        spaces = [self.plan.space(room) for room in rooms]
        words = f"{text} {' '.join(f'{s.name} {s.label} {s.kind}' for s in spaces)}".lower()
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
        for a, b in best.graph.edges:
            start, end = (best.graph.nodes[n]["at"] for n in (a, b))
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
                            f"{len(elements(self.root, *CELLS))} cells, {doors} of them doors, layers "
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
