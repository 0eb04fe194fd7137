"""Positions of doors, wide openings and windows in the walls of a storey's rooms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely

from harvey_buildings.building_plan import WallOpening, Window
from harvey_buildings.polygons import MAX_WALL_M, Floats, Stretch, find_facing_stretches, side_of

MARGIN_M = 0.02
"""Smallest distance of an opening from the end of its wall."""
CASING_M = 0.12
"""Wall on either side of a wide opening, for its casing."""
MIN_DOOR_M = 0.6
"""Narrowest door."""
MIN_WIDE_M = 0.9
"""Narrowest opening that is placed where there is no wall in the file."""
MIN_FREE_M = 1.0
"""Depth before and behind a wide opening that must be free of furniture."""
MAX_SHIFT_M = 0.2
"""How far an opening may be moved along its wall."""


@dataclass(frozen=True, slots=True)
class PlacedOpening:
    """A door or opening in side number ``side`` of room ``between[0]``, centred ``along_m`` from the side's start."""

    name: str
    between: tuple[str, ...]
    side: int
    along_m: float
    width_m: float
    height_m: float
    is_open: bool


@dataclass(frozen=True, slots=True)
class PlacedWindow:
    """A window on side number ``side`` of a room, centred ``along_m`` from the side's start."""

    name: str
    room: str
    side: int
    along_m: float
    width_m: float


def place_door(
    opening: WallOpening, outlines: Mapping[str, Floats], pairs: Iterable[tuple[str, str]],
    max_wall_m: float = MAX_WALL_M,
) -> tuple[PlacedOpening, float] | None:
    """The best place for a door between any of these pairs of rooms, and by how much it was moved or narrowed [m]."""
    best: tuple[float, PlacedOpening, float] | None = None
    for a, b in pairs:
        for stretch in find_facing_stretches(a, outlines[a], b, outlines[b], max_gap_m=max_wall_m):
            start, along, _ = side_of(outlines[a], stretch.side)
            arm = opening.centre - start
            off = float(arm @ np.array([-along[1], along[0]])) + stretch.gap_m / 2
            fitted = _fit_opening(float(arm @ along), opening.width_m, stretch.low_m, stretch.high_m)
            if fitted is None or abs(off) > stretch.gap_m / 2 + 0.25:
                continue
            middle, width = fitted
            change = abs(middle - float(arm @ along)) + opening.width_m - width
            cost = abs(off) + change
            if best is None or cost < best[0] - 1e-9:
                placed = PlacedOpening(opening.name, (a, b), stretch.side, middle, width, opening.height_m, True)
                best = cost, placed, change
    return best[1:] if best else None


def _fit_opening(along: float, width: float, low: float, high: float) -> tuple[float, float] | None:
    """(middle, width) of an opening moved or narrowed into a stretch of wall; None where that changes it too much."""
    low, high = low + MARGIN_M, high - MARGIN_M
    if not low - 0.1 <= along <= high + 0.1:
        return None
    fitting = min(width, high - low)
    if fitting < min(MIN_DOOR_M, width):
        return None
    middle = min(max(along, low + fitting / 2), high - fitting / 2)
    return (middle, fitting) if abs(middle - along) <= max(MAX_SHIFT_M, width - fitting) else None


def place_outer_door(opening: WallOpening, outlines: Mapping[str, Floats]) -> PlacedOpening | None:
    """A closed door in the nearest wall of any room."""
    best: tuple[float, PlacedOpening] | None = None
    for room, outline in outlines.items():
        for side in range(len(outline)):
            start, along, length = side_of(outline, side)
            arm = opening.centre - start
            off = abs(float(arm @ np.array([-along[1], along[0]])))
            fitted = _fit_opening(float(arm @ along), opening.width_m, 0.0, length)
            if off < 0.5 and fitted is not None and (best is None or off < best[0]):
                best = off, PlacedOpening(opening.name, (room,), side, fitted[0], fitted[1], opening.height_m, False)
    return best[1] if best else None


def place_wide_opening(name: str, a: str, b: str, outlines: Mapping[str, Floats], height_m: float,
                 taken: Iterable[PlacedOpening], max_wall_m: float, solid: Iterable[Floats] = (),
                 barriers: Iterable[shapely.Geometry] = ()) -> PlacedOpening | None:
    """The widest opening that thin walls between two rooms allow, away from doors and furniture; None: too narrow.

    Args:
        taken: openings placed already.
        max_wall_m: thickness of the walls that may be opened.
        solid: footprints (4, 2) of furniture.
        barriers: footprints of walls and railings; they close only what they stand in.
    """
    stretches = [s for s in find_facing_stretches(a, outlines[a], b, outlines[b]) if s.gap_m < max_wall_m]
    solid, barriers = list(solid), list(barriers)
    free = [f for s in stretches for f in _free(s, outlines[a], taken, solid, barriers)]
    if not free or (longest := max(free, key=lambda f: f[2] - f[1]))[2] - longest[1] < MIN_WIDE_M + 2 * CASING_M:
        return None
    side, low, high = longest
    return PlacedOpening(name, (a, b), side, (low + high) / 2, high - low - 2 * CASING_M, height_m, True)


def _free(stretch: Stretch, outline: Floats, taken: Iterable[PlacedOpening], solid: Iterable[Floats],
          barriers: Iterable[shapely.Geometry]) -> list[tuple[int, float, float]]:
    """(side, low, high) of the pieces of a stretch that doors, furniture before or behind it and barriers leave."""
    start, along, _ = side_of(outline, stretch.side)
    inward = np.array([-along[1], along[0]])
    marks = [(c.along_m - c.width_m / 2, c.along_m + c.width_m / 2) for c in taken
             if c.between[0] == stretch.a and c.side == stretch.side]
    for arms in (footprint - start for footprint in solid):
        s, off = arms @ along, arms @ inward
        if off.min() < MIN_FREE_M and off.max() > -MIN_FREE_M - stretch.gap_m:
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


def overlap(cut: PlacedOpening, others: Iterable[PlacedOpening], outlines: Mapping[str, Floats]) -> bool:
    """Whether an opening overlaps another one in a wall of either of its rooms."""
    own = _feet(cut, outlines)
    return any(set(cut.between) & set(other.between) and _near(own, _feet(other, outlines)) for other in others)


def _feet(cut: PlacedOpening, outlines: Mapping[str, Floats]) -> Floats:
    start, along, _ = side_of(outlines[cut.between[0]], cut.side)
    return np.array([start + (cut.along_m + sign * cut.width_m / 2) * along for sign in (-1, 1)])


def doorway(cut: PlacedOpening, outlines: Mapping[str, Floats], margin_m: float) -> Floats:
    """(4, 2) the floor of an opening between two rooms, with a margin before and behind it [m]."""
    feet = _feet(cut, outlines)
    along = (feet[1] - feet[0]) / np.linalg.norm(feet[1] - feet[0])
    inward = np.array([-along[1], along[0]])
    deep_m = shapely.Polygon(outlines[cut.between[-1]]).distance(shapely.Point(feet.mean(axis=0)))
    near, far = margin_m * inward, -(deep_m + margin_m) * inward
    return np.array([feet[0] + near, feet[0] + far, feet[1] + far, feet[1] + near])


def _near(one: Floats, other: Floats) -> bool:
    """Whether two openings (2, 2) are through the same wall and overlap."""
    along = (one[1] - one[0]) / np.linalg.norm(one[1] - one[0])
    inward = np.array([-along[1], along[0]])
    s = (other - one[0]) @ along
    return bool(np.abs((other - one[0]) @ inward).max() < 0.6 and s.min() < np.linalg.norm(one[1] - one[0]) + 0.02
                and s.max() > -0.02)


def find_panes(window: Window, outlines: Mapping[str, Floats]) -> list[PlacedWindow]:
    """The window on each side of a room that is near and parallel to it and holds at least half of it."""
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
                found.append(PlacedWindow(window.name, room, side, (low + high) / 2, high - low))
    return found


def all_pairs(names: Iterable[str]) -> list[tuple[str, str]]:
    """Every two of them, in order."""
    return list(combinations(names, 2))
