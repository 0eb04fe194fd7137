"""Compiled kernels on a window of correlation scores: peak, sub-pixel alignment, covariance, second peak."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

compiled = njit(cache=True, error_model="numpy")

Peak = tuple[float, float, float, float, float, float, float, bool]


@compiled
def find_peak(
    patch: Any, view: Any, score: Any, noise: float, search: float, steps: int, leak: float, floor: float, lobe: int
) -> Peak:
    """Find the best place of a window, align it by least squares, and compute its covariance.

    Args:
        patch: (s + 2, s + 2) template with a border of one.
        view: the window.
        score: the correlation at each place of the template's top-left cell in the window.
        noise: standard deviation of the pixel noise [grey levels].
        search: half-width of the window, the largest possible error [px].
        steps, leak, floor, lobe: ``alignment_steps``, ``gradient_leak``, ``position_floor_px`` and ``peak_lobe_px`` of
            the settings.

    Returns:
        The place (u, v), its covariance (uu, uv, vv) [px^2], the correlation there, the second peak, and whether the
        place lies at the window's border, so that the true one may be outside.
    """
    at = np.argmax(score)
    row, column = at // score.shape[1], at % score.shape[1]
    du, dv = _fit_quadric(score, row, column)
    start_u, start_v = column + du, row + dv
    u, v, correlation, squares = _align(patch, view, start_u, start_v, steps)
    uu, uv, vv = search**2 / 3.0, 0.0, search**2 / 3.0
    if correlation > -1.0:
        uu, uv, vv = _compute_covariance(patch, squares, noise, search, leak, floor)
    last_u, last_v = score.shape[1] - 1, score.shape[0] - 1
    border = row == 0 or row == last_v or column == 0 or column == last_u
    border = border or u < 0.0 or u > last_u or v < 0.0 or v > last_v
    if border:
        u, v, correlation = start_u, start_v, -1.0
    second = find_second_peak(score, row, column, lobe, (patch.shape[0] - 3) // 4)
    return u, v, uu, uv, vv, max(float(score[row, column]), correlation), second, border


@compiled
def _compute_covariance(
    cut: Any, squares: float, noise: float, search: float, leak: float, floor: float
) -> tuple[float, float, float]:
    """Covariance (uu, uv, vv) of the place: residual variance over the gradients' energy, less the noise's share of it.

    Central differences of noise of variance s^2 have variance s^2 / 2, so a blank wall has gradients but no
    information. The gradients' own directions err by one or two per cent, so a strong edge seems to have a little
    information along its length; ``leak`` takes it off.
    """
    cells, widest = (cut.shape[0] - 2) ** 2, search**2 / 3.0
    residual = max(squares / max(cells - 4, 1), 2.0 * noise**2)
    uu, uv, vv = _compute_structure_tensor(cut)
    mean, radius = 0.5 * (uu + vv), math.hypot(0.5 * (uu - vv), uv)
    large, small = mean + radius, mean - radius
    blank, scatter = 0.5 * cells * noise**2, math.sqrt(3.0 / cells) + 0.03
    across = min(residual / max(_compute_information(large, blank, scatter), 1e-9) + floor**2, widest)
    known = _compute_information(small - leak * large, blank, scatter)
    along = min(residual / max(known, 1e-9) + floor**2, widest)
    angle = 0.5 * math.atan2(2.0 * uv, uu - vv)  # of the stronger gradient, from u towards v
    c, s = math.cos(angle), math.sin(angle)
    return across * c * c + along * s * s, (across - along) * c * s, across * s * s + along * c * c


@compiled
def _compute_information(energy: float, blank: float, scatter: float) -> float:
    """Gradient energy beyond that of noise; zero within three standard deviations of the noise's own energy."""
    certainty = min(max(0.5 * ((energy / blank - 1.0) / scatter - 3.0), 0.0), 1.0)
    return (energy - blank) * certainty


@compiled
def _compute_structure_tensor(cut: Any) -> tuple[float, float, float]:
    """Sums (uu, uv, vv) of products of the gradient, less its mean, of a patch with a border of one."""
    side = cut.shape[0] - 2
    su = sv = uu = uv = vv = 0.0
    for r in range(1, side + 1):
        for c in range(1, side + 1):
            u, v = 0.5 * (cut[r, c + 1] - cut[r, c - 1]), 0.5 * (cut[r + 1, c] - cut[r - 1, c])
            su, sv, uu, uv, vv = su + u, sv + v, uu + u * u, uv + u * v, vv + v * v
    cells = side * side
    return uu - su * su / cells, uv - su * sv / cells, vv - sv * sv / cells


@compiled
def _align(cut: Any, view: Any, start_u: float, start_v: float, steps: int) -> tuple[float, float, float, float]:
    """Align a patch with a border of one by least squares, with free gain and brightness (Lucas-Kanade).

    Args:
        view: the window; (start_u, start_v) is a place in it of the patch's top-left cell, within a pixel.

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
    uu, uv, vv = _compute_structure_tensor(cut)
    if energy <= 0.0 or uu + vv <= 0.0:
        return start_u, start_v, -1.0, 0.0
    extra = 1e-3 * (uu + vv)
    determinant = (uu + extra) * (vv + extra) - uv * uv
    seen = np.empty((side, side))
    still_u, still_v, _ = _compute_step(cut, cut[1:-1, 1:-1], mean, uu + extra, uv, vv + extra, determinant)
    u, v = start_u, start_v
    for _ in range(steps):
        _sample_window(view, u, v, seen)
        du, dv, gain = _compute_step(cut, seen, mean, uu + extra, uv, vv + extra, determinant)
        gain = max(gain / energy, 0.05)
        u -= min(max(du / gain - still_u, -0.5), 0.5)
        v -= min(max(dv / gain - still_v, -0.5), 0.5)
    if abs(u - start_u) > 1.0 or abs(v - start_v) > 1.0:
        u, v = start_u, start_v  # diverged: keep the correlation's own peak
    _sample_window(view, u, v, seen)
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
def _fit_quadric(score: Any, row: int, column: int) -> tuple[float, float]:
    """Offset (u, v) of the maximum of the quadric through the 3 x 3 scores round a peak, at most half a cell."""
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
def find_second_peak(score: Any, row: int, column: int, lobe: int, near: int) -> float:
    """The best score at another place than (row, column), -1 where there is none.

    Another place is a local maximum beyond ``lobe`` cells, or any cell beyond ``near`` (non-maximum suppression).
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
def _sample_window(view: Any, u: float, v: float, out: Any) -> None:
    """Write the window at a place between pixels to ``out``, by bilinear interpolation; the border repeats."""
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
def _compute_step(
    cut: Any, seen: Any, mean: float, uu: float, uv: float, vv: float, determinant: float
) -> tuple[float, float, float]:
    """Gauss-Newton step (u, v), and product with the patch, of what is seen; all less their means."""
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
