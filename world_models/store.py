"""Reading a world: TOML that a person writes (``worlds/research_center.toml`` is annotated), or a compiled file."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.blueprint import Blueprint, DoorSpec, LinkSpec, LocaleSpec, RoomLook, ThingSpec
from world_models.builder import build_world
from world_models.frames import Pose
from world_models.outlines import is_simple
from world_models.regions import Finish
from world_models.shelf import Shelf
from world_models.sqlite_frames import SqliteFrames
from world_models.store_schema import SUFFIXES
from world_models.store_writer import compile_world
from world_models.toml_source import Node, Source, WorldError
from world_models.world import World

__all__ = ["SUFFIXES", "WORLDS", "WorldError", "compile_file", "fingerprint", "load_world", "read_world"]

WORLDS = Path(__file__).parent / "worlds"
"""Where the worlds that come with the project are kept."""

RECTANGLE_WALLS = ("south", "east", "north", "west")
FINISH_KEYS = ("walls", "floor", "ceiling", "baseboard", "moulding", "frame", "leaf", "threshold")
LOCALE_KEYS = ("in", "at", "turn", "size", "outline", "height", "things", "properties", "survey", *FINISH_KEYS[:5])
DEFAULT_KEYS = (*FINISH_KEYS, "height", "door_width", "door_height")


def load_world(path: str | PathLike[str], *, details: Sequence[str | PathLike[str]] = ()) -> World:
    """The world described by a TOML file, or in a compiled one, whose frames are then loaded as they are asked for.

    Args:
        path: the world file.
        details: further files that add parts, finishes and things (no rooms or doors). A compiled world has them in
            itself: they must be those that it was compiled with, and only their names matter.

    Raises:
        WorldError: a file cannot be read or does not describe a world; names file, line, what was expected and came.
    """
    path = Path(path)
    if path.suffix in SUFFIXES:
        return World(SqliteFrames(path, [Path(detail).stem for detail in details]))
    return read_world(Source.read(path), [Source.read(Path(detail)) for detail in details])


def fingerprint(path: str | PathLike[str]) -> str:
    """SHA-256 of a world file, or of what a compiled one was made of. Raises OSError or WorldError."""
    path = Path(path)
    return SqliteFrames(path).sha256 if path.suffix in SUFFIXES else hashlib.sha256(path.read_bytes()).hexdigest()


def compile_file(path: str | PathLike[str], out: str | PathLike[str],
                 details: Sequence[str | PathLike[str]] = ()) -> World:
    """Compile a TOML world with its details; returns the world as it was compiled. Raises WorldError."""
    base, added = Source.read(Path(path)), [Source.read(Path(detail)) for detail in details]
    layers = [read_world(base, added[:count]) for count in range(len(added) + 1)]
    compile_world(layers, Path(out), [Path(detail).stem for detail in details])
    return layers[-1]


def read_world(base: Source, details: Sequence[Source] = ()) -> World:
    """As :func:`load_world`, from texts already read."""
    draft = _Draft(base)
    draft.read_base(base.root)
    for source in details:
        draft.read_details(source.root)
    return build_world(draft.blueprint())


@dataclass
class _Draft:
    """What has been read so far."""

    base: Source
    name: str = ""
    shelf: Shelf = field(default_factory=Shelf)
    defaults: dict[str, Node] = field(default_factory=dict)
    locales: dict[str, LocaleSpec] = field(default_factory=dict)
    doors: list[DoorSpec] = field(default_factory=list)
    things: list[ThingSpec] = field(default_factory=list)
    links: list[LinkSpec] = field(default_factory=list)

    def blueprint(self) -> Blueprint:
        return Blueprint(self.name, f"{self.base.name}:1", self.locales, tuple(self.doors), tuple(self.things),
                         tuple(self.links))

    # -- files -----------------------------------------------------------------------------------------------------

    def read_base(self, root: Node) -> None:
        root.table(("name", "units", "locales"), ("finishes", "parts", "defaults", "doors", "links"))
        self.name = root["name"].text()
        self.shelf.read(root)
        if defaults := root.get("defaults"):
            self.defaults = dict(defaults.table(optional=DEFAULT_KEYS).entries())
        for name, node in root["locales"].entries():
            self.locales[name] = self._locale(name, node)
        self._check_hierarchy(root["locales"])
        for name, node in root["locales"].entries():
            self._read_things(name, node)
        for name, node in doors.entries() if (doors := root.get("doors")) else ():
            self.doors.append(self._door(name, node))
        for name, node in links.entries() if (links := root.get("links")) else ():
            self.links.append(self._link(name, node))

    def read_details(self, root: Node) -> None:
        root.table(("units", "locales"), ("finishes", "parts"))
        self.shelf.read(root)
        for name, node in root["locales"].entries():
            node.table(("things",))
            if name not in self.locales:
                raise node.fail(f"one of the locales {', '.join(self.locales)}", repr(name))
            self._read_things(name, node)

    # -- locales -----------------------------------------------------------------------------------------------------

    def _locale(self, name: str, node: Node) -> LocaleSpec:
        node.table(("kind",), LOCALE_KEYS)
        if name == self.name:
            raise node.fail("a name other than that of the whole world", repr(name))
        outline, names = self._outline(node)
        height = self._given(node, "height")
        return LocaleSpec(
            name, node["kind"].text(), node["in"].text() if "in" in node else self.name,
            self._placed(node, 3), outline, names,
            self.shelf.length(height, 0.1, 1000.0) if height else 2.7,
            self._look(node, names), _properties(node.get("properties")), node.where, *self._survey(node.get("survey")),
        )

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

    def _look(self, node: Node, wall_names: Sequence[str]) -> RoomLook:
        walls = self._given(node, "walls")
        if walls is not None and isinstance(walls.value, dict):
            walls.table(tuple(wall_names))
            finishes = {name: self.shelf.finish(walls[name]) for name in wall_names}
        else:
            finishes = {name: self._finish_or(walls, Finish((0.8, 0.8, 0.76))) for name in wall_names}
        boards = [self._given(node, key) for key in ("baseboard", "moulding")]
        return RoomLook(
            finishes,
            self._finish_or(self._given(node, "floor"), Finish((0.5, 0.5, 0.5))),
            self._finish_or(self._given(node, "ceiling"), Finish((0.9, 0.9, 0.9))),
            *(self.shelf.finish(board) if board else None for board in boards),
        )

    def _given(self, node: Node, key: str) -> Node | None:
        """The value of a key of this table, or else of the defaults."""
        return node.get(key) or self.defaults.get(key)

    def _finish_or(self, node: Node | None, otherwise: Finish) -> Finish:
        return self.shelf.finish(node) if node else otherwise

    def _placed(self, node: Node, dimensions: int = 2) -> Pose:
        """The frame given by ``at`` (x, y[, z]) and ``turn`` (degrees, counter-clockwise)."""
        counts = tuple(range(2, dimensions + 1))
        at = node["at"].numbers(counts, -self.shelf.far, self.shelf.far) if "at" in node else (0.0, 0.0)
        turn = math.radians(node["turn"].number(-360.0, 360.0)) if "turn" in node else 0.0
        c, s = (round(value, 15) for value in (math.cos(turn), math.sin(turn)))
        x, y, z = (*at, 0.0)[:3]
        return Pose(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([x, y, z]) * self.shelf.unit_m)

    def _check_hierarchy(self, node: Node) -> None:
        """Every locale lies in a known one, and those without walls contain some that have them."""
        for name, spec in self.locales.items():
            chain = [name]
            while chain[-1] != self.name:
                parent = self.locales[chain[-1]].parent
                if parent != self.name and parent not in self.locales:
                    raise node[chain[-1]]["in"].fail(f"one of the locales {self.name}, {', '.join(self.locales)}")
                if parent in chain:
                    raise node[chain[-1]]["in"].fail("a locale that is not itself contained in this one")
                chain.append(parent)
            contains = any(other.parent == name for other in self.locales.values())
            if (spec.outline is None) != contains:
                raise node[name].fail("either a size or outline, or other locales in it",
                                      "both" if contains else "neither")
        if not self.locales:
            raise node.fail("at least one locale")

    # -- doors and things ----------------------------------------------------------------------------------------------

    def _door(self, name: str, node: Node) -> DoorSpec:
        node.table(("between", "wall", "along"), ("width", "height", "open", "frame", "leaf", "threshold", "panel"))
        between = tuple(self._room(item) for item in node["between"].items(least=1))
        is_open = node["open"].flag() if "open" in node else False
        if len(between) > 2 or len(set(between)) != len(between) or (is_open and len(between) < 2):
            raise node["between"].fail("two different locales" if is_open else "one or two different locales")
        width, height = (node.get(key) or self.defaults.get(f"door_{key}") for key in ("width", "height"))
        frame, leaf, threshold = (self._finish_or(self._given(node, key), Finish((0.45, 0.33, 0.22)))
                                  for key in ("frame", "leaf", "threshold"))
        return DoorSpec(
            name, between, self._wall(node["wall"], between[0]),
            self.shelf.coordinate(node["along"]),
            self.shelf.length(width, 0.1, 20.0) if width else 0.9,
            self.shelf.length(height, 0.1, 20.0) if height else 2.0,
            is_open, frame, leaf, threshold, self.shelf.part(node["panel"]) if "panel" in node else (), node.where,
        )

    def _link(self, name: str, node: Node) -> LinkSpec:
        node.table(("kind", "between", "stops"))
        between = [self._room(item) for item in node["between"].items(least=2)]
        if len(between) != 2 or between[0] == between[1]:
            raise node["between"].fail("two different locales")
        stops = [item.numbers((3,), -self.shelf.far, self.shelf.far) for item in node["stops"].items(least=2)]
        if len(stops) != 2:
            raise node["stops"].fail("a stop [x, y, heading in degrees] in each of the two locales")
        if name in [door.name for door in self.doors]:
            raise node.fail("a name that no door has")
        unit = self.shelf.unit_m
        a, b = ((x * unit, y * unit, math.radians(degrees)) for x, y, degrees in stops)
        return LinkSpec(name, node["kind"].choice("elevator", "stairs"), (between[0], between[1]), (a, b), node.where)

    def _room(self, node: Node) -> str:
        rooms = [name for name, spec in self.locales.items() if spec.outline is not None]
        return node.choice(*rooms)

    def _wall(self, node: Node, room: str) -> str:
        return node.choice(*self.locales[room].wall_names)

    def _read_things(self, locale: str, node: Node) -> None:
        if (things := node.get("things")) is None:
            return
        if self.locales[locale].outline is None:
            raise things.fail("things only in a locale with walls", f"things in {locale}")
        for item in things.items():
            self.things.append(self._thing(locale, item))

    def _thing(self, locale: str, node: Node) -> ThingSpec:
        against = "wall" in node.table((), ("part", "boxes", "finish", "name", "wall", "along", "up", "at", "turn"))
        place = ("wall", "along") if against else ("at",)
        node.table(place, ("part", "boxes", "finish", "name", *(("up",) if against else ("turn",))))
        if ("part" in node) == ("boxes" in node):
            raise node.fail("either a part or boxes", "both" if "part" in node else "neither")
        kind = node["part"].text() if "part" in node else "detail"
        finish = self.shelf.finish(node["finish"]) if "finish" in node else None
        boxes = self.shelf.part(node["part"]) if "part" in node else self.shelf.boxes(node["boxes"], finish)
        if finish and "part" in node:
            boxes = tuple(replace(box, finish=finish) for box in boxes)
        spec = ThingSpec(self._thing_name(locale, kind, node.get("name")), locale, kind, boxes, node.where)
        if not against:
            return replace(spec, locale_from_part=self._placed(node))
        return replace(
            spec, wall=self._wall(node["wall"], locale), along_m=self.shelf.coordinate(node["along"]),
            up_m=self.shelf.coordinate(node["up"]) if "up" in node else 0.0,
        )

    def _thing_name(self, locale: str, kind: str, node: Node | None) -> str:
        """The name given, or the part's with a number."""
        used = [thing.name for thing in self.things if thing.locale == locale]
        if node is None:
            return next(name for n in range(1, len(used) + 2) if (name := f"{kind}-{n}") not in used)
        if node.text() in used:
            raise node.fail(f"a name that nothing else in {locale} has")
        return node.text()


def _properties(node: Node | None) -> dict[str, Any]:
    if node is None:
        return {}
    for _, item in node.entries():
        if not isinstance(item.value, str | bool | int | float):
            raise item.fail("a text, a number, true or false")
    return dict(node.value)
