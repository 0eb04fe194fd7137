"""The grid of a ROS map turned so that most walls run along its axes, and its way back into the map's frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage

from harvey_buildings.building_plan import Floats
from harvey_buildings.ros_map.map_yaml import MapFile
from harvey_buildings.ros_map.occupancy import FREE, OCCUPIED, UNKNOWN, Cells

MARGIN_CELLS = 3
MIN_TURN_RAD = math.radians(0.3)
COARSE_DEG, NEAR_DEG, FINE_DEG = 0.5, 1.5, 0.1
PLATEAU = 0.96
"""Thick walls make the top of the profile flat: its middle is taken, from this share of the top on."""
MIN_CONTRAST = 1.3
"""The profile along the walls is this many times the median of all directions, or none prevails."""
MIN_WALL_CELLS, MAX_WALL_CELLS = 50, 30_000


@dataclass(frozen=True, eq=False, slots=True)
class Grid:
    """Cells with most walls along rows and columns.

    Attributes:
        cells: (rows, columns) of FREE, OCCUPIED, UNKNOWN.
        cell_m: side of a cell [m].
        turn_rad: angle from the picture's axes to the walls', counter-clockwise.
        matrix, offset: (row, column) of the picture is matrix @ (row, column) + offset.
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
    """The angle [rad], within 45 degrees, counter-clockwise from the picture's axes to most walls; 0: none prevails.

    Along the walls' direction the occupied cells fall on few rows and columns: the sum of the squares of their numbers
    is largest (the projection profile, as pages of text are straightened).
    """
    faces = (cells == OCCUPIED) & ndimage.binary_dilation(cells == FREE, iterations=2)
    rows, columns = np.nonzero(faces)
    if len(rows) < MIN_WALL_CELLS:
        return 0.0
    step = math.ceil(len(rows) / MAX_WALL_CELLS)
    x, y = columns[::step].astype(np.float64), -rows[::step].astype(np.float64)
    coarse = np.arange(-45.0, 45.0, COARSE_DEG)
    heights = np.array([_profile(x, y, angle) for angle in coarse])
    best = coarse[int(np.argmax(heights))]
    if heights.max() < MIN_CONTRAST * np.median(heights):
        return 0.0
    fine = best + np.arange(-NEAR_DEG, NEAR_DEG + FINE_DEG / 2, FINE_DEG)
    heights = np.array([_profile(x, y, angle) for angle in fine])
    turn = math.radians(float(fine[heights >= PLATEAU * heights.max()].mean()))
    return turn if abs(turn) > MIN_TURN_RAD else 0.0


def _profile(x: Floats, y: Floats, angle_deg: float) -> float:
    """The sum of squares of how many cells lie on each row and each column of axes turned by an angle."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    counts = [np.bincount(np.round(axis - axis.min()).astype(int)) for axis in (c * x + s * y, c * y - s * x)]
    return float(np.square(np.concatenate(counts).astype(np.float64)).sum())
