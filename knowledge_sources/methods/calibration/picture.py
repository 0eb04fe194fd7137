"""The picture of a calibration: where corners were seen, how far off they are, and what the lens does."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.calibration.intrinsics import Calibration
from knowledge_sources.methods.features.rectification import Rectifier

SIDE_PX = 560
"""Width of each of the three parts."""
RESIDUAL_PX = 12.0
"""How long an arrow of the RMS error is drawn."""
INK, GRID, SEEN, OFF = (40, 40, 40), (225, 225, 225), (160, 120, 40), (40, 40, 210)
"""Blue, green, red."""
Image = NDArray[np.uint8]


def draw_calibration(calibration: Calibration, grey: NDArray[np.uint8]) -> bytes:
    """PNG bytes: corners of all views with their errors; one view (h, w) as it came; the same one straightened."""
    camera = calibration.camera
    straight = Rectifier(camera, camera.pinhole).rectify(np.ascontiguousarray(grey))
    rms, views = calibration.rms_px, len(calibration.views)
    scale = RESIDUAL_PX / max(rms, 1e-6)
    parts = (
        (_coverage(calibration, scale), f"corners of {views} views; errors x {scale:.0f} (RMS {rms:.3f} px)"),
        (cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), "a view as it came"),
        (cv2.cvtColor(straight, cv2.COLOR_GRAY2BGR), "without the lens's distortion"),
    )
    gap = np.full((1, 8, 3), 255, np.uint8)
    shown = [_titled(np.asarray(image, np.uint8), title) for image, title in parts]
    row = np.hstack([x for part in shown for x in (part, np.repeat(gap, part.shape[0], axis=0))][:-1])
    return bytes(cv2.imencode(".png", row)[1])


def _coverage(calibration: Calibration, scale: float) -> Image:
    """Where corners were found, on squares of an eighth of the picture, and arrows to where they were found from."""
    camera = calibration.camera
    zoom = SIDE_PX / camera.width
    image = np.full((round(camera.height * zoom), SIDE_PX, 3), 255, np.uint8)
    for i in range(1, 8):
        x, y = i * image.shape[1] // 8, i * image.shape[0] // 8
        cv2.line(image, (x, 0), (x, image.shape[0]), GRID)
        cv2.line(image, (0, y), (image.shape[1], y), GRID)
    for view, residuals in zip(calibration.views, calibration.residuals_px, strict=True):
        for corner, off in zip(view.corners_px, residuals, strict=True):
            _arrow(image, zoom * corner, zoom * corner + scale * off)
    return image


def _arrow(image: Image, start: Any, end: Any) -> None:
    first, last = (tuple(round(16 * float(c)) for c in point) for point in (start, end))
    cv2.circle(image, first, 24, SEEN, -1, cv2.LINE_AA, 4)
    cv2.line(image, first, last, OFF, 1, cv2.LINE_AA, 4)


def _titled(image: Image, title: str) -> Image:
    """At the common width, with a line of text above."""
    height = round(image.shape[0] * SIDE_PX / image.shape[1])
    shown = cv2.resize(image, (SIDE_PX, height), interpolation=cv2.INTER_AREA)
    head = np.full((32, SIDE_PX, 3), 255, np.uint8)
    cv2.putText(head, title, (8, 21), cv2.FONT_HERSHEY_SIMPLEX, 0.5, INK, 1, cv2.LINE_AA)
    return np.vstack([head, shown])
