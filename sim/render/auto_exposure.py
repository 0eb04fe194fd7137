"""Auto exposure and white balance, as a camera does it: from the pictures that it delivered, and with a lag.

The state depends on delivered pictures and times alone, so a run that goes on from recorded pictures has the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.render.lighting import GAMMA, Lighting

TARGET = 0.45
"""Mean level of a well exposed picture, 0..1."""
MIN_GAIN, MAX_GAIN = 0.25, 5.0
"""Of the exposure, as seen: about 1/21 and 34 times the light."""
MAX_TIME_GAIN = 2.0
"""Up to here the shutter is open longer, beyond it the signal is amplified, and its noise with it."""
MIN_BALANCE, MAX_BALANCE = 0.7, 1.4
"""Of the gains of red and blue over green."""
BLACK = 0.02
"""Added to mean levels, which may be 0."""
SETTLING_STEPS = 40


@dataclass(frozen=True, slots=True)
class AutoExposure:
    """The gain that the next picture is taken with.

    Attributes:
        exposure_lag_s, white_balance_lag_s: time constants; 0: fixed.
        gain: factor on the picture, as seen.
        red, blue: further factors on these colours.
        time_s: when the last picture was delivered.
    """

    exposure_lag_s: float
    white_balance_lag_s: float
    gain: float = 1.0
    red: float = 1.0
    blue: float = 1.0
    time_s: float = 0.0

    @staticmethod
    def of(lighting: Lighting) -> AutoExposure:
        """As it is before the first picture."""
        return AutoExposure(lighting.exposure_lag_s, lighting.white_balance_lag_s)

    @property
    def gains(self) -> NDArray[np.float32]:
        """(3,) factors on red, green and blue."""
        return np.array([self.gain * self.red, self.gain, self.gain * self.blue], np.float32)

    @property
    def amplification(self) -> float:
        """Factor on the sensor's noise."""
        return max(1.0, self.gain / MAX_TIME_GAIN)

    def settle(self, radiance: NDArray[np.float32], sensor_gain: float) -> AutoExposure:
        """After a long look at a radiance (h, w, 3), 0..1, that does not change."""
        state, small = self, np.asarray(radiance[::4, ::4], np.float64) * sensor_gain
        for _ in range(SETTLING_STEPS):
            mean = np.minimum(1.0, small * state.gains).mean(axis=(0, 1))
            state = state._follow(mean, 1.0, 1.0)
        return state

    def after(self, jpeg: bytes, time_s: float) -> AutoExposure:
        """After a picture was delivered at this time."""
        reduced = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_REDUCED_COLOR_8)
        mean = np.asarray(reduced, float).mean(axis=(0, 1))[::-1] / 255.0 if reduced is not None else np.full(3, TARGET)
        passed_s = max(0.0, time_s - self.time_s)
        shares = [1.0 - math.exp(-passed_s / lag_s) if lag_s > 0.0 else 0.0
                  for lag_s in (self.exposure_lag_s, self.white_balance_lag_s)]
        return replace(self._follow(mean, *shares), time_s=time_s)

    def _follow(self, mean: NDArray[np.float64], share: float, balance_share: float) -> AutoExposure:
        """Go a share of the way to gains with which the picture's mean (3,) would be grey and of the right level."""
        red, green, blue = mean + BLACK
        level = float(np.mean(mean)) + BLACK
        gain, new_red, new_blue = self.gain, self.red, self.blue
        if self.exposure_lag_s > 0.0:
            gain = _between(MIN_GAIN, gain * ((TARGET + BLACK) / level) ** share, MAX_GAIN)
        if self.white_balance_lag_s > 0.0:
            new_red = _between(MIN_BALANCE, new_red * (green / red) ** balance_share, MAX_BALANCE)
            new_blue = _between(MIN_BALANCE, new_blue * (green / blue) ** balance_share, MAX_BALANCE)
        return replace(self, gain=gain, red=new_red, blue=new_blue)


def _between(low: float, value: float, high: float) -> float:
    return min(max(low, float(value)), high)


def vignette(height: int, width: int, strength: float) -> NDArray[np.float32]:
    """(height, width, 1) factor on the picture, as seen: 1 in the middle, less light by ``strength`` in the corners."""
    y, x = ((np.arange(size) - (size - 1) / 2.0) / (size / 2.0) for size in (height, width))
    r2 = 0.5 * (y[:, None] ** 2 + x**2)
    return np.asarray((1.0 - strength * r2) ** (1.0 / GAMMA), np.float32)[..., None]
