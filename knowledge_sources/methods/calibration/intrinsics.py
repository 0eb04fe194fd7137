"""Camera calibration from views of a chessboard: corners, intrinsics, distortion, and their covariance.

Corners are found to a few hundredths of a pixel; where a picture cannot be used it is said why. Source: Z. Zhang, A
flexible new technique for camera calibration, PAMI 22(11), 2000, as OpenCV implements it. The covariance is computed
here, as OpenCV gives standard deviations only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Floats32
from world_models.camera import Camera
from world_models.frames import frozen

MIN_SQUARE_PX = 5.0  # least side of a chessboard's square in a picture that is used
MAX_EDGE_RISE_PX = 5.0  # largest width of the rise from black to white before a picture counts as blurred
CORNER_WINDOW_SHARE = 0.4
"""Half-width of the window of corner refinement as a share of the distance to the next corner (rendered boards: 0.048
px RMS with 3 px, 0.035 px with 8 px)."""
MAX_CORNER_WINDOW_PX = 11  # largest half-width of that window
CORNER_ITERATIONS = 60  # iteration limit of corner refinement
CORNER_TOLERANCE_PX = 1e-4  # step at which corner refinement ends

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


def find_corners(image: Any, pattern: Pattern) -> Floats | str:
    """Find the inner corners of a board in a grey picture (h, w) uint8.

    Returns:
        (columns rows, 2) corners, row by row [px]; or the reason why the picture cannot be used.
    """
    grey = np.ascontiguousarray(image, np.uint8)
    size = (pattern.columns, pattern.rows)
    if min(grey.shape) < min(size) * MIN_SQUARE_PX:
        return f"the picture is only {grey.shape[1]} x {grey.shape[0]} px"
    found, corners = cv2.findChessboardCorners(grey, size)
    if not found:
        found, corners = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return f"no board of {pattern.columns} x {pattern.rows} inner corners in it"
    rough = np.asarray(corners, np.float32).reshape(-1, 2)
    spacing = _measure_spacing_px(rough, pattern)
    if spacing < MIN_SQUARE_PX:
        return f"the board's squares are only {spacing:.1f} px wide"
    rise = float(np.ravel(cv2.estimateChessboardSharpness(grey, size, rough)[0])[0])
    if MAX_EDGE_RISE_PX < rise < _UNKNOWN_PX:
        return f"blurred: edges take {rise:.1f} px from black to white"
    half = min(max(2, int(CORNER_WINDOW_SHARE * spacing)), MAX_CORNER_WINDOW_PX)
    criteria = cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, CORNER_ITERATIONS, CORNER_TOLERANCE_PX
    fine = cv2.cornerSubPix(grey, rough.reshape(-1, 1, 2).copy(), (half, half), (-1, -1), criteria).reshape(-1, 2)
    moved = float(np.max(np.linalg.norm(fine - rough, axis=1)))
    return f"a corner is not clear to {moved:.1f} px" if moved > half else np.asarray(fine, np.float64)


def _measure_spacing_px(corners: Floats32, pattern: Pattern) -> float:
    """The least distance between neighbouring corners [px]."""
    grid = corners.reshape(pattern.rows, pattern.columns, 2)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1)]
    return float(min(steps))


MIN_VIEWS = 4  # least number of views of the board (Zhang 2000)
MAX_VIEW_RMS_RATIO = 3.0  # largest RMS error of a view over that of the median view before it is left out
CALIBRATION_ITERATIONS = 100  # iteration limit of the calibration
CALIBRATION_TOLERANCE = 1e-10  # relative step at which the calibration ends

GRID = 9  # places along each side of the picture at which it is said how sure the camera is

PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
"""Names of the parameters, in OpenCV's order."""


@dataclass(frozen=True, eq=False)
class BoardView:
    """One view of a board: name of the picture, and inner corners (n, 2) [px]."""

    name: str
    corners_px: Floats


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated camera.

    Attributes:
        camera: intrinsics and distortion.
        covariance: (p, p) of the first p of :data:`PARAMETERS`.
        views: those that were used.
        residuals_px: for each view, (n, 2) found minus projected [px].
        rejected: name of a view -> why it was left out.
        sigma_px: standard deviation of a corner's coordinate, from the residuals.
    """

    camera: Camera
    covariance: Floats
    views: tuple[BoardView, ...]
    residuals_px: tuple[Floats, ...]
    rejected: Mapping[str, str]
    sigma_px: float

    @property
    def values(self) -> Floats:
        """(p,) the parameters, in the order of :data:`PARAMETERS`."""
        c = self.camera
        return np.array([c.fx, c.fy, c.cx, c.cy, *c.distortion])[: len(self.covariance)]

    @property
    def deviations(self) -> Floats:
        """(p,) standard deviations of the parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def spread_px(self) -> float:
        """Standard deviation of where a direction is seen [px], by the covariance; the median over the picture."""
        c, p = self.camera, len(self.covariance)
        u, v = np.meshgrid(np.linspace(0, c.width - 1, GRID), np.linspace(0, c.height - 1, GRID))
        rays = np.stack([(u - c.cx) / c.fx, (v - c.cy) / c.fy, np.ones_like(u)], axis=-1).reshape(-1, 3)
        inner = np.asarray(cv2.projectPoints(rays, np.zeros(3), np.zeros(3), c.matrix, c.distortion)[1])[:, 6 : 6 + p]
        variances = np.einsum("ij,jk,ik->i", inner, self.covariance, inner).reshape(-1, 2).sum(axis=1)
        return float(np.sqrt(np.median(variances)))

    @property
    def view_rms_px(self) -> Floats:
        """For each view the RMS distance between found and projected corners."""
        return np.array([_compute_rms(r) for r in self.residuals_px])

    @property
    def rms_px(self) -> float:
        """The RMS distance over all corners."""
        return _compute_rms(np.concatenate(self.residuals_px))


def calibrate(
    views: Sequence[BoardView], pattern: Pattern, size: tuple[int, int], *, with_k3: bool = False,
) -> Calibration:
    """Estimate the camera from views of a board, and reject views whose error is an outlier.

    Args:
        size: (width, height) of the pictures [px].
        with_k3: estimate the sixth-order term of the distortion too; wide lenses need it, others lose accuracy by it.

    Raises:
        ValueError: too few views, or no camera explains them.
    """
    used, rejected = list(views), dict[str, str]()
    while True:
        if len(used) < MIN_VIEWS:
            raise ValueError(
                f"expected at least {MIN_VIEWS} views of the board that can be used, got {len(used)}")
        fit = _fit_camera(used, pattern, size, with_k3)
        rms = np.array([_compute_rms(r) for r in fit.residuals])
        worst, usual = int(np.argmax(rms)), float(np.median(rms))
        if rms[worst] <= MAX_VIEW_RMS_RATIO * usual:
            return _to_calibration(fit, used, rejected, size)
        why = f"its corners are off by {rms[worst]:.2f} px, {usual:.2f} px are usual here"
        rejected[used.pop(worst).name] = why


@dataclass(frozen=True, eq=False)
class _Fit:
    """Camera matrix (3, 3), distortion (5,), and for each view the residuals (n, 2) [px] and their derivative
    (2 n, 6 + p) by the view's pose and by the intrinsics.
    """

    matrix: Floats
    distortion: Floats
    residuals: tuple[Floats, ...]
    jacobians: tuple[Floats, ...]


def _fit_camera(views: Sequence[BoardView], pattern: Pattern, size: tuple[int, int], with_k3: bool) -> _Fit:
    points = pattern.points.astype(np.float32)
    flags = 0 if with_k3 else cv2.CALIB_FIX_K3
    corners = [view.corners_px.astype(np.float32) for view in views]
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, CALIBRATION_ITERATIONS,
                CALIBRATION_TOLERANCE)
    try:
        _, matrix, distortion, turns, places = cv2.calibrateCamera(
            [points] * len(views), corners, size, np.eye(3), np.zeros(5), flags=flags, criteria=criteria
        )
    except cv2.error as error:
        raise ValueError(f"expected views that a camera explains, got: {error.err}") from None
    k = np.asarray(distortion, float).ravel()[:5]
    if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(k))):
        raise ValueError("expected views that a camera explains, got none that fits")
    poses = [(np.asarray(t, float), np.asarray(p, float)) for t, p in zip(turns, places, strict=True)]
    seen = [project_board(pattern, turn, place, np.asarray(matrix, float), k) for turn, place in poses]
    residuals = tuple(view.corners_px - px for view, (px, _) in zip(views, seen, strict=True))
    return _Fit(np.asarray(matrix, float), k, residuals, tuple(j[:, : 15 if with_k3 else 14] for _, j in seen))


def project_board(pattern: Pattern, turn: Floats, place: Floats, matrix: Floats, k: Floats) -> tuple[Floats, Floats]:
    """Project the corners (n, 2) [px], with the derivative (2 n, 15) by rotation vector, place, :data:`PARAMETERS`."""
    px, jacobian = cv2.projectPoints(pattern.points, turn, place, matrix, k)
    return np.asarray(px, float).reshape(-1, 2), np.asarray(jacobian, float)[:, :15]


def _to_calibration(
    fit: _Fit, used: Sequence[BoardView], rejected: Mapping[str, str], size: tuple[int, int]
) -> Calibration:
    m = fit.matrix
    camera = Camera(float(m[0, 0]), float(m[1, 1]), float(m[0, 2]), float(m[1, 2]), *size, tuple(fit.distortion))
    free = 2 * len(np.concatenate(fit.residuals)) - 6 * len(used) - (fit.jacobians[0].shape[1] - 6)
    variance = float(np.sum(np.concatenate(fit.residuals) ** 2)) / free
    covariance = variance * np.linalg.inv(_compute_information(fit.jacobians))
    return Calibration(camera, frozen(covariance), tuple(used), fit.residuals, rejected, variance**0.5)


def _compute_information(jacobians: Sequence[Floats]) -> Floats:
    """Information matrix (p, p) of the intrinsics with each view's pose marginalized (Schur complement)."""
    parts = []
    for jacobian in jacobians:
        pose, inner = jacobian[:, :6], jacobian[:, 6:]
        explained = pose @ np.linalg.lstsq(pose, inner, rcond=None)[0]
        parts.append(inner.T @ (inner - explained))
    return np.asarray(np.sum(parts, axis=0))


def _compute_rms(residuals: Floats) -> float:
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))
