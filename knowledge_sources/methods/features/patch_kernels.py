"""Compiled kernels on patches of pixels: resampling, corner strength, noise response."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

compiled = njit(cache=True, error_model="numpy")


@compiled
def resample_patch(pixels: Any, centre_u: float, centre_v: float, half: int, border: int, scale: float) -> Any:
    """Cut a patch round a centre, enlarged by a scale, by cubic convolution.

    The kernel is widened where the patch shrinks; the border of the image repeats.

    Args:
        pixels: (h, w).
        centre_u, centre_v: centre, not whole in general [px].
        half, border: the patch has n = 2 half + 1 + 2 border cells a side.

    Returns:
        (n, n) float32.

    Source: R. Keys, Cubic convolution interpolation, 1981, with a = -1/2: exact for polynomials to the second degree.
    """
    side = 2 * (half + border) + 1
    height, width = pixels.shape
    rows = np.empty((side, width))
    first, weights = _compute_taps(centre_v, half + border, scale, height)
    for r in range(side):
        for x in range(width):
            value = 0.0
            for t in range(weights.shape[1]):
                y = first[r] + t
                if 0 <= y < height:
                    value += weights[r, t] * pixels[y, x]
            rows[r, x] = value
    first, weights = _compute_taps(centre_u, half + border, scale, width)
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
def compute_corner_strengths(image: Any, pixels: Any, half: int) -> Any:
    """Corner strength (n,) of the patches round pixels (n, 2): root of the smaller eigenvalue of the mean structure
    tensor (Shi-Tomasi) [grey levels/px].
    """
    out = np.empty(len(pixels))
    for i in range(len(pixels)):
        uu, uv, vv = _compute_structure_tensor(image, pixels[i, 0], pixels[i, 1], half)
        smaller = 0.5 * (uu + vv) - math.hypot(0.5 * (uu - vv), uv)
        out[i] = math.sqrt(max(smaller, 0.0)) / (2 * half + 1)
    return out


@compiled
def _compute_structure_tensor(image: Any, u: int, v: int, half: int) -> tuple[float, float, float]:
    """Sums (uu, uv, vv) of products of the gradient round a pixel, less its mean."""
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
def compute_noise_response(image: Any, step: int) -> float:
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


@compiled
def _compute_taps(centre: float, reach: int, scale: float, size: int) -> tuple[Any, Any]:
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
                weights[i, t] = _compute_cubic_weight(abs(place - (first[i] + t)) * shrink)
                total += weights[i, t]
        for t in range(2 * span + 1):
            weights[i, t] /= total
    return first, weights


@compiled
def _compute_cubic_weight(distance: float) -> float:
    if distance <= 1.0:
        return (1.5 * distance - 2.5) * distance * distance + 1.0
    if distance < 2.0:
        return ((2.5 - 0.5 * distance) * distance - 4.0) * distance + 2.0
    return 0.0
