"""The plan of a world as a picture (PNG), also with ways on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from world_models.building.plan_view import GROUND, Drawing, DrawnStorey, build_drawing, draw_storeys
from world_models.building.world import World

PIXELS_PER_M, MAX_PIXELS = 30.0, 6000.0
LOOKS: Mapping[str, tuple[str, str]] = {
    "room": ("#f7f4ea", "#222222"), "outdoors": ("#b9cf9d", "#3c5a2c"), "obstacle": ("#c9a676", "#5b4327"),
    "board": ("#6d8fb3", "#34516f"), "paving": ("#e3ded0", "#8a8678"), "doorway": ("#bfe3b4", "#3c7a2c"),
}
"""Face and edge of each kind of surface."""
LINES: Mapping[str, tuple[str, float]] = {"leaf": ("#8c1d1d", 2.4), "axis": ("#b03030", 1.0), "mark": ("white", 1.5)}
LETTERS_M: Mapping[str, float] = {"title": 0.7, "name": 0.42, "note": 0.34, "door-name": 0.24}
"""Size of the letters of each kind that is written."""


WAY_COLOURS = "#0063a0", "#b3240f"


def draw_plan(world: World, out: Path) -> None:
    """Write the plan as a PNG. Raises OSError."""
    figure, _ = _draw(build_drawing(world))
    figure.savefig(out, format="png")


def draw_ways(world: World, ways: Mapping[str, Sequence[tuple[str, float, float]]], out: Path) -> None:
    """Write two ways as a PNG, on the plan of the storey that most of them are on. Raises OSError.

    Args:
        ways: by what they are called, locales with x, y [m, world].
    """
    def count(storey: DrawnStorey) -> int:
        return len([room for way in ways.values() for room, _, _ in way if room in storey.rooms])

    storey = max(draw_storeys(world), key=count)
    figure, axes = _draw(storey.drawing)
    for number, ((name, way), colour) in enumerate(zip(ways.items(), WAY_COLOURS, strict=True)):
        points = np.array([(x, y) for room, x, y in way if room in storey.rooms]).reshape(-1, 2) - storey.origin
        axes.plot(*points.T, color=colour, linewidth=4.0 - 2.0 * number, label=name, zorder=1000 + number)
    axes.legend(loc="lower center")
    figure.savefig(out, format="png")


def _draw(plan: Drawing) -> tuple[Any, Any]:
    """A figure of matplotlib, and its axes [m]."""
    from matplotlib.figure import Figure

    scale = min(PIXELS_PER_M, MAX_PIXELS / float(plan.size.max()))
    figure = Figure(figsize=(plan.size[0] * scale / 100.0, plan.size[1] * scale / 100.0), dpi=100, facecolor=GROUND)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, plan.size[0])
    axes.set_ylim(0.0, plan.size[1])
    axes.set_axis_off()
    for order, shape in enumerate(plan.shapes):
        x, y = shape.points.T
        if shape.kind in LOOKS:
            face, edge = LOOKS[shape.kind]
            axes.fill(x, y, facecolor=face, edgecolor=edge, linewidth=0.8, zorder=order)
        elif shape.kind in LINES:
            colour, width = LINES[shape.kind]
            axes.plot(x, y, color=colour, linewidth=width, zorder=order)
        elif shape.kind == "link":
            axes.plot(x, y, "o", color="#7d4fa3", markersize=5, zorder=order)
        else:
            axes.text(x[0], y[0], shape.text, ha="left" if shape.kind == "note" else "center",
                      va="baseline" if shape.kind == "note" else "center",
                      color="white" if shape.kind in ("title", "note") else "#222222",
                      fontsize=LETTERS_M[shape.kind] * scale * 72.0 / 100.0,
                      fontweight="bold" if shape.kind == "title" else "normal", zorder=order)
    return figure, axes
