"""The photometric probe: does this face's region look as the model says?

Lighting is not modelled, so brightness is compared up to a gain that is given with bounds; colour shares and texture
are not so free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Appearance:
    """What a patch of an image, or a region of the model, looks like.

    Attributes:
        mean: (c,) mean of each channel, 0 to 255; c is 1 (grey) or 3.
        contrast: standard deviation of the brightness over its mean, shading (a linear trend) removed.
        busyness: mean gradient magnitude over the mean brightness [1/px]: a fine texture has more than a coarse one.
        pixels: how many pixels it rests on; 0 for the model's own.
    """

    mean: NDArray[np.float64]
    contrast: float
    busyness: float
    pixels: int = 0


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well a seen appearance agrees with an expected one, in standard deviations of what is allowed.

    Attributes:
        brightness: distance of the log gain beyond its bounds.
        colour: distance of the channels' ratios; 0 for grey images.
        texture: distance of contrast and busyness.
        testable: enough pixels were seen.
    """

    brightness: float
    colour: float
    texture: float
    testable: bool

    @property
    def distance(self) -> float:
        """All three together."""
        return math.sqrt(self.brightness**2 + self.colour**2 + self.texture**2)

    def holds(self, limit: float = 3.0) -> bool:
        """Whether what was seen is what the model says; False too where it could not be tested."""
        return self.testable and self.distance <= limit


def measure_appearance(image: Any, polygon_px: Any) -> Appearance:
    """The appearance of the image (h, w) or (h, w, 3) inside a polygon (k, 2) [px], a pixel within its edge.

    Raises:
        ValueError: shapes are wrong.
    """
    array = np.asarray(image, np.float32)
    polygon = np.asarray(polygon_px, float)
    if array.ndim not in (2, 3) or polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 3:
        got = f"{array.shape} and {polygon.shape}"
        raise ValueError(f"expected an image (h, w[, 3]) and a polygon (k >= 3, 2), got {got}")
    channels = array[..., None] if array.ndim == 2 else array
    mask = _inside(channels.shape[:2], polygon)
    count = int(mask.sum())
    if not count:
        return Appearance(np.full(channels.shape[2], np.nan), math.nan, math.nan, 0)
    mean = channels[mask].mean(axis=0, dtype=np.float64)
    grey = np.ascontiguousarray(channels.mean(axis=2))
    level = max(float(mean.mean()), 1.0)
    gu, gv = cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=0.125)
    busyness = float(np.hypot(gu, gv)[mask].mean(dtype=np.float64)) / level
    return Appearance(mean, _untilted_deviation(grey, mask) / level, busyness, count)


def agreement(
    seen: Appearance, expected: Appearance, *, gain: tuple[float, float] = (0.5, 1.5), min_pixels: int = 40
) -> Agreement:
    """Compare what was seen with what the model says, under a lighting gain within bounds.

    Raises:
        ValueError: different numbers of channels, or gain is not an interval above 0.
    """
    if len(seen.mean) != len(expected.mean):
        raise ValueError(f"expected {len(expected.mean)} colour channels, got {len(seen.mean)}")
    if not 0 < gain[0] <= gain[1]:
        raise ValueError(f"expected 0 < low <= high for the gain, got {gain}")
    if seen.pixels < min_pixels:
        return Agreement(0.0, 0.0, 0.0, False)
    log_gain = math.log((seen.mean.mean() + 2.0) / (expected.mean.mean() + 2.0))
    beyond = max(math.log(gain[0]) - log_gain, log_gain - math.log(gain[1]), 0.0)
    return Agreement(beyond / 0.1, _colour_distance(seen.mean, expected.mean), _texture_distance(seen, expected), True)


def _colour_distance(seen: NDArray[np.float64], expected: NDArray[np.float64]) -> float:
    """Distance of the shares of the channels, five per cent being one standard deviation."""
    a, b = (seen + 2.0) / (seen + 2.0).sum(), (expected + 2.0) / (expected + 2.0).sum()
    return float(np.linalg.norm(a - b)) / 0.05


def _texture_distance(seen: Appearance, expected: Appearance) -> float:
    """Distance of contrast and busyness on a scale that forgives a third, and noise on a plain wall."""
    contrast = math.log((seen.contrast + 0.03) / (expected.contrast + 0.03)) / math.log(1.5)
    busyness = math.log((seen.busyness + 0.02) / (expected.busyness + 0.02)) / math.log(1.5)
    return math.hypot(contrast, busyness)


def _inside(shape: tuple[int, ...], polygon: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels at least one pixel inside a polygon."""
    mask = np.zeros(shape, np.uint8)
    if np.all(np.isfinite(polygon)):
        bounded = np.clip(polygon, -1e4, 1e4)
        cv2.fillPoly(mask, [np.rint(bounded * 16.0).astype(np.int32)], 1, shift=4)
    return np.asarray(cv2.erode(mask, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=1)) > 0


def _untilted_deviation(grey: NDArray[np.float32], mask: NDArray[np.bool_]) -> float:
    """Standard deviation of the brightness in a mask after its best plane is taken away."""
    v, u = np.nonzero(mask)
    values = grey[mask].astype(np.float64)
    design = np.stack([np.ones(len(u)), u - u.mean(), v - v.mean()], axis=1)
    plane = np.linalg.lstsq(design, values, rcond=None)[0]
    return float(np.std(values - design @ plane))
