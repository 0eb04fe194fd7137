"""Reading a world from TOML that a person can write; see ``worlds/research_center.toml`` for an annotated one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.blueprint import Blueprint, DoorSpec, LocaleSpec, RoomLook, ThingSpec
from world_models.builder import build_world
from world_models.frames import Pose
from world_models.geometer import Box, Range
from world_models.locales import distance_to_border
from world_models.regions import TEXTURES, Finish
from world_models.toml_source import Node, Source, WorldError
from world_models.world import World

__all__ = ["WORLDS", "WorldError", "load_world", "read_world"]

WORLDS = Path(__file__).parent / "worlds"
"""Where the worlds that come with the project are kept."""

UNITS_M = {"feet": 0.3048, "metres": 1.0}
FARTHEST_M = 10_000.0
SMALLEST_M = 0.001
RECTANGLE_WALLS = ("south", "east", "north", "west")
FINISH_KEYS = ("walls", "floor", "ceiling", "baseboard", "moulding", "frame", "leaf", "threshold")
DEFAULT_KEYS = (*FINISH_KEYS, "height", "door_width", "door_height")


def load_world(path: str | PathLike[str], *, details: Sequence[str | PathLike[str]] = ()) -> World:
    """The world described by a TOML file.

    Args:
        path: the world file.
        details: further files that add parts, finishes and things (no rooms or doors).

    Raises:
        WorldError: a file cannot be read or does not describe a world; names file, line, what was expected and came.
    """
    return read_world(Source.read(Path(path)), [Source.read(Path(detail)) for detail in details])


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
    unit_m: float = 1.0
    name: str = ""
    finishes: dict[str, Finish] = field(default_factory=dict)
    parts: dict[str, tuple[Box, ...]] = field(default_factory=dict)
    defaults: dict[str, Node] = field(default_factory=dict)
    locales: dict[str, LocaleSpec] = field(default_factory=dict)
    doors: list[DoorSpec] = field(default_factory=list)
    things: list[ThingSpec] = field(default_factory=list)

    def blueprint(self) -> Blueprint:
        return Blueprint(self.name, f"{self.base.name}:1", self.locales, tuple(self.doors), tuple(self.things))

    # -- files -----------------------------------------------------------------------------------------------------

    def read_base(self, root: Node) -> None:
        root.table(("name", "units", "locales"), ("finishes", "parts", "defaults", "doors"))
        self.name = root["name"].text()
        self._read_shared(root)
        if defaults := root.get("defaults"):
            self.defaults = dict(defaults.table(optional=DEFAULT_KEYS).entries())
        for name, node in root["locales"].entries():
            self.locales[name] = self._locale(name, node)
        self._check_hierarchy(root["locales"])
        for name, node in root["locales"].entries():
            self._read_things(name, node)
        for name, node in doors.entries() if (doors := root.get("doors")) else ():
            self.doors.append(self._door(name, node))

    def read_details(self, root: Node) -> None:
        root.table(("units", "locales"), ("finishes", "parts"))
        self._read_shared(root)
        for name, node in root["locales"].entries():
            node.table(("things",))
            if name not in self.locales:
                raise node.fail(f"one of the locales {', '.join(self.locales)}", repr(name))
            self._read_things(name, node)

    def _read_shared(self, root: Node) -> None:
        """Units, finishes and parts; names may not be given twice."""
        self.unit_m = UNITS_M[root["units"].choice(*UNITS_M)]
        for name, node in finishes.entries() if (finishes := root.get("finishes")) else ():
            _only_once(name, node, self.finishes)
            self.finishes[name] = self._finish(node)
        for name, node in parts.entries() if (parts := root.get("parts")) else ():
            _only_once(name, node, self.parts)
            self.parts[name] = self._boxes(node, None)

    # -- appearances and parts ---------------------------------------------------------------------------------------

    def _finish(self, node: Node) -> Finish:
        node.table(("colour",), ("texture", "scale"))
        red, green, blue = node["colour"].numbers((3,), 0.0, 1.0)
        texture = node["texture"].choice(*TEXTURES) if "texture" in node else "plain"
        scale = self._length(node["scale"], SMALLEST_M, 100.0) if "scale" in node else 0.1
        return Finish((red, green, blue), texture, scale)

    def _named_finish(self, node: Node) -> Finish:
        if node.value not in self.finishes if isinstance(node.value, str) else True:
            raise node.fail(f"one of the finishes {', '.join(self.finishes) or '(none)'}")
        return self.finishes[node.value]

    def _boxes(self, node: Node, finish: Finish | None) -> tuple[Box, ...]:
        return tuple(box for item in node.items(least=1) for box in self._box(item, finish))

    def _box(self, node: Node, finish: Finish | None) -> list[Box]:
        """One box; five for one with a rim; those again on the other side of x = 0 where ``twin`` is set."""
        needed = ("x", "y", "z") if finish else ("x", "y", "z", "finish")
        rimmed = ("rim_width",) if "rim" in node.table(needed, ("finish", "rim", "rim_width", "twin")) else ()
        node.table((*needed, *rimmed), ("finish", "rim", "twin"))
        own = self._named_finish(node["finish"]) if "finish" in node else finish
        assert own is not None
        box = Box(self._range(node["x"]), self._range(node["y"]), self._range(node["z"]), own)
        boxes = self._with_rim(box, node) if rimmed else [box]
        twin = "twin" in node and node["twin"].flag()
        return boxes + [replace(box, x=(-box.x[1], -box.x[0])) for box in boxes if twin]

    def _with_rim(self, box: Box, node: Node) -> list[Box]:
        """A board set into a rim that stands out to the full depth of the box."""
        rim, width = self._named_finish(node["rim"]), self._length(node["rim_width"], SMALLEST_M)
        (x0, x1), (y0, y1), (z0, z1) = box.ranges
        if min(x1 - x0, z1 - z0) < 2 * width + SMALLEST_M:
            raise node["rim_width"].fail("a rim that leaves something of the board")
        inside = Box((x0 + width, x1 - width), (y0, y0 + 0.4 * (y1 - y0)), (z0 + width, z1 - width), box.finish)
        rims = [((x0, x1), (z0, z0 + width)), ((x0, x1), (z1 - width, z1)),
                ((x0, x0 + width), inside.z), ((x1 - width, x1), inside.z)]
        return [inside, *(Box(x, box.y, z, rim) for x, z in rims)]

    def _range(self, node: Node) -> Range:
        low, high = (value * self.unit_m for value in node.numbers((2,), -self._far, self._far))
        if high - low < SMALLEST_M:
            raise node.fail(f"a range [low, high] of at least {SMALLEST_M / self.unit_m:g}")
        return low, high

    def _length(self, node: Node, low_m: float, high_m: float = FARTHEST_M) -> float:
        return node.number(low_m / self.unit_m, high_m / self.unit_m) * self.unit_m

    @property
    def _far(self) -> float:
        return FARTHEST_M / self.unit_m

    # -- locales -----------------------------------------------------------------------------------------------------

    def _locale(self, name: str, node: Node) -> LocaleSpec:
        node.table(("kind",), ("in", "at", "turn", "size", "outline", "height", "walls", "floor", "ceiling", "baseboard",
                               "moulding", "things", "properties"))
        if name == self.name:
            raise node.fail("a name other than that of the whole world", repr(name))
        outline, names = self._outline(node)
        height = self._given(node, "height")
        return LocaleSpec(
            name, node["kind"].text(), node["in"].text() if "in" in node else self.name,
            self._placed(node, 3), outline, names,
            self._length(height, 0.1, 1000.0) if height else 2.7,
            self._look(node, names), _properties(node.get("properties")), node.where,
        )

    def _outline(self, node: Node) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
        if "size" in node and "outline" in node:
            raise node["outline"].fail("either size or outline", "both")
        if "size" in node:
            low = 0.1 / self.unit_m
            width, depth = (v * self.unit_m for v in node["size"].numbers((2,), low, self._far))
            return np.array([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)]), RECTANGLE_WALLS
        if "outline" in node:
            corners = [item.numbers((2,), -self._far, self._far) for item in node["outline"].items(least=3)]
            outline = np.array(corners) * self.unit_m
            if not _is_simple(outline):
                raise node["outline"].fail("corners that go round a room counter-clockwise without crossing or doubling")
            return outline, tuple(f"side-{index}" for index in range(len(outline)))
        return None, ()

    def _look(self, node: Node, wall_names: Sequence[str]) -> RoomLook:
        walls = self._given(node, "walls")
        if walls is not None and isinstance(walls.value, dict):
            walls.table(tuple(wall_names))
            finishes = {name: self._named_finish(walls[name]) for name in wall_names}
        else:
            finishes = {name: self._finish_or(walls, Finish((0.8, 0.8, 0.76))) for name in wall_names}
        boards = [self._given(node, key) for key in ("baseboard", "moulding")]
        return RoomLook(
            finishes,
            self._finish_or(self._given(node, "floor"), Finish((0.5, 0.5, 0.5))),
            self._finish_or(self._given(node, "ceiling"), Finish((0.9, 0.9, 0.9))),
            *(self._named_finish(board) if board else None for board in boards),
        )

    def _given(self, node: Node, key: str) -> Node | None:
        """The value of a key of this table, or else of the defaults."""
        return node.get(key) or self.defaults.get(key)

    def _finish_or(self, node: Node | None, otherwise: Finish) -> Finish:
        return self._named_finish(node) if node else otherwise

    def _placed(self, node: Node, dimensions: int = 2) -> Pose:
        """The frame given by ``at`` (x, y[, z]) and ``turn`` (degrees, counter-clockwise)."""
        counts = tuple(range(2, dimensions + 1))
        at = node["at"].numbers(counts, -self._far, self._far) if "at" in node else (0.0, 0.0)
        turn = math.radians(node["turn"].number(-360.0, 360.0)) if "turn" in node else 0.0
        c, s = (round(value, 15) for value in (math.cos(turn), math.sin(turn)))
        x, y, z = (*at, 0.0)[:3]
        return Pose(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([x, y, z]) * self.unit_m)

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
            node["along"].number(-self._far, self._far) * self.unit_m,
            self._length(width, 0.1, 20.0) if width else 0.9, self._length(height, 0.1, 20.0) if height else 2.0,
            is_open, frame, leaf, threshold, self._part(node["panel"]) if "panel" in node else (), node.where,
        )

    def _room(self, node: Node) -> str:
        rooms = [name for name, spec in self.locales.items() if spec.outline is not None]
        return node.choice(*rooms)

    def _wall(self, node: Node, room: str) -> str:
        return node.choice(*self.locales[room].wall_names)

    def _part(self, node: Node) -> tuple[Box, ...]:
        if not isinstance(node.value, str) or node.value not in self.parts:
            raise node.fail(f"one of the parts {', '.join(self.parts) or '(none)'}")
        return self.parts[node.value]

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
        finish = self._named_finish(node["finish"]) if "finish" in node else None
        boxes = self._part(node["part"]) if "part" in node else self._boxes(node["boxes"], finish)
        if finish and "part" in node:
            boxes = tuple(replace(box, finish=finish) for box in boxes)
        spec = ThingSpec(self._thing_name(locale, kind, node.get("name")), locale, kind, boxes, node.where)
        if not against:
            return replace(spec, locale_from_part=self._placed(node))
        return replace(
            spec, wall=self._wall(node["wall"], locale), along_m=node["along"].number(-self._far, self._far) * self.unit_m,
            up_m=node["up"].number(-self._far, self._far) * self.unit_m if "up" in node else 0.0,
        )

    def _thing_name(self, locale: str, kind: str, node: Node | None) -> str:
        """The name given, or the part's with a number."""
        used = [thing.name for thing in self.things if thing.locale == locale]
        if node is None:
            return next(name for n in range(1, len(used) + 2) if (name := f"{kind}-{n}") not in used)
        if node.text() in used:
            raise node.fail(f"a name that nothing else in {locale} has")
        return node.text()


def _only_once(name: str, node: Node, known: dict[str, Any]) -> None:
    if name in known:
        raise node.fail("a new name", f"{name!r}, which the world file has already")


def _properties(node: Node | None) -> dict[str, Any]:
    if node is None:
        return {}
    for _, item in node.entries():
        if not isinstance(item.value, str | bool | int | float):
            raise item.fail("a text, a number, true or false")
    return dict(node.value)


def _is_simple(outline: NDArray[np.float64]) -> bool:
    """Whether a polygon (k, 2) is counter-clockwise, with sides of 1 cm and more that meet only in their corners."""
    ahead = np.roll(outline, -1, axis=0)
    area = 0.5 * float(np.sum(outline[:, 0] * ahead[:, 1] - outline[:, 1] * ahead[:, 0]))
    if area < 1e-4 or np.linalg.norm(ahead - outline, axis=1).min() < 0.01:
        return False
    k = len(outline)
    for i in range(k):
        for j in range(i + 1, k):
            apart = j - i > 1 and (i, j) != (0, k - 1)
            if apart and _touch(outline[i], ahead[i], outline[j], ahead[j]):
                return False
    return all(distance_to_border(outline[i], np.stack([outline[i - 2], outline[i - 1]])) > 1e-3 for i in range(k))


def _touch(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64]) -> bool:
    """Whether two segments come nearer than 1 mm."""
    def side(p: NDArray[np.float64], q: NDArray[np.float64], r: NDArray[np.float64]) -> float:
        u, v = q - p, r - p
        return float(u[0] * v[1] - u[1] * v[0])

    if side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0:
        return True
    pairs = ((a, c, d), (b, c, d), (c, a, b), (d, a, b))
    return min(distance_to_border(p, np.stack([q, r])) for p, q, r in pairs) < 1e-3
