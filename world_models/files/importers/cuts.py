"""Where doors, wide openings and windows go in the walls of the rooms of a storey."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely

from world_models.files.importers.outlines import THICKEST_M, Floats, Stretch, facing, side_of
from world_models.files.importers.plan import Gap, Window

MARGIN_M = 0.02
"""No opening is nearer to the end of a wall."""
CASING_M = 0.12
NARROWEST_M = 0.6
WIDE_M = 0.9
"""No opening is put where there is no wall unless it is at least so wide."""
ROOM_M = 1.0
"""Before and behind a wide opening that is to be free of furniture."""
SHIFT_M = 0.2
"""An opening may be moved so far along its wall."""


@dataclass(frozen=True, slots=True)
class Cut:
    """An opening in a side of ``between[0]``, centred ``along_m`` from that side's start."""

    name: str
    between: tuple[str, ...]
    side: int
    along_m: float
    width_m: float
    height_m: float
    is_open: bool


@dataclass(frozen=True, slots=True)
class Pane:
    """A window on a side of a room."""

    name: str
    room: str
    side: int
    along_m: float
    width_m: float


def door_between(
    gap: Gap, outlines: Mapping[str, Floats], pairs: Iterable[tuple[str, str]], thickest_m: float = THICKEST_M
) -> tuple[Cut, float] | None:
    """The best place for a door between any of these pairs of rooms, and by how much it was moved or narrowed [m]."""
    best: tuple[float, Cut, float] | None = None
    for a, b in pairs:
        for stretch in facing(a, outlines[a], b, outlines[b], most_m=thickest_m):
            start, along, _ = side_of(outlines[a], stretch.side)
            arm = gap.centre - start
            off = float(arm @ np.array([-along[1], along[0]])) + stretch.gap_m / 2
            fitted = _fitted(float(arm @ along), gap.width_m, stretch.low_m, stretch.high_m)
            if fitted is None or abs(off) > stretch.gap_m / 2 + 0.25:
                continue
            middle, width = fitted
            change = abs(middle - float(arm @ along)) + gap.width_m - width
            cost = abs(off) + change
            if best is None or cost < best[0] - 1e-9:
                best = cost, Cut(gap.name, (a, b), stretch.side, middle, width, gap.height_m, True), change
    return best[1:] if best else None


def _fitted(along: float, width: float, low: float, high: float) -> tuple[float, float] | None:
    """(middle, width) of an opening pushed or narrowed into a stretch of wall; None where that asks for too much."""
    low, high = low + MARGIN_M, high - MARGIN_M
    if not low - 0.1 <= along <= high + 0.1:
        return None
    fitting = min(width, high - low)
    if fitting < min(NARROWEST_M, width):
        return None
    middle = min(max(along, low + fitting / 2), high - fitting / 2)
    return (middle, fitting) if abs(middle - along) <= max(SHIFT_M, width - fitting) else None


def door_outside(gap: Gap, outlines: Mapping[str, Floats]) -> Cut | None:
    """A door in the one wall that it is nearest to; closed."""
    best: tuple[float, Cut] | None = None
    for room, outline in outlines.items():
        for side in range(len(outline)):
            start, along, length = side_of(outline, side)
            arm = gap.centre - start
            off = abs(float(arm @ np.array([-along[1], along[0]])))
            fitted = _fitted(float(arm @ along), gap.width_m, 0.0, length)
            if off < 0.5 and fitted is not None and (best is None or off < best[0]):
                best = off, Cut(gap.name, (room,), side, fitted[0], fitted[1], gap.height_m, False)
    return best[1] if best else None


def wide_opening(name: str, a: str, b: str, outlines: Mapping[str, Floats], height_m: float,
                 taken: Iterable[Cut], thickest_m: float, solid: Iterable[Floats] = (),
                 barriers: Iterable[shapely.Geometry] = ()) -> Cut | None:
    """The widest opening that thin walls between two rooms allow, away from doors and from footprints (4, 2).

    ``barriers`` close only what they stand in.
    """
    stretches = [s for s in facing(a, outlines[a], b, outlines[b]) if s.gap_m < thickest_m]
    solid, barriers = list(solid), list(barriers)
    free = [f for s in stretches for f in _free(s, outlines[a], taken, solid, barriers)]
    if not free or (longest := max(free, key=lambda f: f[2] - f[1]))[2] - longest[1] < WIDE_M + 2 * CASING_M:
        return None
    side, low, high = longest
    return Cut(name, (a, b), side, (low + high) / 2, high - low - 2 * CASING_M, height_m, True)


def _free(stretch: Stretch, outline: Floats, taken: Iterable[Cut], solid: Iterable[Floats],
          barriers: Iterable[shapely.Geometry]) -> list[tuple[int, float, float]]:
    """(side, low, high) of what doors in the same side, footprints before and behind it and barriers leave of it."""
    start, along, _ = side_of(outline, stretch.side)
    inward = np.array([-along[1], along[0]])
    marks = [(c.along_m - c.width_m / 2, c.along_m + c.width_m / 2) for c in taken
             if c.between[0] == stretch.a and c.side == stretch.side]
    for arms in (footprint - start for footprint in solid):
        s, off = arms @ along, arms @ inward
        if off.min() < ROOM_M and off.max() > -ROOM_M - stretch.gap_m:
            marks.append((float(s.min()) - CASING_M, float(s.max()) + CASING_M))
    quad = [start + s * along + off * inward for s, off in
            ((stretch.low_m, MARGIN_M), (stretch.high_m, MARGIN_M), (stretch.high_m, -stretch.gap_m - MARGIN_M),
             (stretch.low_m, -stretch.gap_m - MARGIN_M))]
    for barrier in barriers:
        inside = barrier.intersection(shapely.Polygon(quad))
        for part in (part for part in shapely.get_parts(inside) if not part.is_empty):
            s = (shapely.get_coordinates(part) - start) @ along
            marks.append((float(s.min()) - MARGIN_M, float(s.max()) + MARGIN_M))
    pieces, at = [], stretch.low_m
    for low, high in sorted(marks):
        pieces.append((stretch.side, at, min(low, stretch.high_m)))
        at = max(at, high)
    return [piece for piece in [*pieces, (stretch.side, at, stretch.high_m)] if piece[2] > piece[1]]


def overlap(cut: Cut, others: Iterable[Cut], outlines: Mapping[str, Floats]) -> bool:
    """Whether an opening meets another one in either of its rooms' walls."""
    own = _feet(cut, outlines)
    return any(set(cut.between) & set(other.between) and _near(own, _feet(other, outlines)) for other in others)


def _feet(cut: Cut, outlines: Mapping[str, Floats]) -> Floats:
    start, along, _ = side_of(outlines[cut.between[0]], cut.side)
    return np.array([start + (cut.along_m + sign * cut.width_m / 2) * along for sign in (-1, 1)])


def doorway(cut: Cut, outlines: Mapping[str, Floats], margin_m: float) -> Floats:
    """(4, 2) the floor of an opening between two rooms, and so much of the rooms before and behind it."""
    feet = _feet(cut, outlines)
    along = (feet[1] - feet[0]) / np.linalg.norm(feet[1] - feet[0])
    inward = np.array([-along[1], along[0]])
    deep_m = shapely.Polygon(outlines[cut.between[-1]]).distance(shapely.Point(feet.mean(axis=0)))
    near, far = margin_m * inward, -(deep_m + margin_m) * inward
    return np.array([feet[0] + near, feet[0] + far, feet[1] + far, feet[1] + near])


def _near(one: Floats, other: Floats) -> bool:
    """Whether two openings through the same wall share some of it."""
    along = (one[1] - one[0]) / np.linalg.norm(one[1] - one[0])
    inward = np.array([-along[1], along[0]])
    s = (other - one[0]) @ along
    return bool(np.abs((other - one[0]) @ inward).max() < 0.6 and s.min() < np.linalg.norm(one[1] - one[0]) + 0.02
                and s.max() > -0.02)


def panes(window: Window, outlines: Mapping[str, Floats]) -> list[Pane]:
    """Where a window shows inside: on each side near it that runs along it and holds at least half of it."""
    found = []
    for room, outline in outlines.items():
        for side in range(len(outline)):
            start, along, length = side_of(outline, side)
            arm = window.centre - start
            if abs(float(along @ window.along)) < 0.999 or abs(float(arm @ np.array([-along[1], along[0]]))) > 0.5:
                continue
            middle, half = float(arm @ along), window.width_m / 2
            low, high = max(MARGIN_M, middle - half), min(length - MARGIN_M, middle + half)
            if high - low >= max(0.3, half):
                found.append(Pane(window.name, room, side, (low + high) / 2, high - low))
    return found


def all_pairs(names: Iterable[str]) -> list[tuple[str, str]]:
    """Every two of them, in order."""
    return list(combinations(names, 2))
