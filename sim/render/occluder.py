"""Something before the camera that hides a part of the view: a coat, a cable, dirt on the glass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
