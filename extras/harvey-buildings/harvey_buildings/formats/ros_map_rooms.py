"""The floor of a grid parted into rooms at the gaps of its walls: doorways and wide openings.

Gaps along the grid's axes are closed from the narrow to the wide. A stretch of corridor between two open doors looks
like a gap too; so one counts only where the floor still widens beside it when all others are closed. What else is
open between ends of walls is judged by its shapes (:mod:`.ros_map_openings`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from harvey_buildings.formats.ros_map_openings import MAX_DOOR_M, MIN_OPEN_M2, Gap, close_openings

Mask = NDArray[np.bool_]
Labels = NDArray[np.int32]
Cells = tuple[NDArray[np.int64], NDArray[np.int64]]
MIN_DOOR_M = 0.5
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
    cut, gaps = _close_blocks(floor, cell_m, MAX_WIDE_M)
    cut, openings = close_openings(cut, cell_m)
    return cut, gaps + openings


def _close_blocks(floor: Mask, cell_m: float, widest_m: float) -> tuple[Mask, list[Gap]]:
    """The floor with the gaps along the axes closed that are gaps still where all others are closed, and these."""
    cut = floor.copy()
    blocks = [block for is_turned in (False, True) for block in _find_blocks(floor, cell_m, is_turned)
              if block.width * cell_m <= widest_m]
    closed = [(block, made) for block in sorted(blocks, key=lambda b: b.size) if (made := _close(cut, block, cell_m))]
    while True:
        shares = [_share_without(cut, block, cells, cell_m) for block, (_, cells) in closed]
        weak = [k for k in np.argsort(shares, kind="stable").tolist() if shares[k] < 1.0]
        opened = set()
        for k in weak:
            block, (_, cells) = closed[k]
            if _share_without(cut, block, cells, cell_m) < 1.0:
                cut[cells] = True
                opened.add(k)
        if not opened:
            return cut, [gap for _, (gap, _) in closed]
        closed = [one for k, one in enumerate(closed) if k not in opened]


def _share_without(cut: Mask, block: _Block, cells: Cells, cell_m: float) -> float:
    """The wall beside a closed block where it is open, as a share of what is needed."""
    cut[cells] = True
    share, _ = _stub(cut.T if block.is_turned else cut, block, cell_m)
    cut[cells] = False
    return share


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


def _close(cut: Mask, block: _Block, cell_m: float) -> tuple[Gap, Cells] | None:
    """Close a block in the floor, where it still is a gap of a wall, and give the gap and its cells."""
    grid = cut.T if block.is_turned else cut
    row, column = (block.rows[0] + block.rows[1]) // 2, (block.first + block.last) // 2
    if not grid[row, block.first : block.last].all():
        return None
    share, stub = _stub(grid, block, cell_m)
    depth = block.rows[1] - block.rows[0] + 1
    is_thick = block.width * cell_m > MAX_DOOR_M and depth * cell_m > THIN_M and stub < MIN_SLENDER * depth
    if share < 1.0 or is_thick:
        return None
    first, last = _run_at(grid, row, column)
    throat = np.zeros_like(grid)
    for at in range(block.rows[0], block.rows[1] + 1):
        low, high = _run_at(grid, at, column)
        throat[at, low:high] = grid[at, column] and high - low <= block.width + 2 * JAMB_M / cell_m
    ends = (row, first - 1), (row, last)
    middle = (block.rows[0] + block.rows[1]) / 2, (block.first + block.last - 1) / 2
    start, end = ends if not block.is_turned else (ends[0][::-1], ends[1][::-1])
    cells = np.nonzero(throat.T if block.is_turned else throat)
    cut[cells] = False
    return Gap(start, end, block.width, depth, middle[::-1] if block.is_turned else middle), (cells[0], cells[1])


def _stub(grid: Mask, block: _Block, cell_m: float) -> tuple[float, int]:
    """The wall beside a block that has floor on both of its faces: as a share of what is needed, and in cells."""
    before, after = _widening(grid, block, -1, cell_m), _widening(grid, block, 1, cell_m)
    if min(before.min(), after.min()) < 0:
        return 0.0, 0
    stub = int(np.minimum(before, after).sum())
    is_beside_hall = block.width * cell_m <= MAX_MOUTH_M and max(before.sum(), after.sum()) >= block.width
    least_m = 0.0 if is_beside_hall else MIN_STUB_SHARE * block.width * cell_m
    return stub * cell_m / max(MIN_STUB_M, least_m), stub


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



def clean_floor(free: Mask, cell_m: float) -> tuple[Mask, list[tuple[slice, slice]]]:
    """The floor without rays, and the bounds of the things that stand free in it, which are floor here."""
    around, count = ndimage.label(~free, np.ones((3, 3)))
    clear = ndimage.distance_transform_edt(np.pad(~free, 1))[1:-1, 1:-1]
    thick = 2 * np.asarray(ndimage.maximum(clear, around, np.arange(count + 1))) * cell_m
    things = []
    is_thing, is_big = np.zeros(count + 1, bool), np.zeros(count + 1, bool)
    for number, bounds in enumerate(ndimage.find_objects(around), 1):
        sides_m = sorted((s.stop - s.start) * cell_m for s in bounds)
        if sides_m[1] <= LEG_M or (sides_m[1] <= MAX_FURNITURE_M and thick[number] >= MIN_FURNITURE_THICK_M):
            touches = any(s.start == 0 or s.stop == n for s, n in zip(bounds, free.shape, strict=True))
            is_thing[number] = not touches
            is_big[number] = not touches and sides_m[1] > LEG_M
            if not touches:
                things.append(bounds)
    floor = free | is_thing[around] | _find_hollow(free, cell_m)
    floor &= ~_find_partitions(floor, np.where(is_big[around], around, 0), cell_m)
    radius = max(1, round(RAY_M / 2 / cell_m))
    inside = ndimage.distance_transform_edt(np.pad(floor, 1))[1:-1, 1:-1] > radius
    opened = ndimage.distance_transform_edt(~inside) <= radius if inside.any() else inside
    return np.asarray(opened & floor, dtype=bool), things


def _find_partitions(floor: Mask, things: Labels, cell_m: float) -> Mask:
    """The things that stand in a row, with no more than doorways between them, and part two rooms: they are walls.

    Args:
        things: (rows, columns) number of the large thing on each cell, 0 for none.
    """
    if not things.any():
        return np.zeros_like(floor)
    inside = ndimage.distance_transform_edt(floor & (things == 0)) * cell_m > MIN_DOOR_M / 2
    way = ndimage.distance_transform_edt(~inside) * cell_m <= MIN_DOOR_M / 2
    labels, count = ndimage.label(_close_blocks(way & floor & (things == 0), cell_m, MAX_DOOR_M)[0])
    is_room = np.bincount(labels.ravel(), minlength=count + 1) * cell_m**2 >= MIN_OPEN_M2
    is_room[0] = False
    rows: dict[tuple[int, ...], list[int]] = {}
    for number in np.unique(things[things > 0]).tolist():
        around = ndimage.binary_dilation(things == number, np.ones((3, 3)), 3)
        beside = np.unique(labels[around])
        rows.setdefault(tuple(beside[is_room[beside]].tolist()), []).append(number)
    parting = [number for rooms, row in rows.items() if len(rooms) > 1 and len(row) > 1 for number in row]
    return np.isin(things, parting)


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
    thick = [ndimage.binary_dilation(~free, np.ones(size, bool)) for size in ((3, 1), (1, 3))]
    straight = ndimage.binary_opening(thick[0], run) | ndimage.binary_opening(thick[1], run.T)
    hollow = ndimage.binary_dilation(keep[pockets], np.ones((3, 3)), max(1, round(RIM_M / cell_m)))
    return np.asarray(hollow & ~straight, dtype=bool)


def part_rooms(floor: Mask, cell_m: float) -> tuple[Labels, list[Gap]]:
    """(rows, columns) number of the room of each cell, 0 outside, and the gaps that part two rooms."""
    cut, gaps = close_gaps(floor, cell_m)
    labels, count = ndimage.label(cut)
    labels = _join_small(np.asarray(labels, dtype=np.int32), count, gaps, cell_m)
    _, nearest = ndimage.distance_transform_edt(labels == 0, return_indices=True)
    beside = ndimage.binary_dilation(labels > 0, iterations=3, mask=floor)
    labels = np.where(beside & (labels == 0), labels[nearest[0], nearest[1]], labels)
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
