"""Where things are put: a table for each, or rows of the same part, at several places, along a wall or on the floor.

A row is ``["pillar", "north", 15.2, 36.5]`` (along a wall) or ``["desk", [3, 4, 90]]`` (x, y and degrees). A place may
be ``{ from = 4, to = 40, step = 9 }``; a text behind a place names what stands there; a table at the end holds for all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from world_models.building.solids import Box
from world_models.files.toml.shared_parts import Shelf
from world_models.files.toml.source import Node

MOST = 1000
"""More of one thing are not meant."""
THING_KEYS = ("part", "boxes", "finish", "name", "wall", "along", "up", "at", "turn")
ROW_KEYS = ("finish", "up", "turn")


@dataclass(frozen=True, eq=False)
class Placement:
    """One thing, put somewhere.

    Attributes:
        kind: the part's name, or "detail"; boxes: what it is made of.
        node: where the file says so; wall, name: of the wall and the thing, where given.
        x_m, y_m: its place on the floor, or how far along the wall (x).
        turn_deg: on the floor, counter-clockwise; up_m: on a wall.
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


def placements(node: Node, shelf: Shelf) -> list[Placement]:
    """The things that one element of ``things`` stands for."""
    if isinstance(node.value, list):
        return list(_row(node, shelf))
    return [_single(node, shelf)]


def several(node: Node, shelf: Shelf) -> list[float]:
    """One coordinate [m], several, or those of a step."""
    if isinstance(node.value, list):
        return [along for item in node.items(least=1) for along in several(item, shelf)]
    if isinstance(node.value, dict):
        return _steps(node, shelf)
    return [shelf.coordinate(node)]


def _steps(node: Node, shelf: Shelf) -> list[float]:
    node.table(("from", "to", "step"))
    start, end = shelf.coordinate(node["from"]), shelf.coordinate(node["to"])
    step = shelf.length(node["step"], 0.01)
    count = int((end - start) / step + 1e-6) + 1
    if not 1 <= count <= MOST:
        raise node.fail(f"1 to {MOST} places from the first to the last", f"{max(count, 0)}")
    return [start + i * step for i in range(count)]


def _single(node: Node, shelf: Shelf) -> Placement:
    against = "wall" in node.table((), THING_KEYS)
    place = ("wall", "along") if against else ("at",)
    node.table(place, ("part", "boxes", "finish", "name", *(("up",) if against else ("turn",))))
    if ("part" in node) == ("boxes" in node):
        raise node.fail("either a part or boxes", "both" if "part" in node else "neither")
    made = _made(node, node.get("part"), node, shelf)
    if against:
        return replace(made, wall=node["wall"], x_m=shelf.coordinate(node["along"]))
    x, y = (value * shelf.unit_m for value in node["at"].numbers((2,), -shelf.far, shelf.far))
    return replace(made, x_m=x, y_m=y)


def _made(place: Node, part: Node | None, options: Node, shelf: Shelf) -> Placement:
    """A thing that is nowhere yet."""
    finish = shelf.finish(options["finish"]) if "finish" in options else None
    boxes = shelf.part(part) if part else shelf.boxes(options["boxes"], finish)
    if finish and part:
        boxes = tuple(replace(box, finish=finish) for box in boxes)
    return Placement(
        part.text() if part else "detail", boxes, place, None, options.get("name"), 0.0,
        turn_deg=options["turn"].number(-360.0, 360.0) if "turn" in options else 0.0,
        up_m=shelf.coordinate(options["up"]) if "up" in options else 0.0,
    )


def _row(node: Node, shelf: Shelf) -> Iterator[Placement]:
    items = node.items(least=2)
    options = Node({}, node.key, node.source)
    if isinstance(items[-1].value, dict) and "from" not in items[-1]:
        options = items.pop().table(optional=ROW_KEYS)
    part, *rest = items
    wall = rest.pop(0) if rest and isinstance(rest[0].value, str) else None
    if not rest:
        raise node.fail("a part, a wall or none, and at least one place")
    made = replace(_made(node, part, options, shelf), wall=wall)
    while rest:
        place = rest.pop(0)
        name = rest.pop(0) if rest and isinstance(rest[0].value, str) else None
        found = list(_on_wall(made, place, shelf) if wall else _on_floor(made, place, shelf))
        if name and len(found) > 1:
            raise name.fail("a name for one thing", f"it for {len(found)}")
        yield from (replace(one, node=place, name=name) for one in found)


def _on_wall(made: Placement, place: Node, shelf: Shelf) -> Iterator[Placement]:
    if isinstance(place.value, list):
        raise place.fail("a number along the wall, or { from = .., to = .., step = .. }")
    return (replace(made, x_m=along) for along in several(place, shelf))


def _on_floor(made: Placement, place: Node, shelf: Shelf) -> Iterator[Placement]:
    """At [x, y] or [x, y, degrees], or from one point to another in about equal steps."""
    if isinstance(place.value, dict):
        place.table(("from", "to", "step"))
        (ax, ay), (bx, by) = (_point(place[end], (2,), shelf)[:2] for end in ("from", "to"))
        length = ((bx - ax) ** 2 + (by - ay) ** 2) ** 0.5
        count = max(1, round(length / shelf.length(place["step"], 0.01)))
        if count > MOST:
            raise place.fail(f"at most {MOST} places from the first to the last", f"{count}")
        parts = [i / count for i in range(count + 1)]
        return (replace(made, x_m=ax + t * (bx - ax), y_m=ay + t * (by - ay)) for t in parts)
    x, y, *turn = _point(place, (2, 3), shelf)
    return iter((replace(made, x_m=x, y_m=y, turn_deg=turn[0] if turn else made.turn_deg),))


def _point(node: Node, counts: tuple[int, ...], shelf: Shelf) -> tuple[float, ...]:
    x, y, *turn = node.numbers(counts, -shelf.far, shelf.far)
    if turn and not -360.0 <= turn[0] <= 360.0:
        raise node[2].fail("degrees from -360 to 360")
    return x * shelf.unit_m, y * shelf.unit_m, *turn
