"""A floor plan of the world as a drawing: rooms, doors, furniture and names, storeys side by side."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face
from world_models.building.locales import STEP_M
from world_models.building.world import World

SCALE = 40.0
"""SVG units per metre."""

MARGIN_M = 0.6
TITLE_M = 0.9
LEGEND: Mapping[str, str] = {
    "doorway": "doorway", "leaf": "door that is shut", "obstacle": "stands on the floor", "board": "on the wall",
    "paving": "on the floor", "outdoors": "outdoors", "link": "elevator or stairs", "axis": "origin and x of a frame"}
"""What is said of a kind, where it is drawn."""
DOOR_NAME_M = 0.25
"""So far within the first of its rooms a doorway's name is written."""
LEGEND_M = 0.5
"""Height of a line of the legend."""
SCALE_BARS_M = (1, 2, 5, 10, 20, 50, 100)
MAX_STOREY_STEP_M = 0.5
"""Rooms whose floors differ by no more are drawn as one storey."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape of the drawing.

    Attributes:
        kind: outdoors, room, obstacle, board, paving, doorway, leaf, link, axis, mark (scale, north); of what is
            written: name, title, door-name, note.
        points: (k, 2) on the drawing [m], x to the right and y up.
        text: its label.
    """

    kind: str
    points: Floats
    text: str = ""


@dataclass(frozen=True, eq=False)
class Drawing:
    """A drawing of ``size`` (2,) width, height [m]; shapes from the bottom up."""

    size: Floats
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, eq=False)
class DrawnStorey:
    """A storey as it is drawn by itself.

    Attributes:
        rooms: whose floors are at its height.
        origin: (2,) the point of the world frame that is 0, 0 on the drawing [m].
        drawing: north is up.
    """

    rooms: tuple[str, ...]
    origin: Floats
    drawing: Drawing


def draw_storeys(world: World) -> list[DrawnStorey]:
    """Each storey by itself, from the lowest."""
    storeys = find_storeys(world)
    return [_draw_panel(world, floor_m, rooms, len(storeys) > 1) for floor_m, rooms in storeys]


def build_drawing(world: World) -> Drawing:
    """All storeys on one page, from the lowest; north is up."""
    panels = [storey.drawing for storey in draw_storeys(world)]
    columns = math.ceil(math.sqrt(len(panels)))
    rows = [panels[i : i + columns] for i in range(0, len(panels), columns)]
    heights = [max(float(panel.size[1]) for panel in row) for row in rows]
    shapes: list[Shape] = []
    top = math.fsum(heights)
    for row, height in zip(rows, heights, strict=True):
        left = 0.0
        for panel in row:
            corner = np.array([left, top - panel.size[1]])
            shapes += [Shape(s.kind, s.points + corner, s.text) for s in panel.shapes]
            left += float(panel.size[0])
        top -= height
    width = max(math.fsum(float(panel.size[0]) for panel in row) for row in rows)
    legend = _list_legend({shape.kind for shape in shapes})
    foot_m = LEGEND_M * len(legend)
    raised = (Shape(s.kind, s.points + np.array([0.0, foot_m]), s.text) for s in shapes)
    size = np.array([width, math.fsum(heights) + foot_m])
    return Drawing(size, (*raised, *(shape for line in legend for shape in line)))


def _list_legend(kinds: Collection[str]) -> list[list[Shape]]:
    """A sign and its words for each kind that is drawn, line by line from the bottom."""
    shown = [(kind, text) for kind, text in LEGEND.items() if kind in kinds]
    lines = []
    for number, (kind, text) in enumerate(reversed(shown)):
        low, high = LEGEND_M * number + 0.1, LEGEND_M * number + 0.35
        corners = [(MARGIN_M, low), (MARGIN_M + 0.5, low), (MARGIN_M + 0.5, high), (MARGIN_M, high)]
        sign = [(MARGIN_M, (low + high) / 2.0), (MARGIN_M + 0.5, (low + high) / 2.0)]
        points = sign[:1] if kind == "link" else sign if kind in ("leaf", "axis") else corners
        lines.append([Shape(kind, np.array(points)), Shape("note", np.array([(MARGIN_M + 0.7, low)]), text)])
    return lines


def _draw_panel(world: World, floor_m: float, rooms: list[str], titled: bool) -> DrawnStorey:
    """One storey, its south-west corner at 0, 0."""
    corners = np.concatenate([world.outline(name) for name in rooms])
    low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
    width, height = high - low
    shapes = [Shape(s.kind, s.points - low, s.text) for s in _draw_storey(world, rooms)]
    if titled:
        text = f"{_title_of(world, rooms)}, floor at {floor_m:.2f} m"
        shapes.append(Shape("title", np.array([[width / 2, height + TITLE_M / 3]]), text))
    shapes += _draw_marks(float(width))
    size = np.array([width, height + (TITLE_M if titled else 0.0)])
    return DrawnStorey(tuple(rooms), low, Drawing(size, tuple(shapes)))


def _draw_marks(width: float) -> Iterator[Shape]:
    """A scale and an arrow to the north (the y axis of the world), in the lower margin."""
    bar_m = max([length for length in SCALE_BARS_M if length <= width / 4.0], default=1)
    yield Shape("mark", np.array([(MARGIN_M, 0.3), (MARGIN_M, 0.2), (MARGIN_M + bar_m, 0.2), (MARGIN_M + bar_m, 0.3)]))
    yield Shape("note", np.array([(MARGIN_M + bar_m + 0.15, 0.15)]), f"{bar_m} m")
    x = width - 0.25
    yield Shape("mark", np.array([(x, 0.1), (x, 0.55), (x - 0.1, 0.4), (x, 0.55), (x + 0.1, 0.4)]))
    yield Shape("note", np.array([(x - 0.4, 0.15)]), "N")


def find_storeys(world: World) -> list[tuple[float, list[str]]]:
    """Rooms by the height of their floors, in order."""
    out: list[tuple[float, list[str]]] = []
    for floor_m, name in sorted((world.floor_m(name), name) for name in world.rooms):
        if not out or floor_m - out[-1][0] > MAX_STOREY_STEP_M:
            out.append((floor_m, []))
        out[-1][1].append(name)
    return [(floor_m, [name for name in world.rooms if name in rooms]) for floor_m, rooms in out]


def _title_of(world: World, rooms: list[str]) -> str:
    """Name of the locale that most of the rooms are in."""
    parents = [world.locale(name).parent or world.root for name in rooms]
    return max(dict.fromkeys(parents), key=parents.count)


def _draw_storey(world: World, rooms: list[str]) -> Iterator[Shape]:
    for name in rooms:
        kind = "outdoors" if world.locale(name).properties.get("sky") else "room"
        yield Shape(kind, world.outline(name), name)
    for name in rooms:
        for thing in world.things_of(name):
            flat = "paving" if thing.protrusion_m is None and thing.high_m <= STEP_M else "board"
            yield Shape("obstacle" if thing.is_obstacle else flat, thing.footprint_world, thing.name)
    doorways = {doorway.name: doorway for name in rooms for doorway in world.doorways_of(name)}
    for doorway in doorways.values():
        yield Shape("doorway", doorway.thresholds_world.reshape(-1, 2), doorway.name)
        foot = doorway.threshold_of(doorway.between[0]).mean(axis=0)
        inwards = foot - doorway.centre_world[:2]
        inwards *= DOOR_NAME_M / max(float(np.hypot(*inwards)), 1e-9)
        yield Shape("door-name", (foot + inwards)[None], doorway.name)
    for name in rooms:
        for face in world.faces_of(name):
            if face.name.endswith(("/leaf", "/shut")):
                yield Shape("leaf", _footprint(face), face.name)
        for link in world.links_of(name):
            yield Shape("link", link.stop_of(name)[None, :2], f"{link.name} to {link.other(name)}")
    for name in rooms:
        yield Shape("axis", world.world_from_locale(name).apply([(0, 0, 0), (1, 0, 0)])[:, :2])
        yield Shape("name", world.outline(name).mean(axis=0)[None], name)


def _footprint(face: Face) -> Floats:
    """(2, 2) the line on the plan of an upright polygon [m]."""
    xy = face.polygon_world[:, :2]
    far = np.linalg.norm(xy - xy[0], axis=1).argmax()
    return np.stack([xy[0], xy[far]])


def plan_svg(world: World) -> str:
    """The floor plan as an SVG text, 40 units per metre."""
    return drawing_svg(build_drawing(world))


def drawing_svg(drawing: Drawing, more: str = "") -> str:
    """A drawing as an SVG text, 40 units per metre, y down; ``more`` is drawn over it."""
    width, height = drawing.size * SCALE
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}"'
            f' viewBox="0 0 {width:.0f} {height:.0f}">')
    ground = f'<rect width="{width:.0f}" height="{height:.0f}" fill="{GROUND}"/>'
    shapes = (_svg_element(shape, height) for shape in drawing.shapes)
    return "\n".join([head, _STYLE, ground, *shapes, *([more] if more else []), "</svg>\n"])


WRITTEN = frozenset(("name", "title", "door-name", "note"))
"""Kinds of shapes that are a text at a point."""
GROUND = "#777"
_STYLE = """<style>
.room { fill: #f7f4ea; stroke: #222; stroke-width: 2 } .outdoors { fill: #b9cf9d; stroke: #3c5a2c; stroke-width: 2 }
.obstacle { fill: #c9a676; stroke: #5b4327 } .board { fill: #6d8fb3; stroke: #34516f }
.paving { fill: #e3ded0; stroke: #8a8678 } .doorway { fill: #bfe3b4; stroke: #3c7a2c }
.leaf { stroke: #8c1d1d; stroke-width: 5; fill: none }
.link { fill: #7d4fa3; stroke: #3f2756 }
.axis { stroke: #b03030; stroke-width: 2; fill: none } text { font: 16px sans-serif; text-anchor: middle; fill: #222 }
text.title { font-size: 20px; font-weight: bold; fill: #fff } text.door-name { font-size: 9px }
text.note { font-size: 12px; text-anchor: start; fill: #fff } .mark { stroke: #fff; stroke-width: 2; fill: none }
</style>"""


def _svg_element(shape: Shape, height: float) -> str:
    xy = np.column_stack([shape.points[:, 0] * SCALE, height - shape.points[:, 1] * SCALE])
    x, y = xy[0]
    if shape.kind in WRITTEN:
        return f'<text class="{shape.kind}" x="{x:.1f}" y="{y:.1f}">{escape(shape.text)}</text>'
    named = f"<title>{escape(shape.text)}</title>" if shape.text else ""
    if shape.kind == "link":
        return f'<circle class="link" cx="{x:.1f}" cy="{y:.1f}" r="9">{named}</circle>'
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in xy)
    tag = "polyline" if shape.kind in ("axis", "leaf", "mark") else "polygon"
    return f'<{tag} class="{shape.kind}" points="{points}">{named}</{tag}>'
