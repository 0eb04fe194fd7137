"""The grid of a ROS map turned so that most walls run along its axes, and its way back into the map's frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage

from world_models.files.importers.building_plan import Floats
from world_models.files.importers.ros_map.map_yaml import MapFile
from world_models.files.importers.ros_map.occupancy import FREE, OCCUPIED, UNKNOWN, Cells

MARGIN_CELLS = 3
MIN_TURN_RAD = math.radians(0.3)
TURN_STEP_RAD = math.radians(0.25)
MIN_SHARE = 0.25
"""Share of the walls' faces that must run along two directions, square to each other, for the grid to be turned."""


@dataclass(frozen=True, eq=False, slots=True)
class Grid:
    """Cells with most walls along rows and columns.

    Attributes:
        cells: (rows, columns) of FREE, OCCUPIED, UNKNOWN.
        cell_m: side of a cell [m].
        turn_rad: angle from the picture's axes to the walls', counter-clockwise.
        scale, matrix, offset: (row, column) of the picture is matrix @ (row, column) + offset.
        rows: of the picture.
        origin: of the map file.
    """

    cells: Cells
    cell_m: float
    turn_rad: float
    matrix: Floats
    offset: Floats
    rows: int
    origin: tuple[float, float, float]

    def to_map(self, points: Floats) -> Floats:
        """(n, 2) rows and columns, the middle of a cell being whole numbers, as x, y in the map's frame [m]."""
        picture = points @ self.matrix.T + self.offset
        flat = np.column_stack([picture[:, 1] + 0.5, self.rows - 0.5 - picture[:, 0]]) * self.cell_m
        x, y, yaw = self.origin
        c, s = math.cos(yaw), math.sin(yaw)
        return np.asarray(flat @ np.array([[c, s], [-s, c]]) + np.array([x, y]))

    def to_map_polygon(self, shape: shapely.Geometry) -> shapely.Geometry:
        """A shape in columns and rows as one in the map's frame."""
        return shapely.transform(shape, lambda points: self.to_map(points[:, ::-1]))

    def direction(self, along: Floats) -> Floats:
        """(2,) unit direction in the map's frame of a direction in rows and columns."""
        ends = self.to_map(np.array([[0.0, 0.0], along]))
        return np.asarray((ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0]))


def make_grid(cells: Cells, file: MapFile) -> Grid:
    """The known part of a picture, turned."""
    rows = len(cells)
    known = np.argwhere(cells != UNKNOWN)
    low = np.maximum(known.min(axis=0) - MARGIN_CELLS, 0)
    part = cells[low[0] : known[:, 0].max() + MARGIN_CELLS + 1, low[1] : known[:, 1].max() + MARGIN_CELLS + 1]
    part = np.pad(part, MARGIN_CELLS, constant_values=UNKNOWN)
    offset = low.astype(np.float64) - MARGIN_CELLS
    turn = find_wall_turn(part)
    if not turn:
        return Grid(part, file.resolution_m, 0.0, np.eye(2), offset, rows, file.origin)
    c, s = math.cos(turn), math.sin(turn)
    matrix = np.array([[c, -s], [s, c]])  # rows and columns of the turned grid to those of the picture
    size = np.array(part.shape)
    wide = np.ceil(np.abs(matrix.T) @ size).astype(int)
    shift = (size - 1) / 2 - matrix @ ((wide - 1) / 2)
    turned = ndimage.affine_transform(part, matrix, shift, output_shape=tuple(wide), order=0, cval=int(UNKNOWN))
    return Grid(np.asarray(turned, dtype=np.int8), file.resolution_m, turn, matrix, offset + shift, rows, file.origin)


def find_wall_turn(cells: Cells) -> float:
    """The angle [rad], within 45 degrees, from rows and columns to most walls; 0 where none prevails."""
    walls = ndimage.gaussian_filter((cells == OCCUPIED).astype(np.float32), 1.5)
    down, right = ndimage.sobel(walls, 0), ndimage.sobel(walls, 1)
    weight = np.hypot(down, right)
    if not (cells == FREE).any() or weight.sum() < 1e-9:
        return 0.0
    quarter = math.pi / 2
    count = round(quarter / TURN_STEP_RAD)
    bins = (np.mod(np.arctan2(-down, right), quarter) / TURN_STEP_RAD).astype(int) % count
    shares = np.bincount(bins.ravel(), weights=weight.ravel(), minlength=count) / weight.sum()
    window = np.exp(-0.5 * (np.arange(-8, 9) / 3.0) ** 2)
    best = int(np.argmax(ndimage.convolve1d(shares, window, mode="wrap")))
    near = np.arange(best - 8, best + 9)
    if shares[near % count].sum() < MIN_SHARE:
        return 0.0
    angle = float(np.average(near + 0.5, weights=shares[near % count])) * TURN_STEP_RAD
    turn = (angle + quarter / 2) % quarter - quarter / 2
    return turn if abs(turn) > MIN_TURN_RAD else 0.0
