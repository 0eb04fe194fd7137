"""How well do traced rooms and doorways agree with the truth?

The Matthews correlation coefficient of a room is that of two sets of cells of the picture: the room's in the truth, and
those of the traced room paired with it (Mielle, Magnusson, Lilienthal, "A method to segment maps from different
modalities using free space layout", ICRA 2018, use it so). Rooms are paired one to one, for the largest sum.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import linear_sum_assignment

Labels = NDArray[np.int32]
WHITE = 250
MIN_ROOM_M2, MIN_DOOR_M = 1.0, 0.5
MAX_OFF_M = 0.5
"""A doorway is found where an opening between two traced rooms is no farther from it."""


@dataclass(frozen=True, eq=False, slots=True)
class MapTruth:
    """What is true of a map: (rows, columns) number of the room of each cell, 0 for none, and the middles (n, 2) of its
    doorways [m], x right and y up from the lower left corner."""

    rooms: Labels
    doorways: NDArray[np.float64]


def read_truth(plain: Path, divided: Path, cell_m: float) -> MapTruth:
    """The truth from two pictures: an empty plan, and the same with a black line across each doorway."""
    white, parted = _read_white(plain), _read_white(divided)
    rooms, count = ndimage.label(parted)
    rooms[(np.bincount(rooms.ravel(), minlength=count + 1) * cell_m**2 < MIN_ROOM_M2)[rooms]] = 0
    lines, _ = ndimage.label(white & ~parted, np.ones((3, 3)))  # a pocket in a wall is white in both
    doorways = []
    for number, bounds in enumerate(ndimage.find_objects(lines), 1):
        low = np.array([max(s.start - 2, 0) for s in bounds])
        part = tuple(slice(a, s.stop + 2) for a, s in zip(low, bounds, strict=True))
        line = lines[part] == number
        beside = np.unique(rooms[part][ndimage.binary_dilation(line, np.ones((3, 3)), 2)])
        if (beside > 0).sum() >= 2 and max(np.ptp(np.argwhere(line), axis=0)) + 1 >= MIN_DOOR_M / cell_m:
            row, column = np.argwhere(line).mean(axis=0) + low
            doorways.append(((column + 0.5) * cell_m, (len(white) - 0.5 - row) * cell_m))
    return MapTruth(np.asarray(rooms, dtype=np.int32), np.array(doorways).reshape(-1, 2))


def _read_white(path: Path) -> NDArray[np.bool_]:
    from matplotlib.image import imread

    picture = np.asarray(imread(path))
    return np.asarray((picture if picture.ndim == 2 else picture[..., :3].mean(axis=2)) * 255.0 > WHITE)


def draw_rooms(outlines: Mapping[str, NDArray[np.float64]], shape: tuple[int, int], cell_m: float) -> Labels:
    """(rows, columns) number, from 1, of the outline (k, 2) [m] in which the middle of each cell is; 0 for none."""
    labels = np.zeros(shape, np.int32)
    for number, outline in enumerate(outlines.values(), 1):
        cells = np.column_stack([outline[:, 0] / cell_m - 0.5, shape[0] - 0.5 - outline[:, 1] / cell_m])
        low = np.maximum(np.floor(cells.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(cells.max(axis=0)).astype(int) + 1, shape[::-1])
        columns, rows = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
        inside = shapely.contains_xy(shapely.Polygon(cells), columns, rows)
        labels[rows[inside], columns[inside]] = number
    return labels


def draw_beside(truth: MapTruth, traced: MapTruth, cell_m: float, path: Path) -> None:
    """Write a picture: the true rooms, each in a colour of its own, and beside them the traced; doorways are red."""
    from matplotlib.image import imsave

    parts = []
    for which in (truth, traced):
        shades = np.random.default_rng(0).uniform(0.35, 0.95, (int(which.rooms.max()) + 1, 3))
        shades[0] = 0.1
        part = shades[which.rooms]
        for x, y in which.doorways:
            row, column = len(part) - 1 - int(y / cell_m), int(x / cell_m)
            part[max(row - 3, 0) : row + 4, max(column - 3, 0) : column + 4] = (1.0, 0.0, 0.0)
        parts += [part, np.ones((len(part), 8, 3))]
    imsave(path, np.concatenate(parts[:-1], axis=1))


def correlate_rooms(truth: Labels, traced: Labels) -> tuple[float, float]:
    """The Matthews correlation, mean over the true rooms and weighted by their area; 0 for a room without a pair."""
    rooms, found = int(truth.max()), int(traced.max())
    both = np.bincount((truth.astype(np.int64) * (found + 1) + traced).ravel(), minlength=(rooms + 1) * (found + 1))
    table = both.reshape(rooms + 1, found + 1).astype(np.float64)
    area, other = table.sum(axis=1)[1:, None], table.sum(axis=0)[None, 1:]
    hits = table[1:, 1:]
    wrong, missed = other - hits, area - hits
    rest = truth.size - hits - wrong - missed
    spread = np.sqrt((hits + wrong) * (hits + missed) * (rest + wrong) * (rest + missed))
    scores = (hits * rest - wrong * missed) / np.where(spread > 0, spread, 1.0)
    is_room = area[:, 0] > 0
    best = np.zeros(rooms)
    rows, columns = linear_sum_assignment(-scores)
    best[rows] = scores[rows, columns]
    return float(best[is_room].mean()), float(np.average(best[is_room], weights=area[is_room, 0]))


def count_found(truth: NDArray[np.float64], openings: Sequence[NDArray[np.float64]]) -> int:
    """How many true doorways (n, 2) [m] have an opening, its middle (2,) [m], near them; each opening counts once."""
    if not len(truth) or not openings:
        return 0
    away = np.linalg.norm(truth[:, None] - np.array(openings)[None], axis=2)
    rows, columns = linear_sum_assignment(np.where(away <= MAX_OFF_M, away, 1e3))
    return int((away[rows, columns] <= MAX_OFF_M).sum())
