"""Pictures as arrays: decoding, checks, statistics."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats32, Image
from knowledge_sources.methods.features.patch_kernels import compute_noise_response
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.features import FeaturesSettings

ROUNDING_SIGMA = 12.0**-0.5
"""Standard deviation of rounding to whole grey levels."""


@lru_cache(maxsize=8)
def decode(jpeg: bytes) -> Image:
    """Decode a compressed picture (JPEG or PNG) to grey levels (h, w), read-only.

    The last few pictures are cached: several knowledge sources look at one frame, and landmarks' templates lie in
    earlier ones.

    Raises:
        ValueError: the bytes are not a picture.
    """
    image = _decode(jpeg, cv2.IMREAD_GRAYSCALE)
    image.setflags(write=False)
    return image


def decode_colour(jpeg: bytes) -> Image:
    """Decode a compressed picture (JPEG or PNG) to colours (h, w, 3), red first.

    Raises:
        ValueError: the bytes are not a picture.
    """
    return np.ascontiguousarray(_decode(jpeg, cv2.IMREAD_COLOR)[:, :, ::-1])


def to_grey_float(image: Any) -> Floats32:
    """An image (h, w) of any number type as contiguous float32; no copy where none is needed.

    Raises:
        ValueError: the image is not two-dimensional, or a side is under 2 px.
    """
    return np.ascontiguousarray(require_grey(image), np.float32)


def require_grey(image: Any) -> NDArray[Any]:
    """An image (h, w) as an array of its own number type. Raises ValueError as :func:`to_grey_float`."""
    array = np.asarray(image)
    if array.ndim != 2 or min(array.shape) < 2:
        raise ValueError(f"expected a grey image of shape (h, w), at least 2 x 2, got shape {array.shape}")
    return array


def compute_mean_and_deviation(image: Image) -> tuple[float, float]:
    """Mean and standard deviation of the grey levels of an image (h, w)."""
    mean, deviation = cv2.meanStdDev(image)
    return float(mean[0, 0]), float(deviation[0, 0])


def estimate_noise_sigma(image: Floats32, settings: FeaturesSettings = DEFAULT.features) -> float:
    """Standard deviation of the pixel noise of an image (h, w) [grey levels], at least that of rounding.

    It is the median response to a mask that is blind to plain, linear and straight-edge structure.
    Source: J. Immerkaer, Fast noise variance estimation, CVIU 64(2), 1996, with the median in place of the mean.
    """
    if min(image.shape) < 3:
        return ROUNDING_SIGMA
    step = max(image.shape[0] // settings.noise_rows, 1)
    response = compute_noise_response(np.ascontiguousarray(image, np.float32), step)
    return max(response / (0.6745 * 6.0), ROUNDING_SIGMA)


def _decode(data: bytes, flags: int) -> Image:
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
