"""What an importer reads from a building file: spaces, openings, furnishings, and a report of what was used."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import combinations, pairwise

import networkx as nx
import numpy as np
import shapely
from numpy.typing import NDArray

from harvey.errors import in_one_line
from world_models.files.toml.source import WorldError

Floats = NDArray[np.float64]
Steps = tuple[tuple[float, float, float, float, float, float], ...]
"""Boxes x0, x1, y0, y1, z0, z1 in a thing's own frame [m]."""


class BuildingError(WorldError):
    """A building file that cannot be read: names the file, what was expected and what was got."""


class NoWayError(BuildingError):
    """A map in which most rooms have no doorway, so that what was traced cannot be trusted."""


@dataclass(frozen=True, slots=True)
class Storey:
    """A storey of the building and its height above the file's zero [m]."""

    name: str
    elevation_m: float


@dataclass(frozen=True, eq=False, slots=True)
class Space:
    """A room.

    Attributes:
        label: the file's own name for it.
        outline: (k, 2) on the plan of the building, counter-clockwise [m].
        floor_m: height of its floor above the file's zero; height_m: of its ceiling above its floor.
    """

    name: str
    kind: str
    label: str
    storey: str
    outline: Floats
    floor_m: float
    height_m: float


@dataclass(frozen=True, eq=False, slots=True)
class WallOpening:
    """A door or an opening without one in a wall of a storey.

    Attributes:
        name: of the door.
        centre: (2,) on the plan [m].
        rooms: the spaces that it joins according to the file; empty where the file does not say.
        along: (2,) direction along its wall on the plan, where that is known.
        has_leaf: whether it is a door; an opening without one is left out where it does not join two spaces.
    """

    name: str
    storey: str
    centre: Floats
    width_m: float
    height_m: float
    rooms: tuple[str, ...] = ()
    along: Floats | None = None
    has_leaf: bool = True


@dataclass(frozen=True, eq=False, slots=True)
class Window:
    """A window: (2,) centre and (2,) direction along its wall on the plan; sill above the file's zero [m]."""

    name: str
    storey: str
    centre: Floats
    along: Floats
    width_m: float
    sill_m: float
    height_m: float


@dataclass(frozen=True, eq=False, slots=True)
class Furnishing:
    """A thing in a space: boxes about the point ``at`` (2,) on the plan, turned; z above the file's zero [m]."""

    name: str
    kind: str
    room: str
    at: Floats
    turn_rad: float
    boxes: Steps


@dataclass(frozen=True, slots=True)
class RoomLink:
    """A link between two spaces that share no wall: kind is stairs or elevator."""

    name: str
    kind: str
    between: tuple[str, str]


@dataclass
class ImportReport:
    """What was used of a file, what was guessed and what was left out; one sentence each."""

    used: list[str] = field(default_factory=list)
    guessed: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        parts = (("used", self.used), ("guessed", self.guessed), ("left out", self.left_out))
        return "\n".join(f"{title}\n" + "\n".join(f"  {in_one_line(line)}" for line in lines or ["nothing"])
                         for title, lines in parts)


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


MODELLED_M, TRACED_M = 0.03, 0.05
"""Standard deviations of what was built by a model, and of a plan that was traced, or scanned with cells as large."""


@dataclass
class BuildingPlan:
    """The contents of a building file.

    Attributes:
        source: name of the file.
        storeys: from the lowest up.
        without_wall: pairs of spaces that touch without a wall between them.
        barriers: footprints of walls and railings by storey: no wide opening is placed across one.
        network: the graph to plan on that came with the file, where it has one.
        sigma_m: how well such a file knows where walls, doors and things are; a standard deviation.
    """

    name: str
    source: str
    storeys: list[Storey] = field(default_factory=list)
    spaces: list[Space] = field(default_factory=list)
    openings: list[WallOpening] = field(default_factory=list)
    without_wall: set[frozenset[str]] = field(default_factory=set)
    barriers: dict[str, list[shapely.Geometry]] = field(default_factory=dict)
    windows: list[Window] = field(default_factory=list)
    furnishings: list[Furnishing] = field(default_factory=list)
    links: list[RoomLink] = field(default_factory=list)
    report: ImportReport = field(default_factory=ImportReport)
    network: NavigationGraph | None = None
    sigma_m: float = MODELLED_M
    _by_name: dict[str, Space] = field(default_factory=dict, repr=False)

    def on(self, storey: str) -> list[Space]:
        """The spaces of a storey."""
        return [space for space in self.spaces if space.storey == storey]

    def space(self, name: str) -> Space:
        """A space by name."""
        if len(self._by_name) != len(self.spaces):
            self._by_name = {space.name: space for space in self.spaces}
        return self._by_name[name]


class Names:
    """Unique names for locales and doors: words joined by hyphens."""

    def __init__(self, *taken: str) -> None:
        self._taken = set(taken)
        self._last: dict[str, int] = {}

    def new(self, text: str, otherwise: str) -> str:
        """A name made from a text, or from ``otherwise`` where the text has no words; numbered where taken."""
        base = slug(text) or otherwise
        name, number = base, self._last.get(base, 1)
        while name in self._taken:
            number += 1
            name = f"{base}-{number}"
        self._taken.add(name)
        self._last[base] = number
        return name


def slug(text: str) -> str:
    """Lower-case words joined by hyphens; letters of any script are kept."""
    return "-".join(re.findall(r"\w+", text[:1000].lower().replace("'", "").replace("_", " ")))[:60].strip("-")
