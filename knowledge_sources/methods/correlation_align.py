"""Least-squares alignment of a patch: the last few hundredths of a pixel, and how well each direction is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_STEPS = 2

_DIRECTION_LEAK = 3e-4
"""Share of an edge's gradient energy that seems to lie along it."""

_FLOOR_PX = 0.02
"""What interpolation and rounding leave in a position [px]."""


def gradients(patch: NDArray[np.float32]) -> NDArray[np.float32]:
    """(2, cells) gradient (u, v) of a patch with a border of one, free of its mean."""
    u = patch[1:-1, 2:] - patch[1:-1, :-2]
    v = patch[2:, 1:-1] - patch[:-2, 1:-1]
    gradient = np.stack([u.ravel(), v.ravel()]) * np.float32(0.5)
    return np.asarray(gradient - gradient.mean(axis=1, keepdims=True))


def align(
    patch: NDArray[np.float32], view: NDArray[np.float32], start: NDArray[np.float64], noise: float, search: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Least-squares alignment with free gain and brightness.

    Args:
        patch: (s + 2, s + 2) template with a border of one.
        view: the window searched; `start` (u, v) is a place of the template's top-left cell in it, within a pixel.
        noise: standard deviation of the pixel noise [grey levels].
        search: half-width of the window, the most that is ever unknown [px].

    Returns:
        The place (u, v), its covariance (2, 2) [px^2], and the normalised correlation there.

    Source: S. Baker, I. Matthews, Lucas-Kanade 20 years on, IJCV 2004 (inverse composition).
    """
    widest = search**2 / 3.0
    side = patch.shape[0] - 2
    shape = patch[1:-1, 1:-1].ravel()
    shape = shape - shape.mean()
    energy = float(shape @ shape)
    gradient = gradients(patch)
    normal = _Symmetric(*(float(x) for x in (gradient @ gradient.T).ravel()[[0, 1, 3]]))
    if energy <= 0.0 or normal.uu + normal.vv <= 0.0:
        return start, np.eye(2) * widest, -1.0
    # All three rows are free of their mean, so the brightness of what is seen needs no removing.
    rows = np.concatenate([normal.damped_inverse() @ gradient, shape[None]])
    still = rows @ shape
    u, v = float(start[0]), float(start[1])
    for _ in range(_STEPS):
        du, dv, gain = (float(x) for x in rows @ _seen(view, side, u, v))
        gain = max(gain / energy, 0.05)
        u, v = u - _bounded(du / gain - float(still[0])), v - _bounded(dv / gain - float(still[1]))
    if abs(u - start[0]) > 1.0 or abs(v - start[1]) > 1.0:
        u, v = float(start[0]), float(start[1])  # it wandered off: the correlation's own peak stands
    seen = _seen(view, side, u, v)
    seen = seen - seen.mean()
    correlation = float(seen @ shape) / max(math.sqrt(float(seen @ seen) * energy), 1e-9)
    residual = seen / np.float32(max(float(seen @ shape) / energy, 0.05)) - shape
    variance = max(float(residual @ residual) / max(residual.size - 4, 1), 2.0 * noise**2)
    return np.array([u, v]), _covariance(normal, shape.size, variance, noise, widest), correlation


def _bounded(step: float) -> float:
    return min(max(step, -0.5), 0.5)


def _seen(view: NDArray[np.float32], side: int, u: float, v: float) -> NDArray[np.float32]:
    middle = (side - 1) / 2.0
    return np.asarray(cv2.getRectSubPix(view, (side, side), (u + middle, v + middle)), np.float32).ravel()


@dataclass(frozen=True, slots=True)
class _Symmetric:
    """A symmetric 2 x 2 matrix; numpy's solvers take longer to call than to compute."""

    uu: float
    uv: float
    vv: float

    def damped_inverse(self) -> NDArray[np.float32]:
        extra = 1e-3 * (self.uu + self.vv)
        a, c = self.uu + extra, self.vv + extra
        det = a * c - self.uv**2
        return np.array([[c, -self.uv], [-self.uv, a]], np.float32) / np.float32(det)

    def eigen(self) -> tuple[float, float, float]:
        """Larger and smaller eigenvalue, and the angle of the larger one's axis from u towards v [rad]."""
        mean, radius = (self.uu + self.vv) / 2.0, math.hypot((self.uu - self.vv) / 2.0, self.uv)
        return mean + radius, mean - radius, 0.5 * math.atan2(2.0 * self.uv, self.uu - self.vv)


def _covariance(normal: _Symmetric, cells: int, residual: float, noise: float, widest: float) -> NDArray[np.float64]:
    """Covariance of the place: residual variance over the gradients' energy, the noise's share of the latter removed.

    Central differences of noise of variance s^2 have variance s^2 / 2, so a blank wall has gradients, no information;
    and because their own direction is off by a per cent or two, a strong edge seems to know a little of its length.
    """
    large, small, angle = normal.eigen()
    blank = 0.5 * cells * noise**2
    scatter = math.sqrt(3.0 / cells) + 0.03
    known = (_information(value, blank, scatter) for value in (large, small - _DIRECTION_LEAK * large))
    a, b = (min(residual / max(energy, 1e-9) + _FLOOR_PX**2, widest) for energy in known)
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[a * c * c + b * s * s, (a - b) * c * s], [(a - b) * c * s, a * s * s + b * c * c]])


def _information(energy: float, blank: float, scatter: float) -> float:
    """Gradient energy beyond that of noise; none where it is within noise's own relative scatter."""
    certainty = min(max((energy / blank - 1.0) / (2.0 * scatter) - 1.0, 0.0), 1.0)
    return (energy - blank) * certainty
