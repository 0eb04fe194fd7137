"""Where things are put: tables for one thing, or rows for one part at several places, along a wall or on the floor.

A row is ``["pillar", "north", 15.2, 36.5]`` (along a wall) or ``["desk", [3, 4, 90]]`` (x, y and degrees). A place may
be ``{ from = 4, to = 40, step = 9 }``; a text after a place names the thing there; a table at the end is for all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from world_models.building.geometry.solids import Box
from world_models.files.toml.shared_parts import SharedParts
from world_models.files.toml.source import Node

MAX_PLACES = 1000
"""Largest number of places from one step."""
THING_KEYS = ("part", "boxes", "finish", "name", "wall", "along", "up", "at", "turn", "sigma_cm")
ROW_KEYS = ("finish", "up", "turn", "sigma_cm")


@dataclass(frozen=True, eq=False)
class Placement:
    """One thing at a place.

    Attributes:
        kind: the part's name, or "detail".
        boxes: what it is made of.
        node: where the file places it.
        wall, name: of the wall and of the thing, where given.
        x_m, y_m: its position on the floor, or along the wall (x only).
        turn_deg: its direction on the floor, counter-clockwise.
        up_m: its height on a wall.
        sigma_m: how well its place is known, where the file says so of it.
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
    node.table(place, ("part", "boxes", "finish", "name", "sigma_cm", *(("up",) if against else ("turn",))))
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
    boxes = shared.part(part) if part else shared.read_boxes(options["boxes"], finish)
    if finish and part:
        boxes = tuple(replace(box, finish=finish) for box in boxes)
    return Placement(
        part.text() if part else "detail", boxes, place, None, options.get("name"), 0.0,
        turn_deg=options["turn"].number(-360.0, 360.0) if "turn" in options else 0.0,
        up_m=shared.coordinate(options["up"]) if "up" in options else 0.0,
        sigma_m=0.01 * options["sigma_cm"].number(0.0, 100.0) if "sigma_cm" in options else None,
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
