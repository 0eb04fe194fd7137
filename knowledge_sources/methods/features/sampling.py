"""Reading an image between its pixels, at many places in one call."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

_WIDTH = 1024


def sample(image: NDArray[np.float32], x: NDArray[np.floating], y: NDArray[np.floating]) -> NDArray[np.float32]:
    """Bilinear values of an image (h, w) at places x, y [px] of any one shape; the border value continues outside."""
    count = x.size
    if not count:
        return np.zeros(x.shape, np.float32)
    rows = -(-count // _WIDTH)  # OpenCV limits both sides of the result to 32767
    maps = np.zeros((2, rows * _WIDTH), np.float32)
    maps[0, :count], maps[1, :count] = x.ravel(), y.ravel()
    map_x, map_y = maps.reshape(2, rows, _WIDTH)
    values = cv2.remap(image, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, np.float32).ravel()[:count].reshape(x.shape)
