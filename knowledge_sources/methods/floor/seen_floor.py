"""Seen floor: the union of what scans show free, and what of a way it does not cover.

A scan shows the floor free in each wedge between two neighbouring bearings, from the greater of their near ends to the
lesser of their far ends. Where scans differ, the newest that tells of a point holds: right behind a
thing that ends it, an older one makes nothing free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats, Mask
from world_models.entries.floor import FreeFloor

HIDDEN_M = 0.3
"""So far behind the near side of a thing the floor counts as taken by it."""
SPACING_M = 0.05
"""Of the points by which a region is told."""
MIN_POINTS = 3
WINDOW_M = 0.15
"""Fewer unseen points than that within so much of the way hide nothing: 75 square centimetres."""


class _Scan(NamedTuple):
    """A scan as arrays: bearings (n,) rise from the first one, which is ``first_rad``."""

    origin: Floats
    first_rad: float
    bearings_rad: Floats
    near_m: Floats
    far_m: Floats
    is_thing: Mask


@lru_cache(maxsize=256)
def _read_scan(scan: FreeFloor) -> _Scan:
    bearings = np.unwrap(np.asarray(scan.bearings_rad, float)) if scan.bearings_rad else np.zeros(0)
    first = float(bearings[0]) if len(bearings) else 0.0
    return _Scan(np.array([scan.x_m, scan.y_m]), first, bearings - first, np.asarray(scan.near_m, float),
                 np.asarray(scan.far_m, float), np.array([end == "thing" for end in scan.ends], bool))


@dataclass(frozen=True, eq=False)
class SeenFloor:
    """Floor that is known to be free.

    Attributes:
        scans: the oldest first; only those that are young enough.
        discs: (n, 3) x, y, radius of what else is known to be free, where no scan sees a thing [m, world].
        taken: corners (k, 2) of what stands on the floor.
    """

    scans: tuple[FreeFloor, ...]
    discs: Floats
    taken: tuple[Floats, ...] = ()

    def find_free(self, points: Floats) -> Mask:
        """Which of the points (n, 2) are seen free."""
        return self.ask(points)[0]

    def ask(self, points: Floats) -> tuple[Mask, Mask, Mask]:
        """Which of the points (n, 2) are seen free; and which scans, and which discs, tell that or the contrary."""
        free, open_ = np.zeros(len(points), bool), np.ones(len(points), bool)
        scans, discs = np.zeros(len(self.scans), bool), np.zeros(len(self.discs), bool)
        for k in range(len(self.scans) - 1, -1, -1):
            rest = np.flatnonzero(open_)
            if not len(rest):
                break
            is_free, is_taken = _ask_scan(_read_scan(self.scans[k]), points[rest])
            free[rest[is_free]] = True
            open_[rest[is_free | is_taken]] = False
            scans[k] = (is_free | is_taken).any()
        rest = np.flatnonzero(open_)
        if len(rest) and len(self.discs):
            covers = np.linalg.norm(points[rest, None] - self.discs[None, :, :2], axis=2) <= self.discs[:, 2]
            free[rest] = covers.any(axis=1)
            discs[covers.argmax(axis=1)[covers.any(axis=1)]] = True
        for corners in self.taken:
            free &= ~shapely.intersects_xy(shapely.Polygon(corners), points[:, 0], points[:, 1])
        return free, scans, discs


def _ask_scan(scan: _Scan, points: Floats) -> tuple[Mask, Mask]:
    """Which points (n, 2) a scan shows free, and which it shows taken."""
    out = points - scan.origin
    away = np.linalg.norm(out, axis=1)
    if len(scan.bearings_rad) < 2:
        return np.zeros(len(points), bool), np.zeros(len(points), bool)
    bearings = np.mod(np.arctan2(out[:, 1], out[:, 0]) - scan.first_rad, 2.0 * np.pi)
    right = np.searchsorted(scan.bearings_rad, bearings)
    within = (right > 0) & (right < len(scan.bearings_rad))
    j = np.clip(right, 1, len(scan.bearings_rad) - 1)
    i = j - 1
    near, far = np.maximum(scan.near_m[i], scan.near_m[j]), np.minimum(scan.far_m[i], scan.far_m[j])
    free = within & (away >= near) & (away <= far)
    behind = np.zeros(len(points), bool)
    for k in (i, j):
        behind |= scan.is_thing[k] & (away > scan.far_m[k]) & (away <= scan.far_m[k] + HIDDEN_M)
    return free, within & behind & ~free


class Sweep(NamedTuple):
    """What a disc sweeps on a way.

    Attributes:
        points: (n, 2) on the floor [m, world].
        at_m: (n,) how far the disc has come when it first covers each; 0 for what it covers at the start.
    """

    points: Floats
    at_m: Floats

    def only(self, kept: Mask) -> Sweep:
        return Sweep(self.points[kept], self.at_m[kept])


def sample_sweep(way: Sequence[tuple[float, float]], radius_m: float, most_m: float) -> Sweep:
    """What a disc sweeps on the first ``most_m`` of a way (k, 2), by points of a grid."""
    line = shapely.LineString(way) if len(way) > 1 else shapely.LineString([way[0], way[0]])
    length = min(line.length, most_m)
    at = np.append(np.arange(0.0, length, SPACING_M / 2.0), length)
    places = shapely.get_coordinates(shapely.line_interpolate_point(line, at))
    low, high = places.min(axis=0) - radius_m, places.max(axis=0) + radius_m
    xs, ys = (SPACING_M * np.arange(np.floor(a / SPACING_M), np.ceil(b / SPACING_M) + 1.0)
              for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    near = ((grid[:, None] - places[None]) ** 2).sum(axis=2) <= radius_m**2
    swept = near.any(axis=1)
    return Sweep(grid[swept], at[near[swept].argmax(axis=1)])


def find_blind(unseen: Sweep) -> Floats:
    """How far the disc has come (n,), rising, where it begins to cover unseen points that may hide something."""
    at = np.sort(unseen.at_m)
    if len(at) < MIN_POINTS:
        return np.zeros(0)
    few = MIN_POINTS - 1
    return np.asarray(at[:-few][at[few:] - at[:-few] <= WINDOW_M])


def measure_blind_m(unseen: Sweep) -> float:
    """How much of the way leads into unseen floor."""
    return SPACING_M * len(np.unique(np.floor(find_blind(unseen) / SPACING_M)))


def measure_free_m(unseen: Sweep, length_m: float) -> float:
    """How far the disc can go before it covers unseen floor."""
    blind = find_blind(unseen)
    return min(length_m, float(blind[0])) if len(blind) else length_m


def measure_blind_end_m(unseen: Sweep, gap_m: float) -> float:
    """How far the disc has come when it has covered the first unseen floor, and what follows within ``gap_m``."""
    blind = find_blind(unseen)
    if not len(blind):
        return 0.0
    at = np.sort(unseen.at_m)
    last = blind[0]
    for there in at[at >= last]:
        if there - last > gap_m:
            break
        last = there
    return float(last) + SPACING_M
