"""Least-squares alignment of a patch: the last few hundredths of a pixel, and how well each direction is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods import correlation_kernels as kernels

_STEPS = 2

_DIRECTION_LEAK = 3e-4
"""Share of an edge's gradient energy that seems to lie along it."""

_FLOOR_PX = 0.02
"""What interpolation and rounding leave in a position [px]."""


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

    """
    widest = search**2 / 3.0
    u, v, correlation, squares = kernels.aligned(patch, view, float(start[0]), float(start[1]), _STEPS)
    if correlation == -1.0:
        return start, np.eye(2) * widest, correlation
    cells = (patch.shape[0] - 2) ** 2
    variance = max(squares / max(cells - 4, 1), 2.0 * noise**2)
    energy = _Symmetric(*kernels.gradient_energy(patch))
    return np.array([u, v]), _covariance(energy, cells, variance, noise, widest), correlation


@dataclass(frozen=True, slots=True)
class _Symmetric:
    """A symmetric 2 x 2 matrix; numpy's solvers take longer to call than to compute."""

    uu: float
    uv: float
    vv: float

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
