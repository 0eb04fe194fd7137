"""The plan of a world as a picture, also with the ways of runs on it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from harvey.errors import BadInput
from world_models.building.plan_view import GROUND, Drawing, DrawnStorey, build_drawing, draw_storeys
from world_models.building.world import World

if TYPE_CHECKING:
    from logs.run_directory import RunDirectory
    from logs.run_head import RunHead

PlacedPoint = tuple[str, float, float]
"""A room, and x and y in the world frame [m]."""
PIXELS_PER_M, MAX_PIXELS = 30.0, 6000.0
LOOKS: Mapping[str, tuple[str, str]] = {
    "room": ("#f7f4ea", "#222222"), "outdoors": ("#b9cf9d", "#3c5a2c"), "obstacle": ("#c9a676", "#5b4327"),
    "board": ("#6d8fb3", "#34516f"), "paving": ("#e3ded0", "#8a8678"), "doorway": ("#bfe3b4", "#3c7a2c"),
}
"""Face and edge of each kind of surface."""
LINES: Mapping[str, tuple[str, float]] = {"leaf": ("#8c1d1d", 2.4), "axis": ("#b03030", 1.0), "mark": ("white", 1.5)}
LETTERS_M: Mapping[str, float] = {"title": 0.7, "name": 0.42, "note": 0.34, "door-name": 0.24}
"""Size of the letters of each kind that is written."""


def draw_plan(world: World, out: Path) -> None:
    """Write the plan as a PNG. Raises OSError."""
    figure, _ = draw_drawing(build_drawing(world))
    figure.savefig(out, format="png")


def draw_ways(runs: Mapping[str, RunDirectory], out: Path) -> None:
    """Write where the robot of each run believed to be, and dashed where it truly was, on the plan of the storey that
    most of it is on; PNG, PDF or SVG by the name's ending.

    Raises:
        BadInput: a run's world cannot be read, two are of different worlds, or the file cannot be written.
    """
    from logs.run_head import RunHead

    heads = {name: RunHead.read(run.path) for name, run in runs.items()}
    if len({head.world_sha256 for head in heads.values()}) > 1:
        raise BadInput(f"expected runs of one world, got {', '.join(Path(head.world).name for head in heads.values())}")
    world = next(iter(heads.values())).load_world()
    ways = {name: _read_ways(run, heads[name], world) for name, run in runs.items()}

    def count(storey: DrawnStorey) -> int:
        return len([room for believed, _ in ways.values() for room, _, _ in believed if room in storey.rooms])

    storey = max(draw_storeys(world), key=count)
    figure, axes = draw_drawing(storey.drawing)
    for number, (name, both) in enumerate(ways.items()):
        for kind, way, style in zip(("believed", "true"), both, ("-", "--"), strict=True):
            points = np.array([(x, y) for room, x, y in way if room in storey.rooms]).reshape(-1, 2) - storey.origin
            if len(points):
                axes.plot(*points.T, style, color=f"C{number}", linewidth=2.0 if style == "-" else 1.0,
                          label=f"{name}, {kind}", zorder=1000 + number)
                axes.plot(*points[-1], "o", color=f"C{number}", markersize=5, zorder=1000 + number)
    axes.legend(loc="lower center")
    try:
        figure.savefig(out)
    except OSError as error:
        raise BadInput(f"{out}: expected a file to write to, got: {error.strerror}") from None


def _read_ways(run: RunDirectory, head: RunHead, world: World) -> tuple[list[PlacedPoint], list[PlacedPoint]]:
    """Where the robot believed to be and where it truly was; of the truth the room is that of the belief."""
    from harvey.report.data import beliefs
    from logs.reader import read_true_track
    from logs.run_head import SIMULATOR
    from logs.timeline import Timeline

    held = list(beliefs(Timeline(run.journal), world))
    if not held or head.kind != SIMULATOR or not run.recording.is_file():
        true = []
    else:
        cycles = [one["cycle"] for one in held]
        true = [(held[max(0, bisect_right(cycles, cycle) - 1)]["locale"], x, y)
                for cycle, x, y, _ in read_true_track(run.recording)]
    return [(one["locale"], one["x"], one["y"]) for one in held], true


def draw_drawing(plan: Drawing) -> tuple[Any, Any]:
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
