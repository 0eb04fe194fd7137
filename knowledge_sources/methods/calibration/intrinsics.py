"""Calibration of a camera from views of a chessboard: intrinsics, distortion, and how sure each of them is.

Source: Z. Zhang, A flexible new technique for camera calibration, PAMI 22(11), 2000, as OpenCV implements it. The
covariance is worked out here, as OpenCV tells deviations only, and no correlations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.calibration.chessboard import Pattern
from world_models.camera import Camera
from world_models.frames import frozen

PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
LEAST_VIEWS = 4
OUTLYING = 3.0
"""A view whose RMS error is so many times the median view's is left out."""
STEPS = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-10)
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BoardView:
    """A board as it was seen: name of the picture, and inner corners (n, 2) [px]."""

    name: str
    corners_px: Floats


@dataclass(frozen=True, eq=False)
class Calibration:
    """What is known of a camera.

    Attributes:
        camera: with its distortion.
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
        """(p,) their standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def view_rms_px(self) -> Floats:
        """For each view the root mean square distance between found and projected corners."""
        return np.array([_rms(r) for r in self.residuals_px])

    @property
    def rms_px(self) -> float:
        """Over all corners."""
        return _rms(np.concatenate(self.residuals_px))


def calibrate(
    views: Sequence[BoardView], pattern: Pattern, size: tuple[int, int], *, with_k3: bool = False
) -> Calibration:
    """The camera that explains the views best, without those that stand out from the others.

    Args:
        size: (width, height) of the pictures [px].
        with_k3: find the sixth-order term of the distortion too; wide lenses need it, others are known worse by it.

    Raises:
        ValueError: too few views, or no camera explains them.
    """
    used, rejected = list(views), dict[str, str]()
    while True:
        if len(used) < LEAST_VIEWS:
            raise ValueError(f"expected at least {LEAST_VIEWS} views of the board that can be used, got {len(used)}")
        fit = _fitted(used, pattern, size, with_k3)
        rms = np.array([_rms(r) for r in fit.residuals])
        worst, usual = int(np.argmax(rms)), float(np.median(rms))
        if rms[worst] <= OUTLYING * usual:
            return _told(fit, used, rejected, size)
        why = f"its corners are off by {rms[worst]:.2f} px, {usual:.2f} px are usual here"
        rejected[used.pop(worst).name] = why


@dataclass(frozen=True, eq=False)
class _Fit:
    matrix: Floats
    distortion: Floats
    residuals: tuple[Floats, ...]
    jacobians: tuple[Floats, ...]
    """For each view (2 n, 6 + p), by its pose and by the intrinsics."""


def _fitted(views: Sequence[BoardView], pattern: Pattern, size: tuple[int, int], with_k3: bool) -> _Fit:
    points = pattern.points.astype(np.float32)
    flags = 0 if with_k3 else cv2.CALIB_FIX_K3
    corners = [view.corners_px.astype(np.float32) for view in views]
    try:
        _, matrix, distortion, turns, places = cv2.calibrateCamera(
            [points] * len(views), corners, size, np.eye(3), np.zeros(5), flags=flags, criteria=STEPS
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
    """Corners (n, 2) [px], and their derivative (2 n, 15) by rotation vector, place, and :data:`PARAMETERS`."""
    px, jacobian = cv2.projectPoints(pattern.points, turn, place, matrix, k)
    return np.asarray(px, float).reshape(-1, 2), np.asarray(jacobian, float)[:, :15]


def _told(fit: _Fit, used: Sequence[BoardView], rejected: Mapping[str, str], size: tuple[int, int]) -> Calibration:
    m = fit.matrix
    camera = Camera(float(m[0, 0]), float(m[1, 1]), float(m[0, 2]), float(m[1, 2]), *size, tuple(fit.distortion))
    free = 2 * len(np.concatenate(fit.residuals)) - 6 * len(used) - (fit.jacobians[0].shape[1] - 6)
    variance = float(np.sum(np.concatenate(fit.residuals) ** 2)) / free
    covariance = variance * np.linalg.inv(_information(fit.jacobians))
    return Calibration(camera, frozen(covariance), tuple(used), fit.residuals, rejected, variance**0.5)


def _information(jacobians: Sequence[Floats]) -> Floats:
    """(p, p) of the intrinsics, each view's pose being unknown as well (Schur complement)."""
    parts = []
    for jacobian in jacobians:
        pose, inner = jacobian[:, :6], jacobian[:, 6:]
        explained = pose @ np.linalg.lstsq(pose, inner, rcond=None)[0]
        parts.append(inner.T @ (inner - explained))
    return np.asarray(np.sum(parts, axis=0))


def _rms(residuals: Floats) -> float:
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))
