"""Where things are put: tables for one thing, or rows for one part at several places, along a wall or on the floor.

A row is ``["pillar", "north", 15.2, 36.5]`` (along a wall) or ``["desk", [3, 4, 90]]`` (x, y and degrees). A place may
be ``{ from = 4, to = 40, step = 9 }``; a text after a place names the thing there; a table at the end is for all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from world_models.building.geometry.faces import TEXTURES, UNKNOWN, Finish
from world_models.building.geometry.solids import Box, Range
from world_models.files.toml.source import Node
from world_models.units import FOOT_M

UNITS_M: Mapping[str, float] = {"feet": FOOT_M, "metres": 1.0}
MAX_COORDINATE_M = 10_000.0
MIN_LENGTH_M = 0.001


@dataclass
class SharedParts:
    """Finishes, parts and words of finishes read so far, by name, and the unit of length of the file being read [m]."""

    unit_m: float = 1.0
    finishes: dict[str, Finish] = field(default_factory=dict)
    parts: dict[str, tuple[Box, ...]] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)

    def read(self, root: Node) -> None:
        """Add the finishes and parts of a file, and take its unit; raises WorldError for a name given before."""
        self.unit_m = UNITS_M[root["units"].choice(*UNITS_M)]
        for name, node in root.entries_of("finishes"):
            _check_new(name, node, self.finishes)
            self.finishes[name] = self._read_finish(node)
            self.words[name] = read_words(node)
        for name, node in root.entries_of("parts"):
            _check_new(name, node, self.parts)
            self.parts[name] = self.read_boxes(node, None)

    def _read_finish(self, node: Node) -> Finish:
        node.table(("colour",), ("texture", "scale", "words"))
        if node["colour"].value == "unknown":
            node.table(("colour",), ("words",))
            return UNKNOWN
        red, green, blue = node["colour"].numbers((3,), 0.0, 1.0)
        texture = node["texture"].choice(*TEXTURES) if "texture" in node else "plain"
        scale = self.length(node["scale"], MIN_LENGTH_M, 100.0) if "scale" in node else 0.1
        return Finish((red, green, blue), texture, scale)

    def finish(self, node: Node) -> Finish:
        """The finish that a text names."""
        if not isinstance(node.value, str) or node.value not in self.finishes:
            raise node.fail(f"one of the finishes {', '.join(self.finishes) or '(none)'}")
        return self.finishes[node.value]

    def part(self, node: Node) -> tuple[Box, ...]:
        """The part that a text names."""
        if not isinstance(node.value, str) or node.value not in self.parts:
            raise node.fail(f"one of the parts {', '.join(self.parts) or '(none)'}")
        return self.parts[node.value]

    def read_boxes(self, node: Node, finish: Finish | None) -> tuple[Box, ...]:
        """A list of boxes; ``finish`` is for boxes that name none."""
        return tuple(box for item in node.items(min_count=1) for box in self._read_box(item, finish))

    def _read_box(self, node: Node, finish: Finish | None) -> list[Box]:
        """One box, or five for a box with a rim; with ``twin``, also those mirrored at x = 0."""
        needed = ("x", "y", "z") if finish else ("x", "y", "z", "finish")
        rimmed = ("rim_width",) if "rim" in node.table(needed, ("finish", "rim", "rim_width", "twin")) else ()
        node.table((*needed, *rimmed), ("finish", "rim", "twin"))
        own = self.finish(node["finish"]) if "finish" in node else finish
        assert own is not None
        box = Box(self._read_range(node["x"]), self._read_range(node["y"]), self._read_range(node["z"]), own)
        boxes = self._add_rim(box, node) if rimmed else [box]
        twin = "twin" in node and node["twin"].flag()
        return boxes + [replace(box, x=(-box.x[1], -box.x[0])) for box in boxes if twin]

    def _add_rim(self, box: Box, node: Node) -> list[Box]:
        """A board set into a rim that protrudes by the full depth of the box."""
        rim, width = self.finish(node["rim"]), self.length(node["rim_width"], MIN_LENGTH_M)
        (x0, x1), (y0, y1), (z0, z1) = box.ranges
        if min(x1 - x0, z1 - z0) < 2 * width + MIN_LENGTH_M:
            raise node["rim_width"].fail("a rim that leaves something of the board")
        inside = Box((x0 + width, x1 - width), (y0, y0 + 0.4 * (y1 - y0)), (z0 + width, z1 - width), box.finish)
        rims = [((x0, x1), (z0, z0 + width)), ((x0, x1), (z1 - width, z1)),
                ((x0, x0 + width), inside.z), ((x1 - width, x1), inside.z)]
        return [inside, *(Box(x, box.y, z, rim) for x, z in rims)]

    def _read_range(self, node: Node) -> Range:
        low, high = (value * self.unit_m for value in node.numbers((2,), -self.max_coordinate, self.max_coordinate))
        if high - low < MIN_LENGTH_M:
            raise node.fail(f"a range [low, high] of at least {MIN_LENGTH_M / self.unit_m:g}")
        return low, high

    def length(self, node: Node, low_m: float, high_m: float = MAX_COORDINATE_M) -> float:
        """A length within bounds [m]."""
        return node.number(low_m / self.unit_m, high_m / self.unit_m) * self.unit_m

    def coordinate(self, node: Node) -> float:
        """A coordinate [m]."""
        return node.number(-self.max_coordinate, self.max_coordinate) * self.unit_m

    @property
    def max_coordinate(self) -> float:
        """Largest allowed coordinate, in units of the file."""
        return MAX_COORDINATE_M / self.unit_m


def read_words(node: Node) -> str:
    """What people call what a table describes: a text, or several; nothing where it does not say."""
    if "words" not in node:
        return ""
    words = node["words"]
    return words.text() if isinstance(words.value, str) else ", ".join(item.text() for item in words.items(min_count=1))


def _check_new(name: str, node: Node, known: dict[str, Any]) -> None:
    if name in known:
        raise node.fail("a new name", f"{name!r}, which the world file has already")


MAX_PLACES = 1000
"""Largest number of places from one step."""
THING_KEYS = ("part", "boxes", "finish", "name", "wall", "along", "up", "at", "turn", "sigma_cm", "kind", "words")
ROW_KEYS = ("finish", "up", "turn", "sigma_cm", "kind", "words")


@dataclass(frozen=True, eq=False)
class Placement:
    """One thing at a place.

    Attributes:
        kind: where it is given; else the part's name, or "detail".
        boxes: what it is made of.
        node: where the file places it.
        wall, name: of the wall and of the thing, where given.
        x_m, y_m: its position on the floor, or along the wall (x only).
        turn_deg: its direction on the floor, counter-clockwise.
        up_m: its height on a wall.
        sigma_m: how well its place is known, where the file says so of it.
        words: what people call it.
    """

    kind: str
    boxes: tuple[Box, ...]
    node: Node
    wall: Node | None
    name: Node | None
    x_m: float
    y_m: float = 0.0
    turn_deg: float = 0.0
    up_m: float = 0.0
    sigma_m: float | None = None
    words: str = ""


def read_placements(node: Node, shared: SharedParts) -> list[Placement]:
    """The things of one element of ``things``: a table or a row."""
    if isinstance(node.value, list):
        return list(_read_row(node, shared))
    return [_read_table(node, shared)]


def read_coordinates(node: Node, shared: SharedParts) -> list[float]:
    """One coordinate, several, or those of a step [m]."""
    if isinstance(node.value, list):
        return [along for item in node.items(min_count=1) for along in read_coordinates(item, shared)]
    if isinstance(node.value, dict):
        return _read_steps(node, shared)
    return [shared.coordinate(node)]


def _read_steps(node: Node, shared: SharedParts) -> list[float]:
    node.table(("from", "to", "step"))
    start, end = shared.coordinate(node["from"]), shared.coordinate(node["to"])
    step = shared.length(node["step"], 0.01)
    count = int((end - start) / step + 1e-6) + 1
    if not 1 <= count <= MAX_PLACES:
        raise node.fail(f"1 to {MAX_PLACES} places from the first to the last", f"{max(count, 0)}")
    return [start + i * step for i in range(count)]


def _read_table(node: Node, shared: SharedParts) -> Placement:
    against = "wall" in node.table((), THING_KEYS)
    place = ("wall", "along") if against else ("at",)
    own = ("part", "boxes", "finish", "name", "sigma_cm", "kind", "words")
    node.table(place, (*own, "up" if against else "turn"))
    if ("part" in node) == ("boxes" in node):
        raise node.fail("either a part or boxes", "both" if "part" in node else "neither")
    thing = _read_thing(node, node.get("part"), node, shared)
    if against:
        return replace(thing, wall=node["wall"], x_m=shared.coordinate(node["along"]))
    x, y = _read_point(node["at"], (2,), shared)
    return replace(thing, x_m=x, y_m=y)


def _read_thing(place: Node, part: Node | None, options: Node, shared: SharedParts) -> Placement:
    """A thing without its position yet."""
    finish = shared.finish(options["finish"]) if "finish" in options else None
    kind = options.get("kind") or part
    boxes = shared.part(part) if part else shared.read_boxes(options["boxes"], finish)
    if finish and part:
        boxes = tuple(replace(box, finish=finish) for box in boxes)
    return Placement(
        kind.text() if kind else "detail", boxes, place, None, options.get("name"), 0.0,
        turn_deg=options["turn"].number(-360.0, 360.0) if "turn" in options else 0.0,
        up_m=shared.coordinate(options["up"]) if "up" in options else 0.0,
        sigma_m=0.01 * options["sigma_cm"].number(0.0, 100.0) if "sigma_cm" in options else None,
        words=read_words(options),
    )


def _read_row(node: Node, shared: SharedParts) -> Iterator[Placement]:
    items = node.items(min_count=2)
    options = Node({}, node.key, node.source)
    if isinstance(items[-1].value, dict) and "from" not in items[-1]:
        options = items.pop().table(optional=ROW_KEYS)
    part, *rest = items
    wall = rest.pop(0) if rest and isinstance(rest[0].value, str) else None
    if not rest:
        raise node.fail("a part, a wall or none, and at least one place")
    thing = replace(_read_thing(node, part, options, shared), wall=wall)
    while rest:
        place = rest.pop(0)
        name = rest.pop(0) if rest and isinstance(rest[0].value, str) else None
        placed = list(_place_on_wall(thing, place, shared) if wall else _place_on_floor(thing, place, shared))
        if name and len(placed) > 1:
            raise name.fail("a name for one thing", f"it for {len(placed)}")
        yield from (replace(one, node=place, name=name) for one in placed)


def _place_on_wall(thing: Placement, place: Node, shared: SharedParts) -> Iterator[Placement]:
    if isinstance(place.value, list):
        raise place.fail("a number along the wall, or { from = .., to = .., step = .. }")
    return (replace(thing, x_m=along) for along in read_coordinates(place, shared))


def _place_on_floor(thing: Placement, place: Node, shared: SharedParts) -> Iterator[Placement]:
    """At [x, y] or [x, y, degrees], or from one point to another in about equal steps."""
    if isinstance(place.value, dict):
        place.table(("from", "to", "step"))
        (ax, ay), (bx, by) = (_read_point(place[end], (2,), shared) for end in ("from", "to"))
        length = ((bx - ax) ** 2 + (by - ay) ** 2) ** 0.5
        count = max(1, round(length / shared.length(place["step"], 0.01)))
        if count > MAX_PLACES:
            raise place.fail(f"at most {MAX_PLACES} places from the first to the last", f"{count}")
        fractions = [i / count for i in range(count + 1)]
        return (replace(thing, x_m=ax + t * (bx - ax), y_m=ay + t * (by - ay)) for t in fractions)
    x, y, *turn = _read_point(place, (2, 3), shared)
    return iter((replace(thing, x_m=x, y_m=y, turn_deg=turn[0] if turn else thing.turn_deg),))


def _read_point(node: Node, counts: tuple[int, ...], shared: SharedParts) -> tuple[float, ...]:
    """(x, y) [m], with the direction [degrees] where a third number is allowed and given."""
    x, y, *turn = node.numbers(counts, -shared.max_coordinate, shared.max_coordinate)
    if turn and not -360.0 <= turn[0] <= 360.0:
        raise node[2].fail("degrees from -360 to 360")
    return x * shared.unit_m, y * shared.unit_m, *turn
