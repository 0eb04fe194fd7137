"""The floor of a grid parted into rooms at the gaps of its walls: doorways and wide openings.

A stretch of corridor between two doors looks like a gap too, as long as the doors are open. So gaps are closed from the
narrow to the wide, and a wider one counts only where the floor with the narrower ones closed still widens beside it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from harvey_buildings.building_plan import Floats

Mask = NDArray[np.bool_]
MIN_DOOR_M, MAX_DOOR_M = 0.5, 1.3
MAX_MOUTH_M, MAX_WIDE_M = 2.6, 4.5
MAX_DEPTH_M, MAX_WIDE_DEPTH_M, THIN_M = 0.9, 0.6, 0.4
"""Depth of a gap: of a door through a thick wall, and of a wide opening. What is deeper is a corridor.
A wall beside a wide opening that is thicker than THIN_M is furniture unless it is MIN_SLENDER times as long."""
JAMB_M = 0.15
"""How far the ends of a gap may lie from those of its first row."""
MIN_SLENDER = 2.0
LOOK_M = 0.3
"""How far before and behind a gap the floor is looked for that reaches further."""
MIN_STUB_M, MIN_STUB_SHARE = 0.25, 0.3
"""Length of wall beside a gap with floor on both of its faces: at least this, and this share of the gap's width."""
MIN_TALLER = 1.35
"""The floor on both sides of a slanting gap has this many times its clearance."""

MIN_SLANT = 0.25
"""Rise of a slanting gap over its run along the nearer axis: 14 degrees."""

HALL_RADII_M = (2.5, 1.75)
"""A hall holds a circle of such a radius; a corridor is narrower by MAX_MOUTH_SHARE and longer than wide."""
MAX_MOUTH_SHARE, MIN_LONGER = 1.1, 2.0
ROUGH_CELLS = 2
"""Roughness of the walls."""


@dataclass(frozen=True, slots=True)
class Gap:
    """A gap in a wall.

    Attributes:
        start, end: cells (row, column) of the wall at its two ends.
        width: between them, in cells.
        depth: thickness of the wall, in cells.
        middle: (row, column) of its middle; the middle of a cell is a whole number.
    """

    start: tuple[int, int]
    end: tuple[int, int]
    width: float
    depth: float
    middle: tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Block:
    """Free runs of consecutive rows with nearly the same ends: rows, and columns from first to before last."""

    rows: tuple[int, int]
    first: int
    last: int
    is_turned: bool

    @property
    def width(self) -> int:
        """Columns."""
        return self.last - self.first

    @property
    def size(self) -> int:
        """Width and twice the depth: of two gaps across one another, the one in the thinner wall is real."""
        return self.width + 2 * (self.rows[1] - self.rows[0])


def close_gaps(floor: Mask, cell_m: float) -> tuple[Mask, list[Gap]]:
    """The floor with its gaps closed, and the gaps, the narrow ones first.

    Args:
        floor: (rows, columns) whose walls run mostly along the grid's axes.
    """
    cut, gaps = floor.copy(), []
    blocks = [block for is_turned in (False, True) for block in _find_blocks(floor, cell_m, is_turned)]
    for block in sorted(blocks, key=lambda b: b.size):
        gaps += _close(cut, block, cell_m)
    gaps += _close_slanting(cut, cell_m)
    for radius_m in HALL_RADII_M:
        gaps += _close_mouths(cut, radius_m / cell_m)
    return cut, gaps


def _find_blocks(floor: Mask, cell_m: float, is_turned: bool) -> Iterator[_Block]:
    """Blocks of free runs as wide as doors and openings, and no deeper than walls."""
    grid = floor.T if is_turned else floor
    edge = np.diff(np.pad(grid, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, first = np.nonzero(edge == 1)
    last = np.nonzero(edge == -1)[1]
    keep = ((last - first) * cell_m >= MIN_DOOR_M) & ((last - first) * cell_m <= MAX_WIDE_M)
    jamb = max(1, round(JAMB_M / cell_m))
    growing: list[list[tuple[int, int, int]]] = []
    done: list[list[tuple[int, int, int]]] = []
    for run in zip(rows[keep].tolist(), first[keep].tolist(), last[keep].tolist(), strict=True):
        for block in [b for b in growing if b[-1][0] < run[0] - 1]:
            growing.remove(block)
            done.append(block)
        for block in growing:
            if block[-1][0] == run[0] - 1 and abs(block[0][1] - run[1]) <= jamb and abs(block[0][2] - run[2]) <= jamb:
                block.append(run)
                break
        else:
            growing.append([run])
    for block in done + growing:
        low, high = max(run[1] for run in block), min(run[2] for run in block)
        width_m, depth_m = (high - low) * cell_m, len(block) * cell_m
        if width_m >= MIN_DOOR_M and depth_m <= (MAX_DEPTH_M if width_m <= MAX_DOOR_M else MAX_WIDE_DEPTH_M):
            yield _Block((block[0][0], block[-1][0]), low, high, is_turned)


def _close(cut: Mask, block: _Block, cell_m: float) -> list[Gap]:
    """Close a block in the floor where it still is a gap of a wall, and give the gap."""
    grid = cut.T if block.is_turned else cut
    row = (block.rows[0] + block.rows[1]) // 2
    if not grid[row, block.first : block.last].all():
        return []
    before, after = _widening(grid, block, -1, cell_m), _widening(grid, block, 1, cell_m)
    stub = int(np.minimum(before, after).sum())
    is_beside_hall = block.width * cell_m <= MAX_MOUTH_M and max(before.sum(), after.sum()) >= block.width
    share = 0.0 if is_beside_hall else MIN_STUB_SHARE
    if min(before.min(), after.min()) < 0 or stub * cell_m < max(MIN_STUB_M, share * block.width * cell_m):
        return []
    depth = block.rows[1] - block.rows[0] + 1
    if block.width * cell_m > MAX_DOOR_M and depth * cell_m > THIN_M and stub < MIN_SLENDER * depth:
        return []
    first, last = _run_at(grid, row, (block.first + block.last) // 2)
    grid[row, first:last] = False
    ends = (row, first - 1), (row, last)
    middle = (block.rows[0] + block.rows[1]) / 2, (block.first + block.last - 1) / 2
    start, end = ((r, c) if not block.is_turned else (c, r) for r, c in ends)
    return [Gap(start, end, block.width, depth,
                middle if not block.is_turned else middle[::-1])]


def _widening(grid: Mask, block: _Block, step: int, cell_m: float) -> NDArray[np.int64]:
    """(2,) by how many cells the floor beside a block reaches further to the left and right; -1 where there is none."""
    row = block.rows[0] if step < 0 else block.rows[1]
    middle, best = (block.first + block.last) // 2, np.array([-1, -1])
    for away in range(1, max(2, round(LOOK_M / cell_m)) + 1):
        at = row + step * away
        if not 0 <= at < len(grid) or not grid[at, middle]:
            break
        first, last = _run_at(grid, at, middle)
        best = np.maximum(best, [block.first - first, last - block.last])
    return best


def _run_at(grid: Mask, row: int, column: int) -> tuple[int, int]:
    """First column, and column after the last, of the free run that holds a cell."""
    walls = np.flatnonzero(~grid[row])
    at = int(np.searchsorted(walls, column))
    return (int(walls[at - 1]) + 1 if at else 0), (int(walls[at]) if at < len(walls) else grid.shape[1])


def _close_slanting(cut: Mask, cell_m: float) -> list[Gap]:
    """Close doors in walls of any direction: where two basins of the distance to the walls meet in a narrow place."""
    distance, nearest = ndimage.distance_transform_edt(cut, return_indices=True)
    smooth = ndimage.gaussian_filter(distance, 1.0)
    tops = (smooth == ndimage.maximum_filter(smooth, size=max(3, round(0.5 / cell_m)))) & (distance * cell_m > 0.3)
    seeds, count = ndimage.label(tops, np.ones((3, 3)))
    if count < 2:
        return []
    basins = _flood(distance, seeds)
    tallest = np.asarray(ndimage.maximum(distance, seeds, np.arange(count + 1)))
    joined = list(range(count + 1))

    def root(basin: int) -> int:
        while joined[basin] != basin:
            basin = joined[basin]
        return basin

    gaps = []
    for (a, b), (clear, row, column) in sorted(_find_saddles(basins, distance).items(),
                                               key=lambda item: (-item[1][0], item[0])):
        one, other = root(a), root(b)
        if one == other:
            continue
        width_m = 2 * clear * cell_m
        if MIN_DOOR_M <= width_m <= MAX_DOOR_M and min(tallest[one], tallest[other]) >= MIN_TALLER * clear:
            gap = _cross(distance, nearest, row, column)
            if gap is not None and gap.width * cell_m <= 1.2 * MAX_DOOR_M and _is_slanting(gap):
                gaps.append(gap)
                for r, c in _line(gap):
                    cut[r, c] = False
                continue
        joined[other], tallest[one] = one, max(tallest[one], tallest[other])
    return gaps


def _close_mouths(cut: Mask, radius: float) -> list[Gap]:
    """Close the mouths of corridors that open into a hall, which holds a circle of so many cells."""
    core = ndimage.distance_transform_edt(cut) > radius
    if not core.any():
        return []
    near = cut & (ndimage.distance_transform_edt(~core) <= radius + ROUGH_CELLS)
    hall = ndimage.binary_propagation(core, mask=near)  # what is near through a thin wall is another room
    rest, count = ndimage.label(cut & ~hall)
    areas = np.bincount(rest.ravel(), minlength=count + 1)
    beside = ndimage.binary_dilation(hall) & (rest > 0)
    borders, number = ndimage.label(beside, np.ones((3, 3)))
    distance, nearest = ndimage.distance_transform_edt(cut, return_indices=True)
    gaps = []
    for index in range(1, number + 1):
        cells = np.argwhere(borders == index)
        ends = cells[[int(np.argmin(d)) for d in _along(cells)]]
        chord = float(np.linalg.norm(ends[1] - ends[0]))
        area = areas[rest[tuple(cells[0])]]
        if not 4 < chord <= MAX_MOUTH_SHARE * radius or area < MIN_LONGER * chord**2:
            continue
        if max(distance[tuple(end)] for end in ends) > 3 + ROUGH_CELLS:
            continue
        walls = [nearest[:, end[0], end[1]] for end in ends]
        gap = Gap((int(walls[0][0]), int(walls[0][1])), (int(walls[1][0]), int(walls[1][1])),
                  float(np.linalg.norm(walls[1] - walls[0])) - 1, 1.0,
                  (float(walls[0][0] + walls[1][0]) / 2, float(walls[0][1] + walls[1][1]) / 2))
        if gap.width > MAX_MOUTH_SHARE * radius:
            continue
        gaps.append(gap)
        for r, c in _line(gap):
            cut[r, c] = False
    return gaps


def _along(cells: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Coordinates of cells along their longest extent, and against it."""
    centred = cells - cells.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    return centred @ axis, -(centred @ axis)


def _is_slanting(gap: Gap) -> bool:
    """Whether a gap runs along none of the axes: those that do are found as blocks, or are none of a wall."""
    rise, run = sorted((abs(gap.end[0] - gap.start[0]), abs(gap.end[1] - gap.start[1])))
    return rise > MIN_SLANT * run


def _flood(distance: NDArray[np.float64], seeds: NDArray[np.int32]) -> NDArray[np.int32]:
    """(rows, columns) the basin of each free cell: seeds grow into what is widest first (F. Meyer's watershed)."""
    wide = distance.shape[1] + 2
    basins = _grow(np.pad(distance, 1).ravel(), np.pad(seeds, 1).ravel(), wide)
    return basins.reshape(-1, wide)[1:-1, 1:-1]


@njit(cache=True)
def _grow(heights: NDArray[np.float64], basins: NDArray[np.int32], wide: int) -> NDArray[np.int32]:
    """The basins of a flat grid with a border, grown where it is; ``wide`` columns."""
    ahead = [(-heights[at], at) for at in range(len(basins)) if basins[at]]
    heapify(ahead)
    while ahead:
        _, at = heappop(ahead)
        for beside in (at - wide, at - 1, at + 1, at + wide):
            if heights[beside] > 0.0 and not basins[beside]:
                basins[beside] = basins[at]
                heappush(ahead, (-heights[beside], beside))
    return basins


def _find_saddles(basins: NDArray[np.int32], distance: NDArray[np.float64],
                  ) -> dict[tuple[int, int], tuple[float, int, int]]:
    """The clearance, row and column of the widest place where two basins meet."""
    saddles: dict[tuple[int, int], tuple[float, int, int]] = {}
    for dr, dc in ((0, 1), (1, 0)):
        one, other = basins[: basins.shape[0] - dr, : basins.shape[1] - dc], basins[dr:, dc:]
        for r, c in zip(*np.nonzero((one != other) & (one > 0) & (other > 0)), strict=True):
            pair = (int(min(one[r, c], other[r, c])), int(max(one[r, c], other[r, c])))
            if distance[r, c] > saddles.get(pair, (-1.0, 0, 0))[0]:
                saddles[pair] = float(distance[r, c]), int(r), int(c)
    return saddles


def _cross(distance: NDArray[np.float64], nearest: NDArray[np.int32], row: int, column: int) -> Gap | None:
    """The shortest line through a saddle: from the nearest wall to one opposite it."""
    at = np.array([row, column])
    start = nearest[:, row, column]
    ahead = (at - start) / max(float(np.linalg.norm(at - start)), 1e-9)
    best: tuple[float, NDArray[np.int64]] | None = None
    for angle in np.radians(np.arange(-50, 51, 5)):
        c, s = np.cos(angle), np.sin(angle)
        ray = np.array([ahead[0] * c - ahead[1] * s, ahead[0] * s + ahead[1] * c])
        for length in np.arange(1.0, 3.0 * distance[row, column] + 3):
            cell = (at + length * ray).round().astype(int)
            if (cell < 0).any() or (cell >= distance.shape).any():
                break
            if distance[cell[0], cell[1]] == 0:
                if best is None or length < best[0]:
                    best = length, cell
                break
    if best is None:
        return None
    width = float(np.linalg.norm(best[1] - start)) - 1
    middle = (start + best[1]) / 2
    return Gap((int(start[0]), int(start[1])), (int(best[1][0]), int(best[1][1])), width, 1.0,
               (float(middle[0]), float(middle[1])))


def _line(gap: Gap) -> list[tuple[int, int]]:
    """The cells of a gap, joined by their sides, so that floor joined by sides does not pass."""
    (r0, c0), (r1, c1) = gap.start, gap.end
    count = 2 * max(abs(r1 - r0), abs(c1 - c0), 1)
    cells = [(round(r0 + (r1 - r0) * k / count), round(c0 + (c1 - c0) * k / count)) for k in range(count + 1)]
    filled = []
    for (a, b), (c, d) in pairwise(cells):
        filled += [(a, b), (c, b)] if a != c and b != d else [(a, b)]
    return [*filled, cells[-1]]


Labels = NDArray[np.int32]
MIN_ROOM_M2, MIN_CLEARANCE_M = 1.5, 0.3
RAY_M = 0.3
"""Free strips narrower than this are rays of the scanner through windows, or gaps in a wall's picture."""
LEG_M = 0.5
"""Things on the floor up to this size, that stand free, are no walls."""
MIN_HOLLOW_M, MIN_FILLED, RIM_M = 0.15, 0.6, 0.1
"""Of a hollow thing: its sides at least, the share of its bounds that it fills, and the thickness of its rim."""
STRAIGHT_M = 0.8
MAX_FURNITURE_M, MIN_FURNITURE_THICK_M = 2.5, 0.4
"""Larger things that stand free are furniture where they are no longer, and no thinner, than this."""
REACH_M = 0.6
"""How far beside a gap its rooms are looked for."""


def clean_floor(free: Mask, cell_m: float) -> tuple[Mask, list[tuple[slice, slice]]]:
    """The floor without rays, and the bounds of the things that stand free in it, which are floor here."""
    around, count = ndimage.label(~free, np.ones((3, 3)))
    clear = ndimage.distance_transform_edt(np.pad(~free, 1))[1:-1, 1:-1]
    thick = 2 * np.asarray(ndimage.maximum(clear, around, np.arange(count + 1))) * cell_m
    things = []
    is_thing = np.zeros(count + 1, bool)
    for number, bounds in enumerate(ndimage.find_objects(around), 1):
        sides_m = sorted((s.stop - s.start) * cell_m for s in bounds)
        if sides_m[1] <= LEG_M or (sides_m[1] <= MAX_FURNITURE_M and thick[number] >= MIN_FURNITURE_THICK_M):
            touches = any(s.start == 0 or s.stop == n for s, n in zip(bounds, free.shape, strict=True))
            is_thing[number] = not touches
            if not touches:
                things.append(bounds)
    floor = free | is_thing[around] | _find_hollow(free, cell_m)
    radius = max(1, round(RAY_M / 2 / cell_m))
    inside = ndimage.distance_transform_edt(np.pad(floor, 1))[1:-1, 1:-1] > radius
    opened = ndimage.distance_transform_edt(~inside) <= radius if inside.any() else inside
    return np.asarray(opened & floor, dtype=bool), things


def _find_hollow(free: Mask, cell_m: float) -> Mask:
    """Small things that are drawn hollow and may touch a wall, such as bins: the free cells in them and their rims.

    What is part of a straight run of STRAIGHT_M or more stays: it is the wall behind.
    """
    pockets, count = ndimage.label(free)
    keep = np.zeros(count + 1, bool)
    for number, bounds in enumerate(ndimage.find_objects(pockets), 1):
        sides_m = [(s.stop - s.start) * cell_m for s in bounds]
        filled = float((pockets[bounds] == number).mean())
        keep[number] = min(sides_m) >= MIN_HOLLOW_M and max(sides_m) <= LEG_M and filled >= MIN_FILLED
    if not keep.any():
        return np.zeros_like(free)
    run = np.ones((1, round(STRAIGHT_M / cell_m)), bool)
    straight = ndimage.binary_opening(~free, run) | ndimage.binary_opening(~free, run.T)
    hollow = ndimage.binary_dilation(keep[pockets], np.ones((3, 3)), max(1, round(RIM_M / cell_m)))
    return np.asarray(hollow & ~straight, dtype=bool)


def part_rooms(floor: Mask, cell_m: float) -> tuple[Labels, list[Gap]]:
    """(rows, columns) number of the room of each cell, 0 outside, and the gaps that part two rooms."""
    cut, gaps = close_gaps(floor, cell_m)
    labels, count = ndimage.label(cut)
    labels = _join_small(np.asarray(labels, dtype=np.int32), count, gaps, cell_m)
    _, nearest = ndimage.distance_transform_edt(labels == 0, return_indices=True)
    beside = ndimage.binary_dilation(labels > 0, iterations=3)
    labels = np.where(floor & (labels == 0) & beside, labels[nearest[0], nearest[1]], labels)
    return labels, [gap for gap in gaps if len(rooms_beside(gap, labels, cell_m)) == 2]


def rooms_beside(gap: Gap, labels: Labels, cell_m: float) -> tuple[int, ...]:
    """The rooms on the two sides of a gap, first that to the right of the way from its start to its end; () unless
    they differ. (To the right in rows down and columns to the right.)"""
    start, end = np.array(gap.start, float), np.array(gap.end, float)
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1.0)
    across = np.array([along[1], -along[0]])
    found = []
    for sign in (1, -1):
        steps = np.arange(1.0, REACH_M / cell_m + 3)[:, None]
        at = ((start + end) / 2 + sign * across * steps).round().astype(int)
        at = at[(at >= 0).all(axis=1) & (at < labels.shape).all(axis=1)]
        numbers = labels[at[:, 0], at[:, 1]]
        numbers = numbers[numbers > 0]
        if not len(numbers):
            return ()
        found.append(int(np.bincount(numbers).argmax()))
    return tuple(found) if len(set(found)) == 2 else ()


def _join_small(labels: Labels, count: int, gaps: list[Gap], cell_m: float) -> Labels:
    """Parts too small to be rooms joined to what they meet over the widest gap; left out where they meet nothing."""
    numbers = np.arange(count + 1)
    clear = np.asarray(ndimage.maximum(ndimage.distance_transform_edt(labels > 0), labels, numbers)) * cell_m
    area = np.bincount(labels.ravel(), minlength=count + 1) * cell_m**2
    to = numbers.copy()
    for gap in sorted(gaps, key=lambda g: -g.width):
        pair = tuple(int(to[k]) for k in rooms_beside(gap, labels, cell_m))
        if len(pair) != 2 or pair[0] == pair[1]:
            continue
        if any(area[k] < MIN_ROOM_M2 or clear[k] < MIN_CLEARANCE_M for k in pair):
            gone, kept = sorted(pair, key=lambda k: (area[k], k))
            to[to == gone] = kept
            area[kept] += area[gone]
            clear[kept] = max(clear[kept], clear[gone])
    is_small = (area < MIN_ROOM_M2) | (clear < MIN_CLEARANCE_M)
    is_small[0] = True
    return np.asarray(np.where(is_small[to], 0, to)[labels], dtype=np.int32)
