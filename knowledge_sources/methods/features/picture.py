"""Pictures as arrays: one decoder, the views of a picture that methods look at, and statistics of grey levels.

One policy on lens distortion. *As the lens made it* are ``grey``, ``color``, ``half`` and ``quarter``: who looks at
colors at a few places bends the places, not the picture (doors, colors of faces). *Rectified*, as a camera without
distortion would have taken it, are ``rectified`` and ``rectified_half``: straight edges are then straight, and pixels
follow the pinhole model (lines, templates, floor). The alternative, to find segments in the raw picture and to
undistort their ends, finds no more of the edges, and no more exactly. Without distortion both are the same.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats32, Image
from world_models.camera import Camera
from world_models.compiled import compiled

MIN_CONTRAST = 6.0  # a dark frame has less contrast (standard deviation of its grey values, 0 to 255) than this
MIN_BRIGHTNESS = 40.0  # a dark frame also has a lower mean than this; a brighter one shows a bare wall
MIN_SLOPE = 8.0  # an edge of a picture that is compared has so many grey levels a pixel
NOISE_ROWS = 64  # rows of an image, about, on which its pixel noise is estimated

ROUNDING_SIGMA = 12.0**-0.5
"""Standard deviation of rounding to whole grey levels."""


class Picture:
    """A compressed picture (JPEG or PNG) and its views, decoded when first asked for; arrays are read-only.

    Every view raises ValueError where the bytes are not a picture. ``half`` and ``quarter`` are reduced by the decoder,
    which is fast.

    Attributes:
        grey: (h, w) grey levels.
        half, quarter: (h / 2, w / 2, 3) and (h / 4, w / 4, 3) colors, red first.
    """

    def __init__(self, jpeg: bytes) -> None:
        self._jpeg = jpeg
        self._rectified: dict[tuple[Camera, Camera, bool], Image] = {}

    @cached_property
    def grey(self) -> Image:
        return _locked(_decode(self._jpeg, cv2.IMREAD_GRAYSCALE))

    @cached_property
    def half(self) -> Image:
        return _locked(_decode_color(self._jpeg, cv2.IMREAD_REDUCED_COLOR_2))

    @cached_property
    def quarter(self) -> Image:
        return _locked(_decode_color(self._jpeg, cv2.IMREAD_REDUCED_COLOR_4))

    @property
    def color(self) -> Image:
        """(h, w, 3) colors, red first; decoded every time, as no method asks twice."""
        return _decode_color(self._jpeg, cv2.IMREAD_COLOR)

    def rectified(self, lens: Camera, pinhole: Camera) -> Image:
        """(h, w) grey levels as ``pinhole`` would have taken them, which has no distortion."""
        if lens.distortion is None:
            return self.grey
        return self._remember((lens, pinhole, False), lambda: get_rectifier(lens, pinhole).rectify(self.grey))

    def rectified_half(self, lens: Camera, pinhole: Camera) -> Image:
        """(h / 2, w / 2, 3) colors, red first, as ``pinhole`` would have taken them, which has no distortion."""
        if lens.distortion is None:
            return self.half
        size = pinhole.width // 2, pinhole.height // 2

        def reduce() -> Image:
            whole = get_rectifier(lens, pinhole).rectify(self.color)
            return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.uint8)

        return self._remember((lens, pinhole, True), reduce)

    def _remember(self, key: tuple[Camera, Camera, bool], make: Callable[[], Image]) -> Image:
        if key not in self._rectified:
            self._rectified[key] = _locked(make())
        return self._rectified[key]


@lru_cache(maxsize=16)
def read_picture(jpeg: bytes) -> Picture:
    """The picture of compressed bytes.

    The last few are kept: several knowledge sources look at one picture, and templates lie in earlier ones.
    """
    return Picture(jpeg)


class Rectifier:
    """Brings pictures of a camera with lens distortion into those of one without."""

    def __init__(self, lens: Camera, pinhole: Camera) -> None:
        """Build the map between the two pictures.

        Args:
            lens: the camera as it is.
            pinhole: the camera without distortion to whose pictures they are brought.

        Raises:
            ValueError: ``pinhole`` has distortion.
        """
        if pinhole.distortion is not None:
            raise ValueError(f"expected a camera without distortion to put pictures into, got {pinhole}")
        self._size = lens.width, lens.height
        self._map = None if lens.distortion is None else _build_map(lens, pinhole)

    def rectify(self, raw: Image) -> Image:
        """Rectify a picture (h, w[, 3]) of the camera. Raises ValueError for one of another size."""
        if self._map is None:
            return raw
        if raw.shape[1::-1] != self._size:
            expected = " x ".join(map(str, self._size))
            raise ValueError(f"expected a picture of {expected} px, got one of shape {raw.shape}")
        image = cv2.remap(raw, *self._map, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(image, np.uint8)


@lru_cache(maxsize=4)
def get_rectifier(lens: Camera, pinhole: Camera) -> Rectifier:
    """The rectifier of a camera; the last few are kept."""
    return Rectifier(lens, pinhole)


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


def is_dark(brightness: float, contrast: float) -> bool:
    """Whether a picture of this mean and deviation is dark; a bright one without contrast shows a bare wall."""
    return contrast < MIN_CONTRAST and brightness < MIN_BRIGHTNESS


def estimate_noise_sigma(image: Floats32) -> float:
    """Standard deviation of the pixel noise of an image (h, w) [grey levels], at least that of rounding.

    It is the median response to a mask that is blind to plain, linear and straight-edge structure.
    Source: J. Immerkaer, Fast noise variance estimation, CVIU 64(2), 1996, with the median in place of the mean.
    """
    if min(image.shape) < 3:
        return ROUNDING_SIGMA
    step = max(image.shape[0] // NOISE_ROWS, 1)
    response = _compute_noise_response(np.ascontiguousarray(image, np.float32), step)
    return max(response / (0.6745 * 6.0), ROUNDING_SIGMA)


@compiled
def _compute_noise_response(image: Any, step: int) -> float:
    """Median absolute response of every ``step``-th row to Immerkaer's noise mask, blind to linear structure."""
    height, width = image.shape
    count = (height - 3) // step + 1
    response = np.empty(count * (width - 2))
    at = 0
    for k in range(count):
        r = k * step
        for c in range(width - 2):
            a = image[r, c] - 2.0 * image[r + 1, c] + image[r + 2, c]
            b = image[r, c + 1] - 2.0 * image[r + 1, c + 1] + image[r + 2, c + 1]
            d = image[r, c + 2] - 2.0 * image[r + 1, c + 2] + image[r + 2, c + 2]
            response[at] = abs(a - 2.0 * b + d)
            at += 1
    return float(np.median(response))


def measure_moved(before: Image, now: Image) -> float:
    """The part of the edges of a picture (h, w) that another does not show there, in that half of it where it is less:
    what moves before a camera that stands is hardly everywhere.
    """
    then, here = (right + 1j * down for down, right in (np.gradient(image.astype(float)) for image in (before, now)))
    strong, gone = np.abs(then) > MIN_SLOPE, (np.conj(then) * here).real < 0.5 * np.abs(then) ** 2
    halves = zip(np.array_split(strong, 2, axis=1), np.array_split(gone, 2, axis=1), strict=True)
    return min(float(moved[edges].mean()) if edges.any() else 0.0 for edges, moved in halves)


def _locked(image: Image) -> Image:
    image.setflags(write=False)
    return image


def _decode_color(data: bytes, flags: int) -> Image:
    return np.ascontiguousarray(_decode(data, flags)[:, :, ::-1])


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


def _build_map(lens: Camera, pinhole: Camera) -> tuple[Floats32, Floats32]:
    """Column and row (h, w) in the raw picture of each pixel of the rectified one [px]."""
    grid = np.stack(np.meshgrid(np.arange(pinhole.width), np.arange(pinhole.height)), axis=-1)
    u, v = np.moveaxis(lens.project(pinhole.rays(grid)), -1, 0).astype(np.float32)
    return np.ascontiguousarray(u), np.ascontiguousarray(v)
