"""The picture of a calibration: where corners were seen, and what the lens does to a view."""

from __future__ import annotations

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Image
from knowledge_sources.methods.calibration.intrinsics import Calibration
from knowledge_sources.methods.features import Rectifier

CORNER = (40, 40, 210)
"""Blue, green, red."""


def draw_calibration(calibration: Calibration, grey: Image) -> bytes:
    """One view (h, w) with the corners of all views, and next to it the same view rectified, as PNG bytes."""
    camera = calibration.camera
    raw = np.ascontiguousarray(grey)
    seen, rectified = (cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
                       for image in (raw, Rectifier(camera, camera.pinhole).rectify(raw)))
    for x, y in np.concatenate([view.corners_px for view in calibration.views]):
        cv2.circle(seen, (round(16 * x), round(16 * y)), 32, CORNER, -1, cv2.LINE_AA, 4)
    return bytes(cv2.imencode(".png", np.hstack([seen, rectified]))[1])
