"""Camera calibration from views of a chessboard: intrinsics, distortion, and their covariance.

Source: Z. Zhang, A flexible new technique for camera calibration, PAMI 22(11), 2000, as OpenCV implements it. The
covariance is computed here, as OpenCV gives standard deviations only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.calibration.chessboard import Pattern
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.calibration import CalibrationSettings
from world_models.camera import Camera
from world_models.frames import frozen

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
    def view_rms_px(self) -> Floats:
        """For each view the RMS distance between found and projected corners."""
        return np.array([_compute_rms(r) for r in self.residuals_px])

    @property
    def rms_px(self) -> float:
        """The RMS distance over all corners."""
        return _compute_rms(np.concatenate(self.residuals_px))


def calibrate(
    views: Sequence[BoardView], pattern: Pattern, size: tuple[int, int], *, with_k3: bool = False,
    settings: CalibrationSettings = DEFAULT.calibration,
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
        if len(used) < settings.min_views:
            raise ValueError(
                f"expected at least {settings.min_views} views of the board that can be used, got {len(used)}")
        fit = _fit_camera(used, pattern, size, with_k3, settings)
        rms = np.array([_compute_rms(r) for r in fit.residuals])
        worst, usual = int(np.argmax(rms)), float(np.median(rms))
        if rms[worst] <= settings.max_view_rms_ratio * usual:
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


def _fit_camera(
    views: Sequence[BoardView], pattern: Pattern, size: tuple[int, int], with_k3: bool, settings: CalibrationSettings
) -> _Fit:
    points = pattern.points.astype(np.float32)
    flags = 0 if with_k3 else cv2.CALIB_FIX_K3
    corners = [view.corners_px.astype(np.float32) for view in views]
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, settings.calibration_iterations,
                settings.calibration_tolerance)
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
