"""Where floor was seen, and ways on it: the robot moves nowhere else."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from knowledge_sources.methods.motion.clearance import Clearance

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Cell = tuple[int, int]

CELL_M = 0.05
SIDE = 2400
"""Cells along a side of the map; its middle is the start."""
CLOSE_CELLS = 5
"""Holes up to so wide are of the camera's raster."""
MARGIN_M = 0.07
"""Kept free beside the robot's disc."""
NEAR_BORDER_M, NEAR_BORDER_COST, NEARER_M = 0.3, 8.0, 0.02
"""A way nearer than that to where the floor was not seen costs up to so many times more; and a straight way is not
taken for a bent one if it comes so much nearer."""
TOUCH = ((0.15, 1.0), (0.35, 0.2))
"""The robot's disc so near to where floor was not seen, or to a wall, touches something with this probability at most:
walls are off by centimetres, jambs and the wheels too."""


class SeenFloor:
    """A grid of the floor round the start."""

    def __init__(self, radius_m: float) -> None:
        self._seen = np.zeros((SIDE, SIDE), np.uint8)
        self._radius_m = radius_m
        self._walls: list[tuple[Floats, Floats]] = []
        self._ways: list[tuple[Floats, Floats]] = []
        self._free: Mask | None = None
        self._away: NDArray[np.float32] | None = None

    def clear(self) -> None:
        self._seen[:] = 0
        self._walls, self._ways, self._free = [], [], None

    def add_points(self, points: Floats) -> None:
        """Points (n, 2) of the floor that were seen [m]."""
        cells = _cells(points)
        self._seen[cells[:, 0], cells[:, 1]] = 1
        self._free = None

    def add_way(self, begin: Floats, end: Floats, width_m: float) -> None:
        """A strip that the robot has driven over, or may stand on; round at its ends."""
        (a, b), (c, d) = cell_of(begin), cell_of(end)
        cv2.line(self._seen, (b, a), (d, c), 1, max(1, round(width_m / CELL_M)))
        self._free = None

    def add_box(self, corner: Floats, opposite: Floats, is_way: bool) -> None:
        """A wall, through which nothing leads but doorways; or a way, as the floor between jambs. Along the axes."""
        (self._ways if is_way else self._walls).append((corner, opposite))
        self._free = None

    @property
    def seen(self) -> Mask:
        """Where floor was seen, small holes closed; cells by x and y."""
        kernel = np.ones((CLOSE_CELLS, CLOSE_CELLS), np.uint8)
        closed = cv2.morphologyEx(self._seen, cv2.MORPH_CLOSE, kernel)
        for value, boxes in ((0, self._walls), (1, self._ways)):
            for begin, end in boxes:
                (i0, j0), (i1, j1) = cell_of(np.minimum(begin, end)), cell_of(np.maximum(begin, end))
                closed[i0 : i1 + 1, j0 : j1 + 1] = value
        return np.asarray(closed.astype(bool))

    def _update(self) -> None:
        if self._free is None:
            seen, self._away = self.seen, np.zeros((SIDE, SIDE), np.float32)
            (i0, i1), (j0, j1) = (np.flatnonzero(seen.any(axis=k))[[0, -1]] + (-1, 2) for k in (1, 0))
            self._away[i0:i1, j0:j1] = CELL_M * cv2.distanceTransform(
                seen[i0:i1, j0:j1].astype(np.uint8), cv2.DIST_L2, 5)
            self._free = np.asarray(self._away > self._radius_m + MARGIN_M)

    def find_clearance(self, begin: Floats, end: Floats) -> Clearance:
        """Where on a straight way something may be touched."""
        self._update()
        assert self._away is not None
        length_m = float(np.hypot(*(end - begin)))
        at_m = np.arange(0.0, length_m + CELL_M, CELL_M)
        points = begin + at_m[:, None] * (end - begin) / max(length_m, CELL_M)
        cells = _cells(points)
        spare_m = self._away[cells[:, 0], cells[:, 1]] - self._radius_m
        for corner, opposite in self._ways:  # between jambs, and just before them
            low, high = np.minimum(corner, opposite) - self._radius_m, np.maximum(corner, opposite) + self._radius_m
            spare_m[np.all((points > low) & (points < high), axis=1)] = 0.0
        p = np.select([spare_m < near_m for near_m, _ in TOUCH], [p for _, p in TOUCH])
        return Clearance(at_m[p > 0.0], p[p > 0.0], math.inf)

    def costs_from(self, point: Floats) -> tuple[dict[Cell, float], dict[Cell, Cell]]:
        """Cost of the cheapest way to each cell that can be reached, and the cell before it."""
        self._update()
        free, away = self._free, self._away
        assert free is not None and away is not None
        cells = np.argwhere(free)
        names: list[Cell] = [(i, j) for i, j in cells.tolist()]
        start = near_cell(point, set(names), 8)
        if start is None:
            return {}, {}
        number = np.zeros(free.shape, np.int32)
        number[cells[:, 0], cells[:, 1]] = np.arange(len(cells))
        begins, ends, lengths = [], [], []
        near = (self._radius_m + NEAR_BORDER_M - away[cells[:, 0], cells[:, 1]]) / NEAR_BORDER_M
        slow = 1.0 + NEAR_BORDER_COST * np.maximum(near, 0.0) ** 2
        for step in ((1, 0), (0, 1), (1, 1), (1, -1)):
            there = cells + step
            joined = np.flatnonzero(free[there[:, 0], there[:, 1]])
            i, j = there[joined].T
            begins.append(joined)
            ends.append(number[i, j])
            lengths.append(0.5 * (slow[joined] + slow[number[i, j]]) * math.hypot(*step) * CELL_M)
        graph = csr_array((np.concatenate(lengths), (np.concatenate(begins), np.concatenate(ends))),
                          shape=(len(cells), len(cells)))
        found, last = dijkstra(graph, directed=False, indices=int(number[start]), return_predecessors=True)
        costs = {names[k]: float(found[k]) for k in np.flatnonzero(np.isfinite(found))}
        return costs, {names[k]: names[last[k]] for k in np.flatnonzero(last >= 0)}

    def way_to(self, goal: Cell, before: dict[Cell, Cell]) -> list[Floats]:
        """Straight legs to a cell: their ends [m]."""
        cells = [goal]
        while cells[-1] in before:
            cells.append(before[cells[-1]])
        cells.reverse()
        corners, here = [], 0
        while here < len(cells) - 1:
            there = len(cells) - 1
            while there > here + 1 and not self._is_as_free(cells[here : there + 1]):
                there -= 1
            corners.append(point_of(cells[there]))
            here = there
        return corners

    def _is_as_free(self, way: list[Cell]) -> bool:
        """Whether straight from the first to the last of these cells is about as far from the border as they are."""
        assert self._away is not None
        share = np.linspace(0.0, 1.0, 2 * len(way))[:, None]
        i, j = np.round(np.array(way[0]) + share * (np.array(way[-1]) - way[0])).astype(int).T
        wi, wj = np.array(way).T
        return bool(self._away[i, j].min() >= self._away[wi, wj].min() - NEARER_M)


def cell_of(point: Floats | Sequence[float]) -> Cell:
    """The cell of a point [m]."""
    return math.floor(point[0] / CELL_M) + SIDE // 2, math.floor(point[1] / CELL_M) + SIDE // 2


def point_of(cell: Cell) -> Floats:
    """The middle of a cell [m]."""
    return (np.array(cell) - SIDE // 2 + 0.5) * CELL_M


def near_cell(point: Floats, cells: Container[Cell], within: int) -> Cell | None:
    """The nearest to a point of some cells, within so many."""
    i, j = cell_of(point)
    near = [(i + di, j + dj) for di in range(-within, within + 1) for dj in range(-within, within + 1)]
    near = [cell for cell in near if cell in cells]
    return min(near, key=lambda cell: (math.hypot(cell[0] - i, cell[1] - j), cell)) if near else None


def _cells(points: Floats) -> NDArray[np.int64]:
    cells = np.floor(points / CELL_M).astype(np.int64) + SIDE // 2
    return np.asarray(cells[np.all((cells >= 0) & (cells < SIDE), axis=1)])
