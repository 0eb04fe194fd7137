"""An occluder: something before the camera that hides a part of the view, as a coat, a cable or dirt on the glass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SHADES = (0.05, 0.6)
"""Between these is the brightness of what is before the camera, 0..1."""


@dataclass(frozen=True, slots=True)
class Occluder:
    """A rectangle of one shade, as a part of the picture.

    Attributes:
        left, top, width, height: as parts of the picture's width and height, 0..1.
        shade: its brightness, 0..1.
        until_s: when it is gone [s].
    """

    left: float
    top: float
    width: float
    height: float
    shade: float
    until_s: float

    @staticmethod
    def draw(part: float, until_s: float, rng: np.random.Generator) -> Occluder:
        """One that hides ``part`` of the picture, anywhere in it; always four draws from ``rng``."""
        shape, left, top, shade = rng.random(4)
        width = part ** (0.25 + 0.5 * float(shape))
        height = part / width
        low, high = SHADES
        return Occluder(
            float(left) * (1.0 - width), float(top) * (1.0 - height), width, height, low + (high - low) * float(shade),
            until_s,
        )

    def cover(self, radiance: NDArray[np.float32]) -> NDArray[np.float32]:
        """A picture (h, w, 3) of light in 0..1 with the occluder in it."""
        rows, columns = radiance.shape[:2]
        top, bottom = round(self.top * rows), round((self.top + self.height) * rows)
        left, right = round(self.left * columns), round((self.left + self.width) * columns)
        seen = radiance.copy()
        seen[top:bottom, left:right] = self.shade
        return seen
