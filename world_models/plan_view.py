"""A plan of the world as a drawing: rooms, doors, furniture and the names of locales, for people."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.world import World

SCALE = 40.0
"""Drawing units in a metre."""

MARGIN_M = 0.6


def plan_svg(world: World) -> str:
    """The plan as an SVG text: north is up, one metre is 40 units."""
    corners = np.concatenate([world.outline(name) for name in world.rooms])
    low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
    width, height = (high - low) * SCALE
    paper = _Paper(low, high)
    shapes = [paper.polygon(world.outline(name), "room") for name in world.rooms]
    for thing in world.things:
        shapes.append(paper.polygon(thing.footprint_world, "obstacle" if thing.in_the_way else "board", thing.name))
    for doorway in world.doorways:
        near, far = doorway.thresholds_world
        shapes.append(paper.polygon(np.concatenate([near, far]), "doorway", doorway.name))
    shapes += [paper.polygon(_footprint(face.polygon_world), "leaf", face.name)
               for face in world.faces if face.name.endswith("/leaf")]
    for name in world.rooms:
        shapes += [paper.frame(world, name), paper.text(world.outline(name).mean(axis=0), name)]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}">'
    ground = f'<rect width="{width:.0f}" height="{height:.0f}" fill="#777"/>'
    return "\n".join([head, _STYLE, ground, *shapes, "</svg>\n"])


_STYLE = """<style>
.room { fill: #f7f4ea; stroke: #222; stroke-width: 2 }
.obstacle { fill: #c9a676; stroke: #5b4327 } .board { fill: #6d8fb3; stroke: #34516f }
.doorway { fill: #bfe3b4; stroke: #3c7a2c } .leaf { stroke: #8c1d1d; stroke-width: 5; fill: none }
.axis { stroke: #b03030; stroke-width: 2 } text { font: 16px sans-serif; text-anchor: middle; fill: #222 }
</style>"""


class _Paper:
    """Where the metres of the world lie on the drawing."""

    def __init__(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        self._low, self._high = low, high

    def _at(self, points: Any) -> str:
        xy = np.atleast_2d(np.asarray(points, float))[:, :2]
        flipped = np.column_stack([xy[:, 0] - self._low[0], self._high[1] - xy[:, 1]]) * SCALE
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in flipped)

    def polygon(self, points: Any, kind: str, title: str = "") -> str:
        named = f"<title>{escape(title)}</title>" if title else ""
        return f'<polygon class="{kind}" points="{self._at(points)}">{named}</polygon>'

    def text(self, point: Any, text: str) -> str:
        x, y = self._at(point).split(",")
        return f'<text x="{x}" y="{y}">{escape(text)}</text>'

    def frame(self, world: World, name: str) -> str:
        """The x axis of a locale's frame, one metre long, from its origin."""
        origin, tip = world.world_from_locale(name).apply([(0, 0, 0), (1, 0, 0)])
        return f'<polyline class="axis" points="{self._at([origin, tip])}"/>'


def _footprint(polygon_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """The floor line (2, 2) of an upright polygon."""
    xy = polygon_world[:, :2]
    far = np.linalg.norm(xy - xy[0], axis=1).argmax()
    return np.stack([xy[0], xy[far]])
