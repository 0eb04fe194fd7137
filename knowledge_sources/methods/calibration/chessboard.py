"""Chessboard corners in a picture, to a few hundredths of a pixel, or the reason why the picture cannot be used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Floats32
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.calibration import CalibrationSettings

_UNKNOWN_PX = 1000.0
"""OpenCV's sharpness from here on means that it could not measure it, as for squares seen at a flat angle."""


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
    def points(self) -> Floats:
        """(columns rows, 3) inner corners, row by row, in the board's plane z = 0 [m]."""
        y, x = np.divmod(np.arange(self.columns * self.rows), self.columns)
        return np.stack([x, y, np.zeros_like(x)], axis=1) * self.square_m


def find_corners(
    image: Any, pattern: Pattern, settings: CalibrationSettings = DEFAULT.calibration
) -> Floats | str:
    """Find the inner corners of a board in a grey picture (h, w) uint8.

    Returns:
        (columns rows, 2) corners, row by row [px]; or the reason why the picture cannot be used.
    """
    grey = np.ascontiguousarray(image, np.uint8)
    size = (pattern.columns, pattern.rows)
    if min(grey.shape) < min(size) * settings.min_square_px:
        return f"the picture is only {grey.shape[1]} x {grey.shape[0]} px"
    found, corners = cv2.findChessboardCorners(grey, size)
    if not found:
        found, corners = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return f"no board of {pattern.columns} x {pattern.rows} inner corners in it"
    rough = np.asarray(corners, np.float32).reshape(-1, 2)
    spacing = _measure_spacing_px(rough, pattern)
    if spacing < settings.min_square_px:
        return f"the board's squares are only {spacing:.1f} px wide"
    rise = float(np.ravel(cv2.estimateChessboardSharpness(grey, size, rough)[0])[0])
    if settings.max_edge_rise_px < rise < _UNKNOWN_PX:
        return f"blurred: edges take {rise:.1f} px from black to white"
    half = min(max(2, int(settings.corner_window_share * spacing)), settings.max_corner_window_px)
    criteria = cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, settings.corner_iterations, settings.corner_tolerance_px
    fine = cv2.cornerSubPix(grey, rough.reshape(-1, 1, 2).copy(), (half, half), (-1, -1), criteria).reshape(-1, 2)
    moved = float(np.max(np.linalg.norm(fine - rough, axis=1)))
    return f"a corner is not clear to {moved:.1f} px" if moved > half else np.asarray(fine, np.float64)


def _measure_spacing_px(corners: Floats32, pattern: Pattern) -> float:
    """The least distance between neighbouring corners [px]."""
    grid = corners.reshape(pattern.rows, pattern.columns, 2)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1)]
    return float(min(steps))
