"""Rooms from a grid: the free cells parted at the gaps of walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from harvey_buildings.ros_map.gaps import Gap, Mask, close_gaps

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
