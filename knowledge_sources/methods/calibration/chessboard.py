"""Chessboards in pictures: the inner corners to a few hundredths of a pixel, or why a picture is of no use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

LEAST_SQUARE_PX = 5.0
"""Squares smaller than this do not let their corners be told apart."""
MOST_RISE_PX = 5.0
"""Edges that take longer than this from black to white are blurred: out of focus, or moved."""
UNKNOWN_PX = 1000.0
"""What OpenCV answers from here on means that it could not tell, as for squares seen at a flat angle."""
WINDOW = 0.4
"""Half the side of the window in which a corner is refined, as part of the distance to the next corner: the larger the
better while no other corner is in it. On rendered boards: 0.048 px RMS with 3 px, 0.035 px with 8 px."""
LARGEST_WINDOW_PX = 11
STEPS = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 60, 1e-4)


@dataclass(frozen=True, slots=True)
class Pattern:
    """A chessboard: how many inner corners in a row and in a column, and the side of a square [m]."""

    columns: int
    rows: int
    square_m: float

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or not 0.0 < self.square_m < 10.0:
            raise ValueError("expected at least 3 x 3 inner corners and squares of more than 0 and less than 10 m, got "
                             f"{self.columns} x {self.rows} and {self.square_m} m")

    @property
    def points(self) -> NDArray[np.float64]:
        """(columns rows, 3) inner corners, row by row, in the board's plane z = 0 [m]."""
        y, x = np.divmod(np.arange(self.columns * self.rows), self.columns)
        return np.stack([x, y, np.zeros_like(x)], axis=1) * self.square_m


def find_corners(image: Any, pattern: Pattern) -> NDArray[np.float64] | str:
    """The inner corners (columns rows, 2) of a board in a grey picture (h, w) uint8 [px], row by row; or why not."""
    grey = np.ascontiguousarray(image, np.uint8)
    size = (pattern.columns, pattern.rows)
    found, corners = cv2.findChessboardCorners(grey, size)
    if not found:
        found, corners = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return f"no board of {pattern.columns} x {pattern.rows} inner corners in it"
    rough = np.asarray(corners, np.float32).reshape(-1, 2)
    spacing = _spacing_px(rough, pattern)
    if spacing < LEAST_SQUARE_PX:
        return f"the board's squares are only {spacing:.1f} px wide"
    rise = float(np.ravel(cv2.estimateChessboardSharpness(grey, size, rough)[0])[0])
    if MOST_RISE_PX < rise < UNKNOWN_PX:
        return f"blurred: edges take {rise:.1f} px from black to white"
    half = min(max(2, int(WINDOW * spacing)), LARGEST_WINDOW_PX)
    fine = cv2.cornerSubPix(grey, rough.reshape(-1, 1, 2).copy(), (half, half), (-1, -1), STEPS).reshape(-1, 2)
    moved = float(np.max(np.linalg.norm(fine - rough, axis=1)))
    return f"a corner is not clear to {moved:.1f} px" if moved > half else np.asarray(fine, np.float64)


def _spacing_px(corners: NDArray[Any], pattern: Pattern) -> float:
    """The least distance between neighbours."""
    grid = corners.reshape(pattern.rows, pattern.columns, 2)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1)]
    return float(min(steps))
