"""What a patch of pixels is like, compiled: itself between pixels, its noise, how much of a corner it is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

compiled = njit(cache=True, error_model="numpy")


@compiled
def patch(pixels: Any, centre_u: float, centre_v: float, half: int, border: int, scale: float) -> Any:
    """(n, n) float32, n = 2 half + 1 + 2 border, of ``pixels`` (h, w) round a centre, enlarged by ``scale``.

    Cubic interpolation along columns, then along rows, widened where the patch shrinks; the border repeats.
    Source: R. Keys, Cubic convolution interpolation, 1981, with a = -1/2: exact for polynomials to the second degree.
    """
    side = 2 * (half + border) + 1
    height, width = pixels.shape
    rows = np.empty((side, width))
    first, weights = _taps(centre_v, half + border, scale, height)
    for r in range(side):
        for x in range(width):
            value = 0.0
            for t in range(weights.shape[1]):
                y = first[r] + t
                if 0 <= y < height:
                    value += weights[r, t] * pixels[y, x]
            rows[r, x] = value
    first, weights = _taps(centre_u, half + border, scale, width)
    out = np.empty((side, side), np.float32)
    for r in range(side):
        for c in range(side):
            value = 0.0
            for t in range(weights.shape[1]):
                x = first[c] + t
                if 0 <= x < width:
                    value += weights[c, t] * rows[r, x]
            out[r, c] = value
    return out


@compiled
def corner_energy(image: Any, u: int, v: int, half: int) -> tuple[float, float, float]:
    """Sums of squares and products (uu, uv, vv) of an image's gradient round a pixel, free of its mean."""
    su = sv = uu = uv = vv = 0.0
    for y in range(v - half, v + half + 1):
        for x in range(u - half, u + half + 1):
            left, right = float(image[y, max(x - 1, 0)]), float(image[y, min(x + 1, image.shape[1] - 1)])
            above, below = float(image[max(y - 1, 0), x]), float(image[min(y + 1, image.shape[0] - 1), x])
            du, dv = 0.5 * (right - left), 0.5 * (below - above)
            su, sv, uu, uv, vv = su + du, sv + dv, uu + du * du, uv + du * dv, vv + dv * dv
    cells = (2 * half + 1) ** 2
    return uu - su * su / cells, uv - su * sv / cells, vv - sv * sv / cells


@compiled
def corner_strengths(image: Any, pixels: Any, half: int) -> Any:
    """(n,) root of the smaller eigenvalue of the mean squared gradient round pixels (n, 2)."""
    out = np.empty(len(pixels))
    for i in range(len(pixels)):
        uu, uv, vv = corner_energy(image, pixels[i, 0], pixels[i, 1], half)
        least = 0.5 * (uu + vv) - math.hypot(0.5 * (uu - vv), uv)
        out[i] = math.sqrt(max(least, 0.0)) / (2 * half + 1)
    return out


@compiled
def noise_response(image: Any, step: int) -> float:
    """Median size of the response to a mask that is blind to plain, linear and straight-edge structure."""
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


@compiled
def _taps(centre: float, reach: int, scale: float, size: int) -> tuple[Any, Any]:
    """For each place of the patch along one axis: the first cell that counts, and the weights from there."""
    shrink = min(scale, 1.0)
    span = math.ceil(2.0 / shrink)
    first, weights = np.empty(2 * reach + 1, np.int64), np.zeros((2 * reach + 1, 2 * span + 1))
    for i in range(2 * reach + 1):
        place = min(max((i - reach) / scale + centre, 0.0), size - 1.0)
        first[i] = math.floor(place) - span + 1
        total = 0.0
        for t in range(2 * span + 1):
            if 0 <= first[i] + t < size:
                weights[i, t] = _cubic(abs(place - (first[i] + t)) * shrink)
                total += weights[i, t]
        for t in range(2 * span + 1):
            weights[i, t] /= total
    return first, weights


@compiled
def _cubic(distance: float) -> float:
    if distance <= 1.0:
        return (1.5 * distance - 2.5) * distance * distance + 1.0
    if distance < 2.0:
        return ((2.5 - 0.5 * distance) * distance - 4.0) * distance + 2.0
    return 0.0
