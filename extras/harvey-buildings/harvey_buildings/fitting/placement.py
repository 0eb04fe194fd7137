"""Doors, wide openings, windows, furniture and stairs of a building file, fitted into walls and rooms."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
import shapely

from harvey_buildings.fitting.building_plan import Furnishing, Space, Steps, WallOpening, Window
from harvey_buildings.fitting.polygons import MAX_WALL_M, Floats, Stretch, find_facing_stretches, side_of

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


MAX_PUSH_M = 0.3
"""A thing that must be moved further is left out."""
MAX_PUSHES = 8
MIN_SIZE_M = 0.01
CLEARANCE_M = 2e-3
TRIM_M = 0.06
ROBOT_TOP_M = 1.4
"""A thing that begins higher is above the robot."""


def fit_into_room(thing: Furnishing, outline: Floats, space: Space) -> Furnishing | None:
    """The thing pushed out of walls and clipped to floor and ceiling; None where it does not fit."""
    boxes = tuple(kept for box in thing.boxes if (kept := _clip_to_room(box, space)) is not None)
    if not boxes:
        return None
    room = shapely.Polygon(outline).buffer(-CLEARANCE_M, join_style="mitre")
    return _push_inside(replace(thing, boxes=boxes), room) or _push_inside(replace(thing, boxes=_trim(boxes)), room)


def _trim(boxes: Steps) -> Steps:
    """The boxes without the outermost TRIM_M of their common bounds."""
    box = np.array(boxes)
    low, high = box[:, (0, 2)].min(axis=0) + TRIM_M, box[:, (1, 3)].max(axis=0) - TRIM_M
    cut = np.column_stack([np.clip(box[:, :2], low[0], high[0]), np.clip(box[:, 2:4], low[1], high[1]), box[:, 4:]])
    kept = [row for row in cut.tolist() if min(row[1] - row[0], row[3] - row[2]) >= MIN_SIZE_M]
    return tuple((x0, x1, y0, y1, z0, z1) for x0, x1, y0, y1, z0, z1 in kept)


def _push_inside(thing: Furnishing, room: shapely.Geometry) -> Furnishing | None:
    """The thing pushed into the room; None where it would move more than MAX_PUSH_M."""
    if not thing.boxes:
        return None
    at = np.round(thing.at, 4)
    for _ in range(MAX_PUSHES):
        corners = _corners(replace(thing, at=at))
        outside = [c for c in corners if not shapely.Point(c).within(room)]
        if not outside:
            return replace(thing, at=at)
        pushes = [shapely.get_coordinates(shapely.shortest_line(shapely.Point(c), room)) for c in outside]
        deepest = max((p[-1] - p[0] for p in pushes), key=lambda push: float(np.linalg.norm(push)))
        at = np.round(at + deepest + 1e-3 * np.sign(deepest) * (np.abs(deepest) > 1e-9), 4)
        if float(np.linalg.norm(at - thing.at)) > MAX_PUSH_M:
            return None
    return None


def _corners(thing: Furnishing) -> list[Floats]:
    """The four corners (2,) of its bounding rectangle on the plan [m]."""
    box = np.array(thing.boxes)
    c, s = math.cos(thing.turn_rad), math.sin(thing.turn_rad)
    turn = np.array([[c, -s], [s, c]])
    xs, ys = (box[:, 0].min(), box[:, 1].max()), (box[:, 2].min(), box[:, 3].max())
    return [thing.at + turn @ np.array([x, y]) for x in xs for y in ys]


def footprint(thing: Furnishing) -> Floats:
    """(4, 2) its bounding rectangle on the plan [m]."""
    a, b, d, c = _corners(thing)
    return np.array([a, b, c, d])


def is_obstacle(thing: Furnishing) -> bool:
    """Whether a robot could hit it; stairs do not count."""
    return thing.kind != "stairs" and bottom_m(thing) < ROBOT_TOP_M


def bottom_m(thing: Furnishing) -> float:
    """Height of its lowest box above the floor [m], once it is fitted into its room."""
    return min(box[4] for box in thing.boxes)


def _clip_to_room(box: tuple[float, ...], space: Space) -> tuple[float, float, float, float, float, float] | None:
    """A box clipped to the room's height, with z above its floor; None where nothing is left."""
    x0, x1, y0, y1, z0, z1 = box
    low, high = max(0.0, z0 - space.floor_m), min(space.height_m - CLEARANCE_M, z1 - space.floor_m)
    if min(x1 - x0, y1 - y0, high - low) < MIN_SIZE_M:
        return None
    return x0, x1, y0, y1, 0.0 if low < 0.03 else low, high


def build_bounding_boxes(points: Floats, steps: int) -> Steps:
    """Bounding boxes of points (n, 3) in a thing's own frame: one, or one for each part of its longer side."""
    low, high = points.min(axis=0), points.max(axis=0)
    if steps == 1:
        return ((low[0], high[0], low[1], high[1], low[2], high[2]),)
    axis = int(high[1] - low[1] > high[0] - low[0])
    marks = np.linspace(low[axis], high[axis], steps + 1)
    boxes = []
    for start, end in pairwise(marks):
        inside = points[(points[:, axis] >= start - 1e-6) & (points[:, axis] <= end + 1e-6)]
        top = float(inside[:, 2].max()) if len(inside) else float(low[2])
        if top - low[2] > MIN_SIZE_M:
            x = (start, end) if axis == 0 else (low[0], high[0])
            y = (start, end) if axis == 1 else (low[1], high[1])
            boxes.append((float(x[0]), float(x[1]), float(y[0]), float(y[1]), float(low[2]), top))
    return tuple(boxes)
