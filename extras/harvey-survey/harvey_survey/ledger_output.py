"""A ledger for people and programs: a table, a picture of the plan, and JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from harvey.commands.plan_picture import draw_drawing
from harvey.errors import BadInput
from harvey_survey.ledger import Ledger, LedgerCounts, LedgerElement, Offset
from logs.tables import table
from world_models.building.model_errors import WALL
from world_models.building.plan_view import DrawnStorey, draw_storeys
from world_models.building.world import World

COLOURS: Sequence[tuple[float, str, str]] = (
    (0.8, "#2c8a3c", "found in 80 % and more"), (0.4, "#e08a1e", "in 40 to 80 %"), (0.0, "#c02020", "in less"))
"""Of what was found in at least this part of the pictures: colour and words."""
ENLARGED = 20.0
"""So many times as long as it is off an arrow is drawn."""
SURE_SIGMAS = 3.0
"""What is off by fewer of its standard deviations has no arrow, and no star in the table."""
SUFFIXES = (".png", ".svg", ".pdf")
HEAD = ("what", "kind", "pictures", "in none", "lines", "found", "hidden", "missing", "by light", "by distance",
        "off cm")


def format_ledger(ledger: Ledger) -> str:
    """The table, walls and what is off with them below it."""
    rows = [(e.name, e.kind, *map(str, (e.pictures, e.unseen, e.counts.expected, e.counts.found, e.counts.hidden,
                                        e.counts.missing)),
             _shares(e.by_light), _shares(e.by_distance), ", ".join(map(_tell, ledger.offsets_of(e.name))))
            for e in ledger.elements]
    walls = [(o.way, *_figures(o)) for o in ledger.offsets if WALL in o.way]
    head = f"{ledger.world}: {ledger.looks} pictures of verified places in {len(ledger.runs)} runs"
    parts = [head, table(HEAD, rows)]
    if walls:
        parts += ["Walls, along their normals into their rooms:",
                  table(("wall", "off cm", "sigma cm", "spread cm", "pictures"), walls)]
    star = f"* off by more than {SURE_SIGMAS:g} standard deviations, from the poses of the pictures\n"
    return "\n\n".join([*parts, star])


def _shares(counts: dict[str, LedgerCounts]) -> str:
    return ", ".join(f"{name} {c.found}/{c.expected}" for name, c in counts.items())


def _figures(offset: Offset) -> tuple[str, ...]:
    star = "*" if is_sure(offset) else ""
    return (f"{100.0 * offset.mean_m:+.1f}{star}", f"{100.0 * offset.sigma_m:.1f}", f"{100.0 * offset.spread_m:.1f}",
            str(offset.pictures))


def _tell(offset: Offset) -> str:
    way = offset.way.rpartition(" ")[2]
    return f"{way} {100.0 * offset.mean_m:+.1f} +-{100.0 * offset.sigma_m:.1f}{'*' if is_sure(offset) else ''}"


def is_sure(offset: Offset) -> bool:
    """Whether something is surely off, by more than its standard deviations."""
    spread_m = offset.spread_m / math.sqrt(offset.pictures)
    return abs(offset.mean_m) > SURE_SIGMAS * max(offset.sigma_m, spread_m)


def ledger_json(ledger: Ledger) -> str:
    """All of it as one JSON object, lengths in metres."""
    return json.dumps(asdict(ledger), indent=1) + "\n"


def write_plan(world: World, ledger: Ledger, out: Path) -> None:
    """Draw the plan of the storey of which most was expected, with what was found of each wall, door and thing.

    Raises BadInput where the name does not end in .png, .svg or .pdf, or the file cannot be written.
    """
    if out.suffix not in SUFFIXES:
        raise BadInput(f"--plan: expected a name that ends in {', '.join(SUFFIXES)}, got {str(out)!r}")
    places = {mark.name: mark.lines_world.reshape(-1, 3).mean(axis=0)[:2] for mark in world.landmarks
              if len(mark.lines_world)}

    def count(storey: DrawnStorey) -> int:
        return sum(element.room in storey.rooms for element in ledger.elements)

    storey = max(draw_storeys(world), key=count)
    figure, axes = draw_drawing(storey.drawing)
    for element in ledger.elements:
        if element.room in storey.rooms:
            _draw_element(axes, ledger, element, places[element.name] - storey.origin)
    for _, colour, words in COLOURS:
        axes.plot([], [], "o", color=colour, label=words)
    axes.plot([], [], "-", color="#3040c0", label=f"off, {ENLARGED:g} times enlarged")
    axes.legend(loc="lower center", ncols=2, fontsize="small")
    try:
        figure.savefig(out)
    except OSError as error:
        raise BadInput(f"--plan {out}: expected a file to write to, got: {error.strerror}") from None


def _draw_element(axes: Any, ledger: Ledger, element: LedgerElement, at: Any) -> None:
    share = 1.0 - element.unseen / element.pictures
    colour = next(colour for least, colour, _ in COLOURS if share >= least)
    axes.plot(*at, "o", color=colour, markersize=4.0 + min(6.0, float(np.sqrt(element.pictures))), zorder=2000)
    sure = [o.mean_m * np.array(o.direction[:2]) for o in ledger.offsets_of(element.name) if is_sure(o)]
    off = sum(sure, np.zeros(2))
    if np.any(off):
        axes.annotate("", at + ENLARGED * off, at, zorder=2001,
                      arrowprops={"arrowstyle": "->", "color": "#3040c0", "linewidth": 1.5})
