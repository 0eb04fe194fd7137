"""Floor map: how probably something stands on each cell of the floor, by all the evidence of it that is on the board.

A grid of log odds, as since Moravec and Elfes (1985): 0 where nothing is known. Each sight is stamped on it once, from
where it was taken: what it shows free, as surely as it tells, and what may stand behind what ends that. Pictures are
deceived alike by what looks like the floor: of sights that show a cell free the surest counts. Something that was seen
there counts until a newer sight shows the cell free. An echo may come from anywhere on its arc: it denies no floor
that was seen to be free for more than its looks, unless it is heard again from elsewhere. The map is a pure function of
its evidence, in whatever order that came.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats, Ints, Mask
from knowledge_sources.methods.belief import to_log_odds
from world_models.entries import FreeFloor

CELL_M = 0.05
P_CAMOUFLAGED = 0.05
"""That something stands on floor that looks free, and that no earlier picture would tell."""
LOOKS_FREE = to_log_odds(P_CAMOUFLAGED)
SURELY_FREE = to_log_odds(0.01)
"""Where an earlier picture would show it, too; where it was ranged; where the robot has been."""
TAKEN = to_log_odds(0.95)
"""Behind something that a picture shows, and along an arc that is as short as a cell."""
HIDDEN_M = 0.3
"""So far behind the near side of a thing the floor counts as taken by it."""
BEAM_RAD = math.radians(25.0)
"""Angle of a cone in which an echo may come from anywhere."""
ECHO_APART_M = 0.125
"""Readings from nearer to one another hear the same once more."""
MAX_RANGED_M = 3.0
"""Further from a reading its cones are too wide to tell of a cell."""
MAX_WEDGE_RAD = 3.0
"""A sight with a wider wedge is stamped all round."""
MIN_CELLS = 3
WINDOW_M = 0.15
"""Fewer cells than that within so much of the way hide nothing: 75 square centimetres."""

Cells = NDArray[np.float32]


class Stamp(NamedTuple):
    """What one sight says of each cell: log odds, below 0 where it is free; the first cell has the number ``low``."""

    low: Ints
    odds: Cells


class MapAnswer(NamedTuple):
    """What is known of places on the floor.

    Attributes:
        p: (n,) probability that something stands there; 1 where nothing is known, or it rather does than not.
        sights: (m,) the sights that tell it; discs: (k,) the discs.
    """

    p: Floats
    sights: Mask
    discs: Mask


class FloorMap:
    """The floor by some evidence, in the world's frame."""

    def __init__(self, sights: Sequence[FreeFloor], discs: Floats) -> None:
        """Take the evidence; discs: (n, 3) x, y, radius of floor that the robot has been on, or a person has seen."""
        self._sights, self._discs = sights, discs
        when = [(sight.seen_s, sight.sense, sight.x_m, sight.y_m) for sight in sights]
        self._newest_first = sorted(range(len(sights)), key=when.__getitem__, reverse=True)
        self._apart = _list_apart([(k, sights[k]) for k in self._newest_first if sights[k].sense == "ranges"])

    def ask(self, points: Floats) -> MapAnswer:
        """What is known of points (n, 2) [m, world]."""
        discs = np.zeros(len(self._discs), bool)
        if not len(points):
            return MapAnswer(np.zeros(0), np.zeros(len(self._sights), bool), discs)
        cells = np.floor(points / CELL_M).astype(int)
        low = cells.min(axis=0)
        at = tuple((cells - low).T)
        free, taken, by = (array[at] for array in self._compose(low, np.ptp(cells, axis=0) + 1))
        sights = np.isin(np.arange(len(self._sights)), by)
        dx, dy = (points[:, None, axis] - self._discs[:, axis] for axis in (0, 1))
        been, disc = np.nonzero((dx * dx + dy * dy <= self._discs[:, 2] ** 2) & (taken == 0.0)[:, None])
        been, first = np.unique(been, return_index=True)
        discs[disc[first[free[been] == 0.0]]] = True
        free[been] = np.minimum(free[been], SURELY_FREE)
        odds = free + taken
        return MapAnswer(np.where(odds < -1e-6, 1.0 / (1.0 + np.exp(-np.minimum(odds, 0.0))), 1.0), sights, discs)

    def draw(self) -> tuple[tuple[float, float], NDArray[np.uint8]]:
        """Its lower left corner [m, world], and a picture (rows, columns) of its cells, the first row at the top: how
        probably something stands there, in percent; 255 where nothing tells.
        """
        stamps = [stamp for sight in self._sights if (stamp := _stamp(sight)).odds.size]
        if not stamps:
            return (0.0, 0.0), np.full((1, 1), 255, np.uint8)
        low = np.min([stamp.low for stamp in stamps], axis=0)
        free, taken, _ = self._compose(low, np.max([stamp.low + stamp.odds.shape for stamp in stamps], axis=0) - low)
        percent = np.where((free == 0.0) & (taken == 0.0), 255.0, 100.0 / (1.0 + np.exp(-free - taken)))
        return (float(low[0] * CELL_M), float(low[1] * CELL_M)), percent.round().astype(np.uint8).T[::-1].copy()

    def _compose(self, low: Ints, shape: Ints) -> tuple[Cells, Cells, NDArray[np.int64]]:
        """A window of the map: log odds of what shows it free, and taken; and by which sight that is."""
        free, seen, heard = (np.zeros(shape, np.float32) for _ in range(3))
        by, is_open, is_silent = np.full(shape, -1), np.ones(shape, bool), np.ones(shape, bool)
        for k in self._newest_first:
            (first, odds), is_ranged = _stamp(self._sights[k]), self._sights[k].sense == "ranges"
            start, end = np.maximum(first, low), np.minimum(first + odds.shape, low + shape)
            if (end <= start).any():
                continue
            here, there = ((slice(a, b), slice(c, d)) for a, b, c, d in (
                (start[0] - o[0], end[0] - o[0], start[1] - o[1], end[1] - o[1]) for o in (low, first)))
            part = odds[there]
            is_surer = part < free[here]
            np.copyto(free[here], part, where=is_surer)
            if is_ranged:
                tells = (part > 0.0) & is_silent[here] & (k in self._apart)
                heard[here] += np.where(tells, part, 0.0)
            else:
                tells = (part > seen[here]) & is_open[here]
                np.copyto(seen[here], part, where=tells)
                is_open[here] &= part >= 0.0
            is_silent[here] &= part >= 0.0
            np.copyto(by[here], k, where=is_surer | tells)
        return free, seen + heard, by


def _list_apart(readings: Sequence[tuple[int, FreeFloor]]) -> set[int]:
    """The readings, newest first, that are from elsewhere than each newer one."""
    kept: list[tuple[int, FreeFloor]] = []
    for k, one in readings:
        if all(math.hypot(one.x_m - o.x_m, one.y_m - o.y_m) >= ECHO_APART_M for _, o in kept):
            kept.append((k, one))
    return {k for k, _ in kept}


@lru_cache(maxsize=256)
def _stamp(sight: FreeFloor) -> Stamp:
    """What a sight says of the cells: free in each wedge between two neighbouring bearings, from the greater of their
    near ends to the lesser of their far ends; and taken right behind each end that is a thing.
    """
    if len(sight.bearings_rad) < 2:
        return Stamp(np.zeros(2, int), np.zeros((0, 0), np.float32))
    is_ranged, origin = sight.sense == "ranges", np.array([sight.x_m, sight.y_m])
    near_m, far_m = np.array(sight.near_m), np.array(sight.far_m)
    sure_m = far_m if is_ranged else np.minimum(far_m, sight.confirmed_m or 0.0)
    reach_m = min(float(far_m.max()) + HIDDEN_M, MAX_RANGED_M if is_ranged else math.inf)
    bearings = np.unwrap(np.asarray(sight.bearings_rad)) - sight.bearings_rad[0]
    low, count = _find_box(origin, sight.bearings_rad, reach_m, float(np.diff(bearings).max()))
    out = [(low[k] + np.arange(count[k]) + 0.5) * CELL_M - origin[k] for k in (0, 1)]
    away_m = np.hypot(out[0][:, None], out[1])
    right = np.searchsorted(bearings, np.mod(np.arctan2(out[1], out[0][:, None]) - sight.bearings_rad[0], math.tau))
    within = (right > 0) & (right < len(bearings)) & (away_m <= reach_m)
    j = np.clip(right, 1, len(bearings) - 1)
    odds = np.zeros(count, np.float32)
    cells = np.maximum(1.0, BEAM_RAD * far_m / CELL_M) if is_ranged else np.ones(len(far_m))
    thing = np.where(np.array(sight.ends) == "thing", np.log1p(math.expm1(TAKEN) / cells), 0.0)
    for k in (j - 1, j):
        behind = within & (away_m > far_m[k]) & (away_m <= far_m[k] + HIDDEN_M)
        np.copyto(odds, np.maximum(odds, thing[k]), where=behind, casting="same_kind")
    free = within & (away_m >= np.maximum(near_m[j - 1], near_m[j]))
    for up_to_m, says in ((far_m, LOOKS_FREE), (sure_m, SURELY_FREE)):
        odds[free & (away_m <= np.minimum(up_to_m[j - 1], up_to_m[j]))] = says
    told = np.argwhere(odds)
    if not len(told):
        return Stamp(low, np.zeros((0, 0), np.float32))
    (a, b), (c, d) = told.min(axis=0), told.max(axis=0) + 1
    return Stamp(low + np.array([a, b]), odds[a:c, b:d].copy())


def _find_box(origin: Floats, bearings_rad: Sequence[float], reach_m: float, widest_rad: float) -> tuple[Ints, Ints]:
    """The first cell, and how many in either direction, of a box round all wedges: with a camera a quarter of what is
    round their tip.
    """
    ends = reach_m * np.array([[-1.0, 1.0], [-1.0, 1.0]])
    if widest_rad < MAX_WEDGE_RAD:  # all arcs are within these corners
        round_m = reach_m / math.cos(0.5 * widest_rad)
        ends = round_m * np.array([[0.0, *np.cos(bearings_rad)], [0.0, *np.sin(bearings_rad)]])
    low = np.floor((origin + np.maximum(ends.min(axis=1), -reach_m)) / CELL_M).astype(int)
    return low, np.ceil((origin + np.minimum(ends.max(axis=1), reach_m)) / CELL_M).astype(int) - low


class Sweep(NamedTuple):
    """What a disc sweeps on a way.

    Attributes:
        points: (n, 2) middles of cells [m, world].
        at_m: (n,) how far the disc has come when it first covers each; 0 for what it covers at the start.
    """

    points: Floats
    at_m: Floats

    def only(self, kept: Mask) -> Sweep:
        return Sweep(self.points[kept], self.at_m[kept])


def sample_sweep(way: Sequence[tuple[float, float]], radius_m: float, most_m: float) -> Sweep:
    """The cells that a disc sweeps on the first ``most_m`` of a way (k, 2)."""
    ends, gone_m = [(np.array(way[0]), np.array(way[0]), 0.0)], 0.0
    for a, b in pairwise(np.array(way)):
        long_m = float(np.linalg.norm(b - a))
        if long_m > 0.0 and gone_m < most_m:
            ends.append((a, a + (b - a) * min(1.0, (most_m - gone_m) / long_m), gone_m))
        gone_m += long_m
    corners = np.concatenate([pair[:2] for pair in ends])
    low, high = corners.min(axis=0) - radius_m, corners.max(axis=0) + radius_m
    xs, ys = (CELL_M * (np.arange(math.floor(a / CELL_M), math.ceil(b / CELL_M)) + 0.5)
              for a, b in zip(low, high, strict=True))
    cells = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    at_m = np.full(len(cells), math.inf)
    for a, b, begins_m in ends:
        long_m = float(np.linalg.norm(b - a))
        out = (b - a) / long_m if long_m else np.array([1.0, 0.0])
        along, across = (cells - a) @ out, (cells - a) @ np.array([-out[1], out[0]])
        reach = np.sqrt(np.maximum(radius_m**2 - across**2, 0.0))
        met = (np.abs(across) <= radius_m) & (along + reach >= 0.0) & (along - reach <= long_m)
        at_m[met] = np.minimum(at_m[met], begins_m + np.maximum(along - reach, 0.0)[met])
    return Sweep(cells, at_m).only(np.isfinite(at_m))


def find_blind(unseen: Sweep) -> Floats:
    """How far the disc has come (n,), rising, where it begins to cover unseen cells that may hide something."""
    at = np.sort(unseen.at_m)
    if len(at) < MIN_CELLS:
        return np.zeros(0)
    few = MIN_CELLS - 1
    return np.asarray(at[:-few][at[few:] - at[:-few] <= WINDOW_M])


def measure_blind_m(unseen: Sweep) -> float:
    """How much of the way leads into unseen floor."""
    return CELL_M * len(np.unique(np.floor(find_blind(unseen) / CELL_M)))
