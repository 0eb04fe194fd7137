"""Drafting: what a world file says, with everything that it includes or is made from, becomes a blueprint."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.outlines import is_simple
from world_models.building.regions import Finish
from world_models.files.construction.blueprint import Blueprint, DoorSpec, LinkSpec, LocaleSpec, RoomLook, ThingSpec
from world_models.files.toml.copies import COPY_KEYS, renamed, subtree
from world_models.files.toml.includes import included, named_file
from world_models.files.toml.placing import Placement, placements, several
from world_models.files.toml.shared_parts import Shelf
from world_models.files.toml.source import Node, Source
from world_models.frames import Pose

RECTANGLE_WALLS = ("south", "east", "north", "west")
FINISH_KEYS = ("walls", "floor", "ceiling", "baseboard", "moulding", "frame", "leaf", "threshold")
LOCALE_KEYS = ("kind", "in", "at", "turn", "size", "outline", "height", "wall_heights", "sky", "like", "things",
               "properties", "survey", *FINISH_KEYS[:5])
DEFAULT_KEYS = (*FINISH_KEYS, "kind", "in", "height", "door_width", "door_height")
SHARED_KEYS = ("include", "finishes", "parts", "defaults")
DOOR_KEYS = ("width", "height", "open", "frame", "leaf", "threshold", "panel")


@dataclass
class Draft:
    """What has been read so far.

    Attributes:
        base: the world file; within: the files that are made from this one, so that none contains itself.
    """

    base: Source
    within: tuple[Path, ...] = ()
    name: str = ""
    shelf: Shelf = field(default_factory=Shelf)
    defaults: dict[str, tuple[Node, float]] = field(default_factory=dict)
    locales: dict[str, LocaleSpec] = field(default_factory=dict)
    doors: list[DoorSpec] = field(default_factory=list)
    things: list[ThingSpec] = field(default_factory=list)
    links: list[LinkSpec] = field(default_factory=list)
    _used: dict[str, set[str]] = field(default_factory=dict)

    def blueprint(self) -> Blueprint:
        """All of it."""
        return Blueprint(self.name, f"{self.base.name}:1", self.locales, tuple(self.doors), tuple(self.things),
                         tuple(self.links))

    # -- files -----------------------------------------------------------------------------------------------------

    def read_base(self) -> None:
        """The world file itself."""
        root = self.base.root.table(("name", "units", "locales"), (*SHARED_KEYS, "doors", "links"))
        self.name = root["name"].text()
        self._read_shared(root)
        nodes = root["locales"]
        for name, node in nodes.entries():
            self._add_locale(name, node)
        self._check_hierarchy(nodes)
        for name, node in nodes.entries():
            self._read_things(name, _alike(name, node, nodes))
        for name, node in doors.entries() if (doors := root.get("doors")) else ():
            self._add_doors(name, node)
        for name, node in links.entries() if (links := root.get("links")) else ():
            self._add_links(name, node)

    def read_details(self, source: Source) -> None:
        """A file that adds finishes, parts and things to locales that are there."""
        root = source.root.table(("units", "locales"), ("finishes", "parts"))
        self.shelf.read(root)
        for name, node in root["locales"].entries():
            node.table(("things",))
            if name not in self.locales:
                raise node.fail(f"one of the locales {', '.join(self.locales)}", repr(name))
            self._read_things(name, node)

    def _read_shared(self, root: Node) -> None:
        """Finishes, parts and defaults: those of included files first, so that a file's own defaults stand."""
        for source in included(root):
            self._read_shared(source.root.table(("units",), SHARED_KEYS))
        self.shelf.read(root)
        if defaults := root.get("defaults"):
            own = {key: (node, self.shelf.unit_m) for key, node in defaults.table(optional=DEFAULT_KEYS).entries()}
            self.defaults.update(own)

    # -- locales -----------------------------------------------------------------------------------------------------

    def _add_locale(self, name: str, node: Node) -> None:
        if name == self.name:
            raise node.fail("a name other than that of the whole world", repr(name))
        if "from" in node.table(optional=(*LOCALE_KEYS, *COPY_KEYS)):
            self._copy(name, node.table(("from",), COPY_KEYS))
        else:
            self._new(name, self._locale(name, _alike(name, node.table(optional=LOCALE_KEYS))), node)

    def _new(self, name: str, spec: LocaleSpec, node: Node) -> None:
        if name in self.locales:
            raise node.fail("a name that no other locale has", f"{name!r} once more")
        self.locales[name] = spec

    def _copy(self, name: str, node: Node) -> None:
        """A locale with all that is in it, out of another world file."""
        source = named_file(node["from"])
        if source.file in (self.base.file, *self.within):
            raise node["from"].fail("another world file, that is not made from this one")
        other = Draft(source, (self.base.file, *self.within))
        other.read_base()
        inside = subtree(other.blueprint(), node)
        prefix = node["prefix"].text() if "prefix" in node else ""
        part = renamed(inside, name, prefix)
        top = part.locales[name]
        placed = replace(
            top, parent=node["in"].text() if "in" in node else self.name, frame=self._placed(node, 3),
            kind=node["kind"].text() if "kind" in node else top.kind, source=node.where,
            properties={**top.properties, **_properties(node.get("properties"))})
        for own, spec in part.locales.items():
            self._new(own, placed if own == name else spec, node)
        self.doors += part.doors
        self.links += part.links
        self.things += part.things
        for room, things in node["add"].entries() if "add" in node else ():
            if prefix + room not in part.locales:
                raise things.fail(f"one of the locales {', '.join(inside.locales)}", repr(room))
            self._read_things(prefix + room, Node({"things": things.value}, node.key, node.source))

    def _locale(self, name: str, node: Node) -> LocaleSpec:
        kind = self._given(node, "kind")
        if kind is None:
            raise node.fail("the key 'kind'", f"keys {', '.join(node.value) or 'none'}")
        outline, names = self._outline(node)
        height = self._length(node, "height", 0.1, 1000.0, 2.7)
        look = self._look(node, names)
        sky = "sky" in node and node["sky"].flag()
        properties = _properties(node.get("properties")) | ({"sky": True} if sky else {})
        return LocaleSpec(
            name, kind.text(), self._container(name, node),
            self._placed(node, 3), outline, names, height, replace(look, ceiling=None, moulding=None) if sky else look,
            properties, node.where, *self._survey(node.get("survey")),
            wall_heights_m=self._wall_heights(node.get("wall_heights"), names, height),
        )

    def _container(self, name: str, node: Node) -> str:
        """The locale that this one is in; the one in which others are by default is itself in the root."""
        given = self._given(node, "in")
        return self.name if given is None or ("in" not in node and given.value == name) else given.text()

    def _survey(self, node: Node | None) -> tuple[float, float]:
        """How well a frame's place and direction in its container are known."""
        if node is None:
            return 0.0, 0.0
        node.table(optional=("sigma", "sigma_deg"))
        place = self.shelf.length(node["sigma"], 0.0) if "sigma" in node else 0.0
        return place, math.radians(node["sigma_deg"].number(0.0, 180.0)) if "sigma_deg" in node else 0.0

    def _outline(self, node: Node) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
        if "size" in node and "outline" in node:
            raise node["outline"].fail("either size or outline", "both")
        if "size" in node:
            low = 0.1 / self.shelf.unit_m
            width, depth = (v * self.shelf.unit_m for v in node["size"].numbers((2,), low, self.shelf.far))
            return np.array([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)]), RECTANGLE_WALLS
        if "outline" in node:
            corners = [item.numbers((2,), -self.shelf.far, self.shelf.far) for item in node["outline"].items(least=3)]
            outline = np.array(corners) * self.shelf.unit_m
            if not is_simple(outline):
                raise node["outline"].fail("corners counter-clockwise round a room, without crossing or doubling")
            return outline, tuple(f"side-{index}" for index in range(len(outline)))
        return None, ()

    def _wall_heights(self, node: Node | None, names: Sequence[str], height_m: float) -> Mapping[str, float]:
        """Of the walls that are lower than the room: only under the sky, or one could look out."""
        if node is None:
            return {}
        walls = node.table(optional=tuple(names))
        return {name: self.shelf.length(item, 0.1, height_m) for name, item in walls.entries()}

    def _look(self, node: Node, wall_names: Sequence[str]) -> RoomLook:
        walls = self._given(node, "walls")
        if walls is not None and isinstance(walls.value, dict):
            walls.table(tuple(wall_names))
            finishes = {name: self.shelf.finish(walls[name]) for name in wall_names}
        elif walls is not None and isinstance(walls.value, list):
            if len(walls.value) != len(wall_names):
                raise walls.fail(f"a finish for each of the {len(wall_names)} walls {', '.join(wall_names)}")
            finishes = {name: self.shelf.finish(item) for name, item in zip(wall_names, walls.items(), strict=True)}
        else:
            finishes = {name: self._finish_or(walls, Finish((0.8, 0.8, 0.76))) for name in wall_names}
        boards = [self._given(node, key) for key in ("baseboard", "moulding")]
        return RoomLook(
            finishes,
            self._finish_or(self._given(node, "floor"), Finish((0.5, 0.5, 0.5))),
            self._finish_or(self._given(node, "ceiling"), Finish((0.9, 0.9, 0.9))),
            *(self.shelf.finish(board) if board and board.value != "none" else None for board in boards),
        )

    def _given(self, node: Node, key: str) -> Node | None:
        """The value of a key of this table, or else of the defaults."""
        return node.get(key) or (self.defaults[key][0] if key in self.defaults else None)

    def _length(
        self, node: Node, key: str, low_m: float, high_m: float, otherwise_m: float, default: str = ""
    ) -> float:
        """A length of this table, or else of the defaults, which may be of a file in other units [m]."""
        if key in node:
            return self.shelf.length(node[key], low_m, high_m)
        found = self.defaults.get(default or key)
        return otherwise_m if found is None else found[0].number(low_m / found[1], high_m / found[1]) * found[1]

    def _finish_or(self, node: Node | None, otherwise: Finish) -> Finish:
        return self.shelf.finish(node) if node else otherwise

    def _placed(self, node: Node, dimensions: int = 2) -> Pose:
        """The frame given by ``at`` (x, y[, z]) and ``turn`` (degrees, counter-clockwise)."""
        counts = tuple(range(2, dimensions + 1))
        at = node["at"].numbers(counts, -self.shelf.far, self.shelf.far) if "at" in node else (0.0, 0.0)
        turn = node["turn"].number(-360.0, 360.0) if "turn" in node else 0.0
        x, y, z = (*at, 0.0)[:3]
        return _frame((x, y, z), turn, self.shelf.unit_m)

    def _check_hierarchy(self, nodes: Node) -> None:
        """Every locale lies in a known one, and those without walls contain some that have them."""
        for name, spec in self.locales.items():
            node = nodes.get(name)
            if node is None:
                continue
            chain = [name]
            while chain[-1] != self.name:
                parent = self.locales[chain[-1]].parent
                place = at["in"] if (at := nodes.get(chain[-1]) or node) and "in" in at else node
                if parent != self.name and parent not in self.locales:
                    raise place.fail(f"one of the locales {self.name}, {', '.join(self.locales)}")
                if parent in chain:
                    raise place.fail("a locale that is not itself contained in this one")
                chain.append(parent)
            contains = any(other.parent == name for other in self.locales.values())
            if (spec.outline is None) != contains:
                raise node.fail("either a size or outline, or other locales in it", "both" if contains else "neither")
        if not self.locales:
            raise nodes.fail("at least one locale")

    # -- doors and links -------------------------------------------------------------------------------------------

    def _add_doors(self, name: str, node: Node) -> None:
        """One door, or several alike along a wall."""
        node.table(("between", "wall", "along"), DOOR_KEYS)
        places = several(node["along"], self.shelf)
        for number, along_m in enumerate(places, 1):
            own = name if len(places) == 1 else f"{name}-{number}"
            if any(door.name == own for door in self.doors):
                raise node.fail("a name that no other door has", f"{own!r} once more")
            self.doors.append(self._door(own, along_m, node))

    def _door(self, name: str, along_m: float, node: Node) -> DoorSpec:
        between = tuple(self._room(item) for item in node["between"].items(least=1))
        is_open = node["open"].flag() if "open" in node else False
        if len(between) > 2 or len(set(between)) != len(between) or (is_open and len(between) < 2):
            raise node["between"].fail("two different locales" if is_open else "one or two different locales")
        frame, leaf, threshold = (self._finish_or(self._given(node, key), Finish((0.45, 0.33, 0.22)))
                                  for key in ("frame", "leaf", "threshold"))
        return DoorSpec(
            name, between, self._wall(node["wall"], between[0]), along_m,
            self._length(node, "width", 0.1, 20.0, 0.9, "door_width"),
            self._length(node, "height", 0.1, 20.0, 2.0, "door_height"),
            is_open, frame, leaf, threshold, self.shelf.part(node["panel"]) if "panel" in node else (), node.where,
        )

    def _add_links(self, name: str, node: Node) -> None:
        """A link between two locales, or between each two of several that one stop is said for."""
        shared = "stop" in node.table(("kind", "between"), ("stop", "stops"))
        node.table(("kind", "between", "stop" if shared else "stops"))
        rooms = [self._room(item) for item in node["between"].items(least=2)]
        if len(set(rooms)) != len(rooms) or (len(rooms) != 2 and not shared):
            raise node["between"].fail("different locales" if shared else "two different locales")
        nodes = [node["stop"]] * len(rooms) if shared else node["stops"].items(least=2)
        if len(nodes) != len(rooms):
            raise node["stops"].fail("a stop [x, y, heading in degrees] in each of the two locales")
        stops = [self._stop(item) for item in nodes]
        kind = node["kind"].choice("elevator", "stairs")
        for i, j in combinations(range(len(rooms)), 2):
            own = name if len(rooms) == 2 else f"{name}-{i + 1}-{j + 1}"
            if own in [door.name for door in self.doors] + [link.name for link in self.links]:
                raise node.fail("a name that no door has", repr(own))
            self.links.append(LinkSpec(own, kind, (rooms[i], rooms[j]), (stops[i], stops[j]), node.where))

    def _stop(self, node: Node) -> tuple[float, float, float]:
        x, y, degrees = node.numbers((3,), -self.shelf.far, self.shelf.far)
        return x * self.shelf.unit_m, y * self.shelf.unit_m, math.radians(degrees)

    def _room(self, node: Node) -> str:
        rooms = [name for name, spec in self.locales.items() if spec.outline is not None]
        return node.choice(*rooms)

    def _wall(self, node: Node, room: str) -> str:
        return node.choice(*self.locales[room].wall_names)

    # -- things ----------------------------------------------------------------------------------------------------

    def _read_things(self, locale: str, node: Node) -> None:
        if (things := node.get("things")) is None:
            return
        if self.locales[locale].outline is None:
            raise things.fail("things only in a locale with walls", f"things in {locale}")
        for item in things.items():
            self.things += [self._thing(locale, place) for place in placements(item, self.shelf)]

    def _thing(self, locale: str, place: Placement) -> ThingSpec:
        name = self._thing_name(locale, place)
        spec = ThingSpec(name, locale, place.kind, place.boxes, place.node.where)
        if place.wall is None:
            return replace(spec, locale_from_part=_frame((place.x_m, place.y_m, 0.0), place.turn_deg))
        return replace(spec, wall=self._wall(place.wall, locale), along_m=place.x_m, up_m=place.up_m)

    def _thing_name(self, locale: str, place: Placement) -> str:
        """The name given, or the part's with a number."""
        if locale not in self._used:
            self._used[locale] = {thing.name for thing in self.things if thing.locale == locale}
        used = self._used[locale]
        if place.name is None:
            name = next(name for n in range(1, len(used) + 2) if (name := f"{place.kind}-{n}") not in used)
        else:
            name = place.name.text()
            if name in used:
                raise place.name.fail(f"a name that nothing else in {locale} has")
        used.add(name)
        return name


def _alike(name: str, node: Node, nodes: Node | None = None) -> Node:
    """The table of a locale, with what it does not say itself from the one that it is like."""
    if "like" not in node:
        return node
    nodes = nodes or Node(node.source.data["locales"], ("locales",), node.source)
    like = node["like"].text()
    known = nodes.value.get(like)
    if like == name or not isinstance(known, dict) or "like" in known or "from" in known:
        raise node["like"].fail("a locale of this file that is neither like another nor from another file")
    return Node({**known, **node.value}, node.key, node.source)


def _frame(at: tuple[float, float, float], turn_deg: float, unit_m: float = 1.0) -> Pose:
    turn = math.radians(turn_deg)
    c, s = (round(value, 15) for value in (math.cos(turn), math.sin(turn)))
    return Pose(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array(at) * unit_m)


def _properties(node: Node | None) -> dict[str, Any]:
    if node is None:
        return {}
    for _, item in node.entries():
        if not isinstance(item.value, str | bool | int | float):
            raise item.fail("a text, a number, true or false")
    return dict(node.value)
