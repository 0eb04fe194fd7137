"""The image sensor: blur, exposure, noise, JPEG, as a USB camera delivers it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from world_models.compiled import compiled
from world_models.units import Bounded, bounded

MIN_SHADE, MAX_SHADE = 0.05, 0.6
"""Range of its brightness, 0..1."""


@dataclass(frozen=True, slots=True)
class Occluder:
    """A rectangle of one brightness in the picture.

    Attributes:
        left, top, width, height: relative to the picture's width and height, 0..1.
        shade: its brightness, 0..1.
        until_s: simulated time at which it is gone [s].
    """

    left: float
    top: float
    width: float
    height: float
    shade: float
    until_s: float

    @staticmethod
    def draw(part: float, until_s: float, rng: np.random.Generator) -> Occluder:
        """A random rectangle with ``part`` of the picture's area. Always takes four numbers from ``rng``."""
        shape, left, top, shade = rng.random(4)
        width = part ** (0.25 + 0.5 * float(shape))
        height = part / width
        return Occluder(
            float(left) * (1.0 - width), float(top) * (1.0 - height), width, height,
            MIN_SHADE + (MAX_SHADE - MIN_SHADE) * float(shade), until_s,
        )

    def cover(self, radiance: NDArray[np.float32]) -> NDArray[np.float32]:
        """A copy of a radiance (h, w, 3), 0..1, with the occluder in it."""
        rows, columns = radiance.shape[:2]
        top, bottom = round(self.top * rows), round((self.top + self.height) * rows)
        left, right = round(self.left * columns), round((self.left + self.width) * columns)
        seen = radiance.copy()
        seen[top:bottom, left:right] = self.shade
        return seen


MEAN, INVERSE_SIGMA = np.float32(510.0), np.float32(1.0 / np.sqrt((256.0**2 - 1.0) / 3.0))
"""Mean and reciprocal standard deviation of the sum of four random bytes."""
MIN_LEVEL, HALF, MAX_LEVEL = np.float32(0.0), np.float32(0.5), np.float32(255.0)


@dataclass(frozen=True, slots=True)
class SensorParameters(Bounded):
    """Exposure, noise and compression of the sensor.

    Attributes:
        gain: brightness of the image over the rendered radiance.
        gain_sigma: relative standard deviation of the gain from frame to frame.
        blur_px: standard deviation of the Gaussian blur; 0 for none.
        read_noise: standard deviation in the dark [grey levels].
        shot_noise: variance for each grey level of brightness [grey levels].
        jpeg_quality: 1..100.
        frames_per_s: frame rate on the move.
        exposure_s: exposure time of a picture on the move; 0: no motion blur.
        lights_off_gain: factor on the brightness while the lights are off.
    """

    gain: float = bounded(1.25, 0.0, 1000.0)
    gain_sigma: float = bounded(0.005, 0.0, 10.0)
    blur_px: float = bounded(0.5, 0.0, 50.0)
    read_noise: float = bounded(1.0, 0.0, 1000.0)
    shot_noise: float = bounded(0.015, 0.0, 1000.0)
    jpeg_quality: int = bounded(92, 1, 100)
    frames_per_s: float = bounded(30.0, 1.0, 1000.0)
    exposure_s: float = bounded(0.0, 0.0, 10.0)
    lights_off_gain: float = bounded(0.02, 0.0, 1000.0)


def expose(
    radiance: NDArray[np.float32], parameters: SensorParameters, rng: np.random.Generator, *, lights_on: bool = True
) -> NDArray[np.uint8]:
    """The image (h, w, 3) uint8 of a radiance (h, w, 3), 0..1. Always takes two numbers from ``rng``."""
    gain = parameters.gain * max(0.0, 1.0 + parameters.gain_sigma * float(rng.standard_normal()))
    key = int(rng.integers(0, 2**62))
    if not lights_on:
        gain *= parameters.lights_off_gain
    if parameters.blur_px > 0:
        radiance = np.asarray(cv2.GaussianBlur(radiance, (0, 0), parameters.blur_px), np.float32)
    image: NDArray[np.uint8] = _add_noise(
        radiance, np.float32(255.0 * gain), np.float32(parameters.read_noise**2), np.float32(parameters.shot_noise),
        np.uint32(key & 0xFFFFFFFF), np.uint32(key >> 32),
    )
    return image


def skip_noise_draws(rng: np.random.Generator) -> None:
    """Take from ``rng`` the numbers that :func:`expose` takes, for a picture that need not be rendered."""
    rng.standard_normal()
    rng.integers(0, 2**62)


def compress_jpeg(image_rgb: NDArray[np.uint8], quality: int) -> bytes:
    """JPEG bytes of an RGB image (h, w, 3)."""
    done, data = cv2.imencode(".jpg", cv2.cvtColor(image_rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"expected an image that can be compressed, got shape {image_rgb.shape}")
    return bytes(data)


@compiled
def _add_noise(radiance: Any, gain: Any, read_variance: Any, shot: Any, key: Any, salt: Any) -> Any:
    """Add noise of variance ``read_variance + shot * level`` and round to 8 bits.

    A counter-based hash (MurmurHash3's finalizer) gives four random bytes; their sum is nearly Gaussian to 3.4 sigma.
    All arithmetic is in 32 bits, so that LLVM vectorizes it.
    """
    levels = radiance.ravel()
    out = np.empty(len(levels), np.uint8)
    for i in range(len(levels)):
        h = np.uint32(np.uint32(np.uint32(i) + key) * np.uint32(0x9E3779B9)) ^ salt
        h = np.uint32(np.uint32(h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B))
        h = np.uint32(np.uint32(h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35))
        h = np.uint32(h ^ (h >> np.uint32(16)))
        pairs = np.uint32((h & np.uint32(0xFF00FF)) + ((h >> np.uint32(8)) & np.uint32(0xFF00FF)))
        total = np.int32(np.uint32((pairs & np.uint32(0xFFFF)) + (pairs >> np.uint32(16))))
        level = gain * levels[i]
        noise = (np.float32(total) - MEAN) * INVERSE_SIGMA * np.sqrt(read_variance + shot * level)
        out[i] = np.uint8(np.int32(np.minimum(MAX_LEVEL, np.maximum(MIN_LEVEL, level + noise + HALF))))
    return out.reshape(radiance.shape)
