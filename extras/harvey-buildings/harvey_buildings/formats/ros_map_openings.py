"""Openings of a grid's floor between the ends of walls, wide ones too, and which of them part two rooms.

Whether floor that lies open to other floor is a room of its own is no question of the opening, but of the shapes on its
two sides. So all openings are closed beside which the floor widens, and then what they part is joined again: pieces of
a corridor, niches that are wider than deep, and rooms with no neck between them. Lounges and halls stay.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from harvey_buildings.fitting.building_plan import Floats

Mask = NDArray[np.bool_]
Cell = tuple[int, int]
MIN_OPENING_M, MAX_DOOR_M, MAX_OPENING_M = 0.5, 1.3, 4.5
ROUGH_M, TIP_CELLS = 0.1, 3.0
"""Roughness of walls, and how near to its two ends an opening's line may touch them."""
MIN_TURN_RAD, MAX_SLANT_RAD = np.radians(25.0), np.radians(40.0)
"""Turn of a wall at its end; and how far an opening may be from running on along or across both of its walls."""
MIN_FLARE_M, LOOK_M = 0.25, 0.75
"""By how much, and within what distance, the floor widens beyond both ends of a wide opening."""
MIN_ONE_FLARE = 0.75
"""By what share of its width the floor widens beyond one end of a corridor's mouth."""
MAX_CORRIDOR_M, MIN_LONG = 3.5, 4.0
"""A corridor is no wider, and longer by this, with four times the mean distance to its walls for the width."""
MIN_OPEN_M2 = 5.0
"""Floor of each of two rooms that lie open to one another."""
EVEN = 1.25
"""A niche that is about as open to corridors as to a room is theirs."""
MAX_BEND, MOUTH = 1.5, 2.0
"""Where a corridor bends it is about as wide behind as before; at its mouth the hall is so many times as wide."""


@dataclass(frozen=True, slots=True)
class Gap:
    """A gap in a wall.

    Attributes:
        start, end: cells (row, column) of the wall at its two ends.
        width: between them, in cells.
        depth: thickness of the wall, in cells.
        middle: (row, column) of its middle; the middle of a cell is a whole number.
    """

    start: Cell
    end: Cell
    width: float
    depth: float
    middle: tuple[float, float]


@dataclass(frozen=True, slots=True)
class WideOpening:
    """Floor between two walls' cells (row, column). ``sides``: on its right and left the floor widens beyond both ends
    (2), beyond one, as where a corridor bends or ends (1), or not (0). ``cost``: its width [cells], more if it slants.
    """

    start: Cell
    end: Cell
    width: float
    sides: tuple[int, int]
    cost: float

    @property
    def is_strong(self) -> bool:
        """Whether it lies between two ends of walls."""
        return max(self.sides) == 2


def close_openings(floor: Mask, cell_m: float) -> tuple[Mask, list[Gap]]:
    """The floor (rows, columns) with the openings closed that part rooms, and these."""
    cut, taken, used = floor.copy(), list[WideOpening](), set[Cell]()
    for opening in find_openings(floor, cell_m):
        cells = np.array(line_cells(opening.start, opening.end))
        steps = np.linalg.norm(cells - cells[0], axis=1)
        inner = cells[(steps >= TIP_CELLS) & (steps <= opening.width + 1 - TIP_CELLS)]
        is_again = any(_away(opening, other) <= TIP_CELLS for other in taken)
        if is_again or not cut[tuple(inner.T)].all() or (not opening.is_strong and {opening.start, opening.end} & used):
            continue
        used |= {opening.start, opening.end}
        cut[tuple(cells.T)] = False
        taken.append(opening)
    parts = _Parts(floor, cut, taken, cell_m)
    parts.join_all()
    result, gaps = floor.copy(), []
    for opening in parts.parting():
        result[tuple(np.array(line_cells(opening.start, opening.end)).T)] = False
        (r0, c0), (r1, c1) = opening.start, opening.end
        gaps.append(Gap(opening.start, opening.end, opening.width, 1.0, ((r0 + r1) / 2, (c0 + c1) / 2)))
    return result, gaps


def _away(one: WideOpening, other: WideOpening) -> float:
    """How far the ends of two openings are from one another [cells]: those on the two faces of a wall are near."""
    a, b, c, d = (np.array(cell) for cell in (one.start, one.end, other.start, other.end))
    return float(min(max(np.abs(a - c).max(), np.abs(b - d).max()), max(np.abs(a - d).max(), np.abs(b - c).max())))


def find_openings(floor: Mask, cell_m: float) -> list[WideOpening]:
    """Openings from each end of a wall to others and to the wall opposite, strong ones and then narrow ones first."""
    corners, faces = _find_wall_ends(floor, ROUGH_M / cell_m)
    nearest = ndimage.distance_transform_edt(floor, return_distances=False, return_indices=True)
    at = np.rint(corners).astype(int).clip(0, np.array(floor.shape) - 1)
    cells = np.column_stack([indices[tuple(at.T)] for indices in nearest])
    points, most = shapely.points(corners), MAX_OPENING_M / cell_m
    pairs = shapely.STRtree(points).query(points, predicate="dwithin", distance=most).T
    found = [_open_between(floor, cells[a], cells[b], faces[[a, b]], cell_m) for a, b in pairs if a < b]
    for cell, walls in zip(cells, faces, strict=True):
        for across in walls[:, ::-1] * (1.0, -1.0):
            free = _are_floor(floor, cell + across * np.arange(TIP_CELLS, most, 0.5)[:, None])
            if not free.all():
                end = np.rint(cell + across * (TIP_CELLS + 0.5 * int(np.argmin(free)))).astype(int)
                found.append(_open_between(floor, cell, end, walls[None], cell_m))
    return sorted({opening for opening in found if opening is not None},
                  key=lambda o: (not o.is_strong, o.cost, o.start, o.end))


def _find_wall_ends(floor: Mask, rough: float) -> tuple[Floats, Floats]:
    """(n, 2) rows and columns where walls end or turn into the floor, and (n, 2, 2) directions of their two faces."""
    ends, faces = [np.zeros((0, 2))], [np.zeros((0, 2, 2))]
    for part in shapely.get_parts(shapely.orient_polygons(trace(floor).simplify(rough))):
        for ring in (part.exterior, *part.interiors):
            points = shapely.get_coordinates(ring)[:-1, ::-1]
            before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
            turn = np.arctan2(before[:, 1] * after[:, 0] - before[:, 0] * after[:, 1], (before * after).sum(axis=1))
            both = np.stack([before, after], axis=1)[turn < -MIN_TURN_RAD]
            ends.append(points[turn < -MIN_TURN_RAD])
            faces.append(both / np.linalg.norm(both, axis=2, keepdims=True))
    return np.concatenate(ends), np.concatenate(faces)


def trace(room: Mask) -> shapely.Geometry:
    """The border of cells, as polygons in columns and rows; the middle of a cell is a whole number."""
    edge = np.diff(np.pad(room, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, first = np.nonzero(edge == 1)
    last = np.nonzero(edge == -1)[1]
    return shapely.union_all(shapely.box(first - 0.5, rows - 0.5, last - 0.5, rows + 0.5))


def _open_between(
    floor: Mask, start: NDArray[np.int64], end: NDArray[np.int64], walls: Floats, cell_m: float,
) -> WideOpening | None:
    """The opening between two cells; None where it slants, is no floor, or the floor does not widen beside it.

    Args:
        walls: (1 or 2, 2, 2) directions of the faces of the walls that end there.
    """
    length = float(np.linalg.norm(end - start))
    if not MIN_OPENING_M <= (length - 1) * cell_m <= MAX_OPENING_M:
        return None
    along = (end - start) / length
    sine = np.abs(walls[..., 0] * along[1] - walls[..., 1] * along[0]).clip(0.0, 1.0)
    slant = float(np.minimum(np.arcsin(sine), np.arccos(sine)).min(axis=1).max())
    steps = np.arange(TIP_CELLS, length - TIP_CELLS + 0.1, 0.5)[:, None]
    if slant > MAX_SLANT_RAD or not _are_floor(floor, along * steps + start).all():
        return None
    across = np.array([along[1], -along[0]])
    flares = [_flare(floor, (start + end) / 2, along, sign * across, length, cell_m) for sign in (1, -1)]
    if len(walls) == 1:
        flares = [min(flare, 1) for flare in flares]
    if max(flares) < 2:
        ahead = [np.arange(-0.4, 0.4, 0.5 / length)[:, None] * length * along + across * sign * length / 2
                 for sign in (-1, 1)]
        flares = [flare if _are_floor(floor, (start + end) / 2 + strip).mean() > 0.9 else 0
                  for flare, strip in zip(flares, ahead, strict=True)]
    if not any(flares):
        return None
    return WideOpening((int(start[0]), int(start[1])), (int(end[0]), int(end[1])), length - 1, (flares[0], flares[1]),
                   length / float(np.cos(2 * slant)))


def _flare(floor: Mask, middle: Floats, along: Floats, ahead: Floats, length: float, cell_m: float) -> int:
    """Whether the floor ahead widens beyond both ends (2), beyond one (1), or not (0)."""
    near = max(2, round(min(length / 2, LOOK_M / cell_m)))
    reach = np.arange(0.0, 1.5 * length + MIN_FLARE_M / cell_m + 0.5, 0.5)
    most = np.zeros(2)
    for step in range(1, round(length) + 1):
        rays = [_are_floor(floor, middle + ahead * step + sign * along * reach[:, None]) for sign in (-1, 1)]
        if not rays[0][0]:
            break
        far = [reach[-1] if free.all() else reach[int(np.argmin(free))] for free in rays]
        most = np.maximum(most, np.array(far) - length / 2)
        if step <= near and most.min() >= MIN_FLARE_M / cell_m:
            return 2
    return int(most.max() >= MIN_ONE_FLARE * length)


def _are_floor(floor: Mask, points: Floats) -> Mask:
    """(n,) whether points (n, 2) in rows and columns are floor; what is outside the grid is as its border."""
    at = np.rint(points).astype(int).clip(0, np.array(floor.shape) - 1)
    return np.asarray(floor[tuple(at.T)])


class _Parts:
    """The parts into which openings cut a floor, which are joined again one by one."""

    def __init__(self, floor: Mask, cut: Mask, openings: list[WideOpening], cell_m: float) -> None:
        labels, count = ndimage.label(cut)
        numbers = np.arange(count + 1)
        distance = ndimage.distance_transform_edt(floor)  # to the walls: an opening is none
        self.to = numbers.copy()
        self.area = np.bincount(labels.ravel(), minlength=count + 1) * cell_m**2
        self.reach = np.asarray(ndimage.sum(distance, labels, numbers)) * cell_m**3
        self.is_corridor = np.array([k > 0 and self._is_long(k) for k in numbers])
        self.cell_m = cell_m
        self.between = [(opening, *_beside(opening, labels)) for opening in openings]

    def join_all(self) -> None:
        """Join parts by the first rule that joins any, until none does."""
        rules = (self._bends, self._pieces, self._corridors, self._niches, self._rooms)
        while live := [(opening, int(self.to[a]), int(self.to[b])) for opening, a, b in self.between
                       if a and b and self.to[a] != self.to[b]]:
            pair = next((pair for rule in rules for pair in rule(live)), None)
            if pair is None:
                break
            kept, gone = pair
            self.to[self.to == gone] = kept
            self.area[kept] += self.area[gone]
            self.reach[kept] += self.reach[gone]
            self.is_corridor[kept] |= self.is_corridor[gone]

    def parting(self) -> list[WideOpening]:
        """The openings that part two."""
        return [opening for opening, a, b in self.between if a and b and self.to[a] != self.to[b]]

    def _width(self, *parts: int) -> float:
        """Four times the mean distance to the walls [m]: a strip's width."""
        return 4.0 * sum(float(self.reach[k]) for k in parts) / sum(float(self.area[k]) for k in parts)

    def _is_long(self, *parts: int) -> bool:
        width = self._width(*parts)
        return width <= MAX_CORRIDOR_M and sum(float(self.area[k]) for k in parts) >= MIN_LONG * width**2

    def _bends(self, live: list[tuple[WideOpening, int, int]]) -> Iterator[tuple[int, int]]:
        """Pieces about as wide that make a corridor together, round a corner or through a neck between things."""
        for opening, a, b in live:
            is_even = self._ratio(a, b) <= MAX_BEND and self._is_long(a, b)
            is_neck = min(opening.sides) == 2 and opening.width * self.cell_m > MAX_DOOR_M
            if is_even and (is_neck or not opening.is_strong):
                self.is_corridor[a] = True
                yield a, b

    def _pieces(self, live: list[tuple[WideOpening, int, int]]) -> Iterator[tuple[int, int]]:
        """What lies open to one another along a wall that ends, and is no corridor: the most alike first."""
        found = [(self._ratio(a, b), a, b) for opening, a, b in live
                 if not opening.is_strong and not self.is_corridor[[a, b]].any() and self._ratio(a, b) < MOUTH]
        yield from ((a, b) for _, a, b in sorted(found)[:1])

    def _corridors(self, live: list[tuple[WideOpening, int, int]]) -> Iterator[tuple[int, int]]:
        """Corridors that lie open to one another."""
        yield from ((a, b) for _, a, b in live if self.is_corridor[[a, b]].all())

    def _niches(self, live: list[tuple[WideOpening, int, int]]) -> Iterator[tuple[int, int]]:
        """What is wider open than deep, the smallest first, and corridors open along half their length: to corridors
        or to a room, whichever it is more open to."""
        open_m: dict[int, dict[int, float]] = {}
        for opening, *pair in live:
            for part, other in (pair, pair[::-1]):
                beside = open_m.setdefault(part, {})
                beside[other] = beside.get(other, 0.0) + opening.width * self.cell_m
        niches = [k for k, beside in open_m.items() if (
            max(beside.values()) > 0.5 * self.area[k] / self._width(k) if self.is_corridor[k]
            else self.area[k] < sum(beside.values())**2)]
        if niches:
            part = min(niches, key=lambda k: (self.area[k], k))
            ways_m = EVEN * sum(m for k, m in open_m[part].items() if self.is_corridor[k])
            yield max(open_m[part], key=lambda k: (ways_m if self.is_corridor[k] else open_m[part][k],
                                                   open_m[part][k], -k)), part

    def _rooms(self, live: list[tuple[WideOpening, int, int]]) -> Iterator[tuple[int, int]]:
        """Rooms with neither a doorway between them nor a neck into one twice as wide, and those too small for one."""
        for opening, a, b in live:
            narrow = min(a, b, key=self._width)
            is_mouth = self._ratio(a, b) >= MOUTH
            is_neck = opening.is_strong and min(opening.sides) > 0 and min(self.area[[a, b]]) >= MIN_OPEN_M2
            is_kept = is_neck and (is_mouth or opening.width * self.cell_m <= MAX_DOOR_M)
            if not self.is_corridor[[a, b]].any() and not is_kept and not (is_mouth and self._is_long(narrow)):
                yield a, b

    def _ratio(self, a: int, b: int) -> float:
        """How many times as wide the wider is."""
        one, other = sorted((self._width(a), self._width(b)))
        return other / one


def _beside(opening: WideOpening, labels: NDArray[np.int32]) -> tuple[int, int]:
    """The parts on the two sides of an opening, its middle's nearest; 0 where there is none within 11 cells."""
    start, end = np.array(opening.start, float), np.array(opening.end, float)
    along = (end - start) / np.linalg.norm(end - start)
    found = []
    for across in (np.array([along[1], -along[0]]), np.array([-along[1], along[0]])):
        at = np.rint((start + end) / 2 + across * np.arange(1, 12)[:, None]).astype(int)
        numbers = labels[tuple(at.clip(0, np.array(labels.shape) - 1).T)]
        found.append(int(numbers[int(np.argmax(numbers > 0))]))
    return found[0], found[1]


def line_cells(start: Cell, end: Cell) -> list[Cell]:
    """The cells of a line, joined by their sides, so that floor joined by sides does not pass."""
    (r0, c0), (r1, c1) = start, end
    count = 2 * max(abs(r1 - r0), abs(c1 - c0), 1)
    cells = [(round(r0 + (r1 - r0) * k / count), round(c0 + (c1 - c0) * k / count)) for k in range(count + 1)]
    filled = []
    for (a, b), (c, d) in pairwise(cells):
        filled += [(a, b), (c, b)] if a != c and b != d else [(a, b)]
    return [*filled, cells[-1]]
