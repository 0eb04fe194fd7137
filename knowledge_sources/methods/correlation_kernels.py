"""The inner loops of template correlation, compiled: cutting a patch between pixels, and aligning it."""

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
def gradient_energy(cut: Any) -> tuple[float, float, float]:
    """Sums of squares and products (uu, uv, vv) of the gradient, free of its mean, of a patch with a border of one."""
    side = cut.shape[0] - 2
    su = sv = uu = uv = vv = 0.0
    for r in range(1, side + 1):
        for c in range(1, side + 1):
            u, v = 0.5 * (cut[r, c + 1] - cut[r, c - 1]), 0.5 * (cut[r + 1, c] - cut[r - 1, c])
            su, sv, uu, uv, vv = su + u, sv + v, uu + u * u, uv + u * v, vv + v * v
    cells = side * side
    return uu - su * su / cells, uv - su * sv / cells, vv - sv * sv / cells


@compiled
def aligned(cut: Any, view: Any, start_u: float, start_v: float, steps: int) -> tuple[float, float, float, float]:
    """Least-squares alignment, gain and brightness free, of a patch with a border of one.

    Args:
        view: the window searched; (start_u, start_v) is a place in it of the patch's top-left cell, within a pixel.

    Returns:
        The place (u, v), the normalised correlation there and the sum of squared residuals; a correlation of -1 for a
        patch without gradients.

    Source: S. Baker, I. Matthews, Lucas-Kanade 20 years on, IJCV 2004 (inverse composition).
    """
    side = cut.shape[0] - 2
    cells = side * side
    mean = 0.0
    for r in range(side):
        for c in range(side):
            mean += cut[r + 1, c + 1] / cells
    energy = 0.0
    for r in range(side):
        for c in range(side):
            energy += (cut[r + 1, c + 1] - mean) ** 2
    uu, uv, vv = gradient_energy(cut)
    if energy <= 0.0 or uu + vv <= 0.0:
        return start_u, start_v, -1.0, 0.0
    extra = 1e-3 * (uu + vv)
    determinant = (uu + extra) * (vv + extra) - uv * uv
    seen = np.empty((side, side))
    still_u, still_v, _ = _products(cut, cut[1:-1, 1:-1], mean, uu + extra, uv, vv + extra, determinant)
    u, v = start_u, start_v
    for _ in range(steps):
        _sample(view, u, v, seen)
        du, dv, gain = _products(cut, seen, mean, uu + extra, uv, vv + extra, determinant)
        gain = max(gain / energy, 0.05)
        u -= min(max(du / gain - still_u, -0.5), 0.5)
        v -= min(max(dv / gain - still_v, -0.5), 0.5)
    if abs(u - start_u) > 1.0 or abs(v - start_v) > 1.0:
        u, v = start_u, start_v  # it wandered off: the correlation's own peak stands
    _sample(view, u, v, seen)
    level = seen.mean()
    product = square = 0.0
    for r in range(side):
        for c in range(side):
            product += (seen[r, c] - level) * (cut[r + 1, c + 1] - mean)
            square += (seen[r, c] - level) ** 2
    gain, residual = max(product / energy, 0.05), 0.0
    for r in range(side):
        for c in range(side):
            residual += ((seen[r, c] - level) / gain - (cut[r + 1, c + 1] - mean)) ** 2
    return u, v, product / max(math.sqrt(square * energy), 1e-9), residual


@compiled
def summit(score: Any, row: int, column: int) -> tuple[float, float]:
    """Offset (u, v) of the top of the quadric through the 3 x 3 scores round a peak, at most half a cell."""
    if not (0 < row < score.shape[0] - 1 and 0 < column < score.shape[1] - 1):
        return 0.0, 0.0
    slope_u = slope_v = xx = yy = 0.0
    for k in range(-1, 2):
        left, right = float(score[row + k, column - 1]), float(score[row + k, column + 1])
        above, below = float(score[row - 1, column + k]), float(score[row + 1, column + k])
        slope_u, slope_v = slope_u + (right - left) / 6.0, slope_v + (below - above) / 6.0
        xx += (left - 2.0 * score[row + k, column] + right) / 3.0
        yy += (above - 2.0 * score[row, column + k] + below) / 3.0
    xy = float(score[row + 1, column + 1]) - score[row + 1, column - 1]
    xy = (xy - score[row - 1, column + 1] + score[row - 1, column - 1]) / 4.0
    determinant = xx * yy - xy * xy
    if not (xx < 0.0 and determinant > 1e-12):
        return 0.0, 0.0
    u, v = (xy * slope_v - yy * slope_u) / determinant, (xy * slope_u - xx * slope_v) / determinant
    return min(max(u, -0.5), 0.5), min(max(v, -0.5), 0.5)


@compiled
def second_best(score: Any, row: int, column: int, lobe: int, near: int) -> float:
    """The best score at another place, -1 where there is none.

    That is a local maximum beyond ``lobe`` cells of the best place, or anything beyond ``near``.
    """
    height, width = score.shape
    best = -1.0
    for r in range(height):
        for c in range(width):
            away = max(abs(r - row), abs(c - column))
            if away <= lobe or score[r, c] <= best:
                continue
            if away > near or score[r, c] >= score[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2].max():
                best = float(score[r, c])
    return best


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


@compiled
def _sample(view: Any, u: float, v: float, out: Any) -> None:
    """What is seen at a place between pixels, linearly; the border repeats."""
    height, width = view.shape
    left, top = math.floor(u), math.floor(v)
    right_share, low_share = u - left, v - top
    for r in range(out.shape[0]):
        y0, y1 = min(max(top + r, 0), height - 1), min(max(top + r + 1, 0), height - 1)
        for c in range(out.shape[1]):
            x0, x1 = min(max(left + c, 0), width - 1), min(max(left + c + 1, 0), width - 1)
            above = view[y0, x0] + right_share * (view[y0, x1] - view[y0, x0])
            below = view[y1, x0] + right_share * (view[y1, x1] - view[y1, x0])
            out[r, c] = above + low_share * (below - above)


@compiled
def _products(
    cut: Any, seen: Any, mean: float, uu: float, uv: float, vv: float, determinant: float
) -> tuple[float, float, float]:
    """What is seen against the patch's gradient, as a step (u, v), and against the patch, all free of their means."""
    side = cut.shape[0] - 2
    by_u = by_v = by_shape = total = su = sv = 0.0
    for r in range(side):
        for c in range(side):
            value = seen[r, c]
            u = 0.5 * (cut[r + 1, c + 2] - cut[r + 1, c])
            v = 0.5 * (cut[r + 2, c + 1] - cut[r, c + 1])
            by_u, by_v = by_u + u * value, by_v + v * value
            by_shape += (cut[r + 1, c + 1] - mean) * value
            total, su, sv = total + value, su + u, sv + v
    cells = side * side
    by_u, by_v = by_u - su * total / cells, by_v - sv * total / cells
    return (vv * by_u - uv * by_v) / determinant, (uu * by_v - uv * by_u) / determinant, by_shape
