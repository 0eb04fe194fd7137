"""What the camera port delivers, turned into an array: compressed bytes in, pixels out."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray


def decode(jpeg: bytes) -> NDArray[np.uint8]:
    """The grey picture (h, w) uint8 in compressed bytes (JPEG; PNG is understood too).

    Raises:
        ValueError: the bytes are not a picture.
    """
    return _decoded(jpeg, cv2.IMREAD_GRAYSCALE)


def decode_colour(jpeg: bytes) -> NDArray[np.uint8]:
    """The colour picture (h, w, 3) uint8, red first, in compressed bytes.

    Raises:
        ValueError: the bytes are not a picture.
    """
    return np.ascontiguousarray(_decoded(jpeg, cv2.IMREAD_COLOR)[:, :, ::-1])


def grey_float(image: Any) -> NDArray[np.float32]:
    """An image (h, w) of any number type as float32, checked; no copy where none is needed.

    Raises:
        ValueError: not two-dimensional, or with a side under 2 px.
    """
    array = np.asarray(image)
    if array.ndim != 2 or min(array.shape) < 2:
        raise ValueError(f"expected a grey image of shape (h, w), at least 2 x 2, got shape {array.shape}")
    return np.ascontiguousarray(array, np.float32)


def noise_sigma(image: NDArray[np.float32]) -> float:
    """Standard deviation of the pixel noise [grey levels], at least that of rounding to whole grey levels.

    The median response to a mask that is blind to plain, linear and straight-edge structure, on at most about 64 rows.
    Source: J. Immerkaer, Fast noise variance estimation, CVIU 64(2), 1996, with the median in place of the mean.
    """
    if min(image.shape) < 3:
        return ROUNDING_SIGMA
    step = max(image.shape[0] // 64, 1)
    rows = image[:-2:step] - 2.0 * image[1:-1:step] + image[2::step]
    response = rows[:, :-2] - 2.0 * rows[:, 1:-1] + rows[:, 2:]
    return max(float(np.median(np.abs(response))) / (0.6745 * 6.0), ROUNDING_SIGMA)


ROUNDING_SIGMA = 12.0**-0.5
"""Standard deviation of rounding to whole grey levels."""


def _decoded(data: bytes, flags: int) -> NDArray[np.uint8]:
    try:
        buffer = np.frombuffer(data, np.uint8)
    except (TypeError, ValueError, AttributeError):
        raise ValueError(f"expected the bytes of a compressed picture, got {type(data).__name__}") from None
    if not buffer.size:
        raise ValueError("expected the bytes of a JPEG or PNG picture, got none")
    try:
        image = cv2.imdecode(buffer, flags)
    except cv2.error:
        image = None
    if image is None:
        raise ValueError(f"expected the bytes of a JPEG or PNG picture, got {buffer.size} bytes that are not one")
    return np.asarray(image, np.uint8)
