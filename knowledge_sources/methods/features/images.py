"""What the camera port delivers, turned into an array: compressed bytes in, pixels out."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.correlation_kernels import noise_response


@lru_cache(maxsize=8)
def decode(jpeg: bytes) -> NDArray[np.uint8]:
    """The grey picture (h, w) uint8, read-only, in compressed bytes (JPEG; PNG is understood too).

    The last few are remembered: several experts look at one frame, and landmarks' templates lie in earlier ones.

    Raises:
        ValueError: the bytes are not a picture.
    """
    image = _decoded(jpeg, cv2.IMREAD_GRAYSCALE)
    image.setflags(write=False)
    return image


def decode_colour(jpeg: bytes) -> NDArray[np.uint8]:
    """The colour picture (h, w, 3) uint8, red first, in compressed bytes.

    Raises:
        ValueError: the bytes are not a picture.
    """
    return np.ascontiguousarray(_decoded(jpeg, cv2.IMREAD_COLOR)[:, :, ::-1])


def to_grey_float(image: Any) -> NDArray[np.float32]:
    """An image (h, w) of any number type as float32, checked; no copy where none is needed.

    Raises:
        ValueError: not two-dimensional, or with a side under 2 px.
    """
    return np.ascontiguousarray(require_grey(image), np.float32)


def require_grey(image: Any) -> NDArray[Any]:
    """An image (h, w) of any number type, as it is. Raises ValueError as :func:`to_grey_float`."""
    array = np.asarray(image)
    if array.ndim != 2 or min(array.shape) < 2:
        raise ValueError(f"expected a grey image of shape (h, w), at least 2 x 2, got shape {array.shape}")
    return array


def compute_mean_and_deviation(image: NDArray[np.uint8]) -> tuple[float, float]:
    """Mean and standard deviation of the grey levels of an image (h, w)."""
    mean, spread = cv2.meanStdDev(image)
    return float(mean[0, 0]), float(spread[0, 0])


def estimate_noise_sigma(image: NDArray[np.float32]) -> float:
    """Standard deviation of the pixel noise [grey levels], at least that of rounding to whole grey levels.

    The median response to a mask that is blind to plain, linear and straight-edge structure, on at most about 64 rows.
    Source: J. Immerkaer, Fast noise variance estimation, CVIU 64(2), 1996, with the median in place of the mean.
    """
    if min(image.shape) < 3:
        return ROUNDING_SIGMA
    step = max(image.shape[0] // 64, 1)
    response = noise_response(np.ascontiguousarray(image, np.float32), step)
    return max(response / (0.6745 * 6.0), ROUNDING_SIGMA)


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
