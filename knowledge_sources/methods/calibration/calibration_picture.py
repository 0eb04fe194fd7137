"""The picture of a calibration: where corners were seen, their residuals, and the effect of the lens."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Image
from knowledge_sources.methods.calibration.intrinsics import Calibration
from knowledge_sources.methods.features import Rectifier

SIDE_PX = 560
"""Width of each of the three parts."""
RESIDUAL_PX = 12.0
"""Length at which an arrow of the RMS error is drawn."""
INK, GRID, CORNER, RESIDUAL = (40, 40, 40), (225, 225, 225), (160, 120, 40), (40, 40, 210)
"""Blue, green, red."""


def draw_calibration(calibration: Calibration, grey: Image) -> bytes:
    """Draw a calibration as PNG bytes: corners of all views with their residuals, one view (h, w) raw and rectified.
    """
    camera = calibration.camera
    rectified = Rectifier(camera, camera.pinhole).rectify(np.ascontiguousarray(grey))
    rms, views = calibration.rms_px, len(calibration.views)
    scale = RESIDUAL_PX / max(rms, 1e-6)
    parts = (
        (_draw_coverage(calibration, scale), f"corners of {views} views; errors x {scale:.0f} (RMS {rms:.3f} px)"),
        (cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), "a raw view"),
        (cv2.cvtColor(rectified, cv2.COLOR_GRAY2BGR), "the same view, rectified"),
    )
    gap = np.full((1, 8, 3), 255, np.uint8)
    shown = [_add_title(np.asarray(image, np.uint8), title) for image, title in parts]
    row = np.hstack([x for part in shown for x in (part, np.repeat(gap, part.shape[0], axis=0))][:-1])
    return bytes(cv2.imencode(".png", row)[1])


def _draw_coverage(calibration: Calibration, scale: float) -> Image:
    """Corners on a grid of eighths of the picture, with arrows along their residuals."""
    camera = calibration.camera
    zoom = SIDE_PX / camera.width
    image = np.full((round(camera.height * zoom), SIDE_PX, 3), 255, np.uint8)
    for i in range(1, 8):
        x, y = i * image.shape[1] // 8, i * image.shape[0] // 8
        cv2.line(image, (x, 0), (x, image.shape[0]), GRID)
        cv2.line(image, (0, y), (image.shape[1], y), GRID)
    for view, residuals in zip(calibration.views, calibration.residuals_px, strict=True):
        for corner, off in zip(view.corners_px, residuals, strict=True):
            _draw_arrow(image, zoom * corner, zoom * corner + scale * off)
    return image


def _draw_arrow(image: Image, start: Any, end: Any) -> None:
    first, last = (tuple(round(16 * float(c)) for c in point) for point in (start, end))
    cv2.circle(image, first, 24, CORNER, -1, cv2.LINE_AA, 4)
    cv2.line(image, first, last, RESIDUAL, 1, cv2.LINE_AA, 4)


def _add_title(image: Image, title: str) -> Image:
    """Resize an image to the common width, with a line of text above."""
    height = round(image.shape[0] * SIDE_PX / image.shape[1])
    shown = cv2.resize(image, (SIDE_PX, height), interpolation=cv2.INTER_AREA)
    head = np.full((32, SIDE_PX, 3), 255, np.uint8)
    cv2.putText(head, title, (8, 21), cv2.FONT_HERSHEY_SIMPLEX, 0.5, INK, 1, cv2.LINE_AA)
    return np.vstack([head, shown])
