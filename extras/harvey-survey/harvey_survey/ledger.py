"""The ledger of a building: of each line, wall, door and thing, how often runs expected it, found it, and how far off.

A pure function of the world and the journals. How far something is off is measured from the pose that the picture gave,
by all of its lines that were found in that picture; the part that the pose has taken up is not seen here, but by
:mod:`harvey_survey.adjustment`.
"""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harvey.commands.plan_picture import draw_drawing
from harvey.errors import BadInput
from harvey_survey.seen_pictures import (
    LIGHTS,
    SIGMA_PX,
    SeenPicture,
    light_of,
    measure_offsets,
    measure_slopes,
    read_looks,
)
from logs.run_directory import RunDirectory
from logs.tables import table
from world_models.building.geometry.landmarks import Landmark
from world_models.building.model_errors import WALL, LineErrors, find_line_errors
from world_models.building.plan_view import DrawnStorey, draw_storeys
from world_models.building.world import World
from world_models.camera import CAMERA_UNKNOWNS

Floats = NDArray[np.float64]

WITHIN_M = 0.1
"""Deviation of what may be off, where one picture says little of it [m]: it counts by what it adds to that."""
NEAR_M, FAR_M = 3.0, 6.0
"""What is nearer than the one is near, what is further than the other far [m]."""
DISTANCES = ("near", "middling far", "far")
STILL = np.zeros(len(CAMERA_UNKNOWNS))


@dataclass(frozen=True, slots=True)
class LedgerCounts:
    """How often something was expected, found, hidden by what was found on the floor, and missing."""

    expected: int = 0
    found: int = 0
    hidden: int = 0

    @property
    def missing(self) -> int:
        return self.expected - self.found - self.hidden

    def plus(self, found: bool, hidden: bool) -> LedgerCounts:
        return LedgerCounts(self.expected + 1, self.found + found, self.hidden + (hidden and not found))


@dataclass(frozen=True, slots=True)
class Offset:
    """How far something is off in one direction.

    Attributes:
        way: what is displaced and how, the name of a mode of :mod:`world_models.building.model_errors`: a wall into its
            room, a door or a thing along its wall, a thing on a wall up, one on the floor to x and y of the world.
        direction: (3,) unit vector of that [world].
        mean_m: by all pictures; positive along that direction.
        sigma_m: standard deviation of the mean. spread_m: between pictures; 0 of one.
        pictures: by how many.
    """

    way: str
    direction: tuple[float, float, float]
    mean_m: float
    sigma_m: float
    spread_m: float
    pictures: int


@dataclass(frozen=True, slots=True)
class LineEntry:
    """One line of a landmark: its number there, its counts, and how far off across itself, as it shows best.

    Attributes:
        off_m: mean; spread_m: standard deviation between pictures; 0 where it was never found.
        direction: (3,) the direction in which that is measured [world].
    """

    number: int
    counts: LedgerCounts
    off_m: float
    spread_m: float
    direction: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class LedgerElement:
    """A wall (a face), a door or a thing.

    Attributes:
        name, room, kind, source: of its landmark.
        counts: of its lines in all pictures.
        pictures, unseen: in how many pictures lines of it were expected, and in how many of them none was found.
        by_light, by_distance: counts by the picture's brightness, and by how far away its lines are.
    """

    name: str
    room: str
    kind: str
    source: str
    counts: LedgerCounts
    pictures: int
    unseen: int
    by_light: dict[str, LedgerCounts]
    by_distance: dict[str, LedgerCounts]
    lines: tuple[LineEntry, ...]


@dataclass(frozen=True, slots=True)
class Ledger:
    """What all runs say of a building: elements by name, offsets by name of the mode.

    Attributes:
        runs: digests of the journals.
        looks: pictures of verified places that were counted.
    """

    world: str
    runs: tuple[str, ...]
    looks: int
    elements: tuple[LedgerElement, ...]
    offsets: tuple[Offset, ...]

    def offsets_of(self, name: str) -> tuple[Offset, ...]:
        """Those of a landmark's own ways, without that of its wall."""
        return tuple(o for o in self.offsets if o.way.startswith(f"{name} ") and WALL not in o.way)


def read_ledger(world: World, path: Path, runs: Sequence[RunDirectory]) -> Ledger:
    """The ledger of a world by the journals of its runs; ``path`` is the world's file. Raises BadInput."""
    return build_ledger(world, read_looks(world, path, runs))


def build_ledger(world: World, looks: Sequence[SeenPicture]) -> Ledger:
    """The ledger by looks."""
    tallies: dict[str, _Tally] = {}
    measured: dict[tuple[str, tuple[float, float, float]], list[tuple[float, float]]] = {}
    for look in looks:
        groups: dict[str, list[int]] = {}
        for i, mark in enumerate(look.marks):
            groups.setdefault(mark.name, []).append(i)
        for name, rows in groups.items():
            tallies.setdefault(name, _Tally()).add(look, rows)
        pieces = look.pieces_world[look.pairs]
        offsets = measure_offsets(look, look.pose, STILL, pieces)
        _, slopes = measure_slopes(look, look.pose, STILL, pieces)
        for way, direction, mean_m, variance in _measure_modes(world, look, offsets, slopes):
            measured.setdefault((way, direction), []).append((mean_m, variance))
        for i, offset, slope in zip(look.pairs.tolist(), offsets, slopes, strict=True):
            tallies[look.marks[i].name].offsets.setdefault(int(look.numbers[i]), []).append((offset, slope))
    elements = [tallies[mark.name].build(mark) for mark in world.landmarks if mark.name in tallies]
    combined = [_combine(*way, measured[way]) for way in sorted(measured)]
    return Ledger(world.name, tuple(sorted({look.run for look in looks})), len(looks), tuple(elements),
                  tuple(offset for offset in combined if offset is not None))


def errors_of(world: World, look: SeenPicture, unstated_m: float) -> LineErrors:
    """The modes of a look's lines; what nothing is stated of has this deviation [m]."""
    return find_line_errors(world, look.marks, look.numbers.tolist(), unstated_m)


@dataclass
class _Tally:
    """What is counted of one landmark so far; offsets: of each line, of each segment its offset and slopes [px, px/m].
    """

    pictures: int = 0
    unseen: int = 0
    counts: defaultdict[str | int, LedgerCounts] = field(default_factory=lambda: defaultdict(LedgerCounts))
    offsets: dict[int, list[tuple[Floats, Floats]]] = field(default_factory=dict)

    def add(self, look: SeenPicture, rows: Sequence[int]) -> None:
        self.pictures += 1
        self.unseen += not any(look.found[i] for i in rows)
        light, far = light_of(look), look.distances_m
        for i in rows:
            seen = bool(look.found[i]), bool(look.hidden[i])
            for key in ("all", light, DISTANCES[int(far[i] > NEAR_M) + int(far[i] > FAR_M)], int(look.numbers[i])):
                self.counts[key] = self.counts[key].plus(*seen)

    def build(self, mark: Landmark) -> LedgerElement:
        lines = tuple(_build_line(n, self.counts[n], self.offsets.get(n, []))
                      for n in sorted(key for key in self.counts if isinstance(key, int)))
        by_light, by_distance = ({key: self.counts[key] for key in keys if key in self.counts}
                                 for keys in (LIGHTS, DISTANCES))
        return LedgerElement(mark.name, mark.locale, mark.kind, mark.source, self.counts["all"], self.pictures,
                             self.unseen, by_light, by_distance, lines)


def _build_line(number: int, counts: LedgerCounts, offsets: Sequence[tuple[Floats, Floats]]) -> LineEntry:
    """The direction in which a line's offsets show best is that of the largest information."""
    if not offsets:
        return LineEntry(number, counts, 0.0, 0.0, (0.0, 0.0, 0.0))
    information = sum((slope.T @ slope for _, slope in offsets), np.zeros((3, 3)))
    direction = np.linalg.eigh(information)[1][:, -1]
    direction = direction * (1.0 if direction[np.argmax(np.abs(direction))] > 0.0 else -1.0)
    shown = [(off, slope @ direction) for off, slope in offsets]
    weight, off_m = np.array([(s @ s, s @ -off / (s @ s)) for off, s in shown]).T
    mean_m, spread_m = _average(off_m, weight)
    x, y, z = direction.tolist()
    return LineEntry(number, counts, mean_m, spread_m, (x, y, z))


def _measure_modes(
    world: World, look: SeenPicture, offsets: Floats, by_place: Floats
) -> list[tuple[str, tuple[float, float, float], float, float]]:
    """How far each mode is off by one picture, its pose as it was found: name, direction, mean [m] and variance.

    ``offsets`` (p, 2) of its pairs, and by_place (p, 2, 3) their slopes with the place of the line.
    """
    every = errors_of(world, look, WITHIN_M).restate(1.0)
    errors = every.take(look.pairs)
    slopes = np.einsum("pei,kpi->pek", by_place, errors.displacements).reshape(2 * len(offsets), -1) / SIGMA_PX
    prior = np.eye(slopes.shape[1]) / WITHIN_M**2
    covariance = np.linalg.inv(slopes.T @ slopes + prior)
    means = covariance @ (slopes.T @ -offsets.reshape(-1) / SIGMA_PX)
    return [(way, direction_of(every, k), float(means[k]), float(covariance[k, k]))
            for k, way in enumerate(errors.displacement_modes)]


def direction_of(errors: LineErrors, k: int) -> tuple[float, float, float]:
    """(3,) the unit vector along which a mode displaces lines; rounded, so that it is the same from all pictures."""
    by_m = errors.displacements[k][np.argmax(np.linalg.norm(errors.displacements[k], axis=1))]
    x, y, z = (np.round(by_m / np.linalg.norm(by_m), 9) + 0.0).tolist()
    return x, y, z


def _combine(way: str, direction: tuple[float, float, float], measured: Sequence[tuple[float, float]]) -> Offset | None:
    """All pictures together, each by what it adds to not knowing; None where none adds anything."""
    means, variances = np.array(measured).T
    added = 1.0 / variances - 1.0 / WITHIN_M**2
    if added.sum() < 1.0 / WITHIN_M**2:
        return None
    counted = added > 1e-9 / WITHIN_M**2
    own, weight = (means / variances)[counted] / added[counted], added[counted]
    mean_m, spread_m = _average(own, weight)
    return Offset(way, direction, mean_m, float(1.0 / np.sqrt(weight.sum())), spread_m, int(counted.sum()))


def _average(values: Floats, weight: Floats) -> tuple[float, float]:
    mean = float(weight @ values / weight.sum())
    return mean, float(np.sqrt(weight @ (values - mean) ** 2 / weight.sum()))


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
