"""Where the robot could go in a building: free floor, and the shortest way on it."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from sim.body.collision import ROBOT_RADIUS_M, Obstacles
from world_models.frames import Pose2

QUARTER_STEPS = 8
"""Corners of a quarter circle round the end of an obstacle: the way round it is too near by 2 mm at most."""

GRID_M = 0.05
"""Spacing of the grid on which shortest ways are searched."""
MOVES = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2))
"""Steps on the grid, in one of their two directions."""


def find_free_floor(obstacles: Obstacles, margin_m: float = 0.0) -> shapely.Geometry:
    """Where the robot's centre may be, with its rim ``margin_m`` from everything solid; world frame [m]."""
    ends = obstacles.segments_world.reshape(-1, 2)
    low, high = ends.min(axis=0), ends.max(axis=0)
    return take_from_floor(shapely.box(*low, *high), obstacles, margin_m)


def take_from_floor(free: shapely.Geometry, obstacles: Obstacles, margin_m: float = 0.0) -> shapely.Geometry:
    """A free floor without what is near to further obstacles."""
    if not len(obstacles.segments_world):
        return free
    solid = shapely.linestrings(obstacles.segments_world)
    near = shapely.buffer(solid, ROBOT_RADIUS_M + margin_m, quad_segs=QUARTER_STEPS)
    return shapely.difference(free, shapely.union_all(near))


def has_way(free: shapely.Geometry, start: Pose2, goal: Pose2) -> bool:
    """Whether a way leads over a free floor from one place to another."""
    ends = shapely.points(np.array([start.position, goal.position]))
    return any(bool(shapely.intersects(part, ends).all()) for part in shapely.get_parts(free))


def find_shortest_way(free: shapely.Geometry, start: Pose2, goal: Pose2) -> NDArray[np.float64] | None:
    """The shortest way (k, 2) over a free floor, to about 1 % of its length; None where there is none.

    It is searched on a grid, and then pulled tight.
    """
    ends = np.array([start.position, goal.position])
    within = [part for part in shapely.get_parts(free) if shapely.intersects(part, shapely.points(ends)).all()]
    if not within:
        return None
    room = shapely.buffer(within[0], GRID_M / 5.0)
    shapely.prepare(room)
    low, high = np.reshape(shapely.bounds(within[0]), (2, 2))
    count = np.ceil((high - low) / GRID_M).astype(int) + 1
    grid = np.stack(np.meshgrid(*(low[a] + GRID_M * np.arange(count[a]) for a in range(2)), indexing="ij"), axis=-1)
    open_cells = shapely.contains_xy(room, grid[..., 0], grid[..., 1])
    points = grid.reshape(-1, 2)
    cells = np.flatnonzero(open_cells)
    first, last = (int(cells[np.argmin(np.linalg.norm(points[cells] - end, axis=1))]) for end in ends)
    _, before = dijkstra(_grid_graph(open_cells), directed=False, indices=first, return_predecessors=True)
    found = [last]
    while found[-1] != first:
        if before[found[-1]] < 0:
            return None
        found.append(int(before[found[-1]]))
    return _pull_tight(np.array([ends[0], *points[found[::-1]], ends[1]]), room)


def _grid_graph(open_cells: NDArray[np.bool_]) -> coo_array:
    """Open cells (m, n) joined to those that one of :data:`MOVES` reaches."""
    numbers = np.arange(open_cells.size).reshape(open_cells.shape)
    rows, columns, lengths = [], [], []
    for dx, dy in MOVES:
        m, n = open_cells.shape
        here = np.s_[: m - dx, max(0, -dy) : n - max(0, dy)]
        there = np.s_[dx:, max(0, dy) : n + min(0, dy)]
        both = open_cells[here] & open_cells[there]
        rows.append(numbers[here][both])
        columns.append(numbers[there][both])
        lengths.append(np.full(int(both.sum()), GRID_M * float(np.hypot(dx, dy))))
    ends = np.concatenate(rows), np.concatenate(columns)
    return coo_array((np.concatenate(lengths), ends), shape=(open_cells.size, open_cells.size))


def _pull_tight(way: NDArray[np.float64], room: shapely.Geometry) -> NDArray[np.float64]:
    """A way without the points that a straight line in the room can leave out: the furthest that is seen comes next."""
    kept = [0]
    while kept[-1] < len(way) - 1:
        ahead = np.arange(kept[-1] + 1, len(way))
        pairs = np.stack([np.broadcast_to(way[kept[-1]], (len(ahead), 2)), way[ahead]], axis=1)
        seen = ahead[shapely.covers(room, shapely.linestrings(pairs))]
        kept.append(int(seen[-1]) if len(seen) else kept[-1] + 1)
    return way[kept]
