"""Template correlation (§1.2, §5): locate in one image a patch that was cut from another.

Normalised cross-correlation finds the place to a pixel and measures how good and how unique it is. A least-squares
alignment with free gain and brightness (Lucas-Kanade) refines it to a few hundredths of a pixel and gives its
covariance, which is large along edges. The compiled kernels come last: patches, then windows of scores.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Floats32
from knowledge_sources.methods.features.picture import estimate_noise_sigma, require_grey
from world_models.compiled import compiled

ALIGNMENT_STEPS = 2  # gauss-Newton steps of the sub-pixel alignment
# share of an edge's gradient energy that seems to lie along it (measured on rendered edges (tests/laws/features))
GRADIENT_LEAK = 3e-4
# px; error of an aligned position that remains without noise (measured on rendered edges (tests/laws/features))
POSITION_FLOOR_PX = 0.02
PEAK_LOBE_PX = 2  # px; distance from the best place up to which a local maximum is the same peak

_MARGIN_PX = 4
"""Kept round a patch beyond twice its half-width, for the cubic interpolation of a patch shrunk to half."""


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """A square patch of an image, with its surroundings.

    Attributes:
        pixels: (p, p) the patch with a margin.
        centre: (2,) (u, v) of the template's centre in `pixels`, not whole in general [px].
        half_px: the patch reaches from -half_px to +half_px round its centre, at the scale at which it was seen.
        noise: standard deviation of the pixel noise of its image [grey levels].
    """

    pixels: Floats32
    centre: Floats
    half_px: int
    noise: float

    def resample(self, scale: float = 1.0, border: int = 0) -> Floats32:
        """The patch (2 half + 1 + 2 border) squared, enlarged by `scale`, its middle cell exactly at the centre."""
        u, v = self.centre.tolist()
        patch: Floats32 = resample_patch(self.pixels, u, v, self.half_px, border, float(scale))
        return patch


@dataclass(frozen=True, slots=True, eq=False)
class Correlation:
    """Where a template was found.

    Attributes:
        position_px: (2,) the template's centre (u, v) [px].
        covariance_px: (2, 2) of the position [px^2]; large along an edge.
        peak: normalised correlation at the best place, between pixels, -1 to 1.
        second_peak: the best at another place in the window, -1 where there is none.
        at_border: the best place lies at the window's border, so the true place may be outside.
        moved_px: (2,) position minus prediction [px].
    """

    position_px: Floats
    covariance_px: Floats
    peak: float
    second_peak: float
    at_border: bool
    moved_px: Floats

    @property
    def sigma_px(self) -> float:
        """Root of the covariance's mean diagonal [px]."""
        (uu, _), (_, vv) = self.covariance_px.tolist()
        return math.sqrt((uu + vv) / 2.0)

    @property
    def distinctiveness(self) -> float:
        """Margin of the best place over the second best, 0 (ambiguous) to 2."""
        return self.peak - self.second_peak


def extract_template(
    image: Any, centre_px: Any, half_px: int
) -> Template:
    """Cut a template from an image (h, w) round a centre (u, v) [px], which need not be whole.

    Raises:
        ValueError: the patch (2 half_px + 1 squared) does not lie in the image, or half_px < 2.
    """
    pixels = require_grey(image)
    centre = np.asarray(centre_px, float).reshape(-1)
    height, width = pixels.shape
    if half_px < 2 or centre.shape != (2,):
        raise ValueError(f"expected a centre (u, v) and half_px >= 2, got {centre_px!r} and {half_px}")
    if not lies_inside(pixels.shape, centre, half_px):
        raise ValueError(f"expected a patch of half-width {half_px} inside {width} x {height} px, got centre {centre}")
    reach = 2 * half_px + _MARGIN_PX
    u, v = (math.floor(c) for c in centre)
    left, top = max(u - reach, 0), max(v - reach, 0)
    window = np.array(pixels[top : v + reach + 2, left : u + reach + 2], np.float32, order="C")
    return Template(window, centre - (left, top), int(half_px), estimate_noise_sigma(window))


def lies_inside(shape: tuple[int, ...], centre_px: Any, half_px: float) -> bool:
    """Whether a patch of that half-width round a centre (u, v) lies inside an image of that shape (h, w)."""
    u, v = map(float, centre_px)
    return bool(half_px <= u <= shape[1] - 1 - half_px and half_px <= v <= shape[0] - 1 - half_px)


def correlate(
    template: Template, image: Any, predicted_px: Any, search_px: float, *, scale: float = 1.0,
) -> Correlation | None:
    """Find a template in an image (h, w) near a prediction (u, v) [px].

    Args:
        search_px: half-width of the window round the prediction [px].
        scale: expected size of the patch over its size in the template (old depth / new depth).

    Returns:
        None where no place of the window holds the whole template inside the image.

    Raises:
        ValueError: scale outside 0.5 to 4, or search_px not positive.
    """
    if not 0.5 <= scale <= 4.0:
        raise ValueError(f"expected a scale from 0.5 to 4, got {scale}")
    if not search_px > 0:
        raise ValueError(f"expected a positive search_px, got {search_px}")
    pixels = np.asarray(image)
    if pixels.ndim != 2:
        raise ValueError(f"expected a grey image of shape (h, w), got shape {pixels.shape}")
    predicted = np.asarray(predicted_px, float)
    bounds = _compute_bounds(pixels.shape, predicted, search_px, template.half_px)
    if bounds is None:
        return None
    u0, u1, v0, v1 = bounds
    half = template.half_px
    patch = template.resample(scale, border=1)
    view = np.ascontiguousarray(pixels[v0 - half : v1 + half + 1, u0 - half : u1 + half + 1], np.float32)
    score = _compute_scores(np.ascontiguousarray(patch[1:-1, 1:-1]), view)
    u, v, uu, uv, vv, peak, second, at_border = find_peak(
        patch, view, score, template.noise, float(search_px),
        ALIGNMENT_STEPS, GRADIENT_LEAK, POSITION_FLOOR_PX, PEAK_LOBE_PX,
    )
    position = np.array([u + u0, v + v0])
    covariance = np.array([[uu, uv], [uv, vv]])
    return Correlation(position, covariance, peak, second, bool(at_border), position - predicted)


def measure_corner_strengths(image: Any, centres_px: Any, half_px: int) -> Floats:
    """Shi-Tomasi corner strength (n,) of the patches round centres (n, 2), to the next pixel [grey levels/px].

    It is the root of the smaller eigenvalue of the mean structure tensor: 0 on a wall or along an edge.

    Raises:
        ValueError: a patch does not lie in the image.
    """
    pixels = require_grey(image)
    centres = np.rint(np.asarray(centres_px, float).reshape(-1, 2)).astype(np.int64)
    last = np.array(pixels.shape[::-1]) - 1 - half_px
    if np.any((centres < half_px) | (centres > last)):
        raise ValueError(f"expected patches of half-width {half_px} inside the image, got centres {centres_px!r}")
    strengths: Floats = compute_corner_strengths(pixels, centres, half_px)
    return strengths


def compute_second_peak(
    image: Any, centre_px: Any, half_px: int, search_px: float
) -> float:
    """Correlation, -1 to 1, of the patch round a centre (u, v), to the next pixel, with the best other place near it.

    Raises:
        ValueError: the patch does not lie in the image.
    """
    pixels, centre = require_grey(image), np.rint(np.asarray(centre_px, float))
    bounds = _compute_bounds(pixels.shape, centre, search_px, half_px)
    if bounds is None or not lies_inside(pixels.shape, centre, half_px):
        raise ValueError(f"expected a patch of half-width {half_px} inside the image, got centre {centre_px!r}")
    u0, u1, v0, v1 = bounds
    view = np.ascontiguousarray(pixels[v0 - half_px : v1 + half_px + 1, u0 - half_px : u1 + half_px + 1], np.float32)
    row, column = int(centre[1]) - v0, int(centre[0]) - u0
    size = 2 * half_px + 1
    score = _compute_scores(np.ascontiguousarray(view[row : row + size, column : column + size]), view)
    return float(find_second_peak(score, row, column, PEAK_LOBE_PX, half_px // 2))


def _compute_bounds(
    shape: tuple[int, ...], predicted: Floats, search: float, half: int
) -> tuple[int, int, int, int] | None:
    """First and last column and row of the centres searched, all of whose patches lie in the image."""
    if predicted.shape != (2,) or not all(map(math.isfinite, predicted.tolist())):
        raise ValueError(f"expected a finite prediction (u, v), got {predicted}")
    u, v = predicted.tolist()
    u0, u1 = max(math.floor(u - search), half), min(math.ceil(u + search), shape[1] - 1 - half)
    v0, v1 = max(math.floor(v - search), half), min(math.ceil(v + search), shape[0] - 1 - half)
    return (u0, u1, v0, v1) if u0 <= u1 and v0 <= v1 else None


def _compute_scores(patch: Floats32, view: Floats32) -> Floats32:
    """Normalised correlation of a patch at every place of a window; -1 where there is no contrast."""
    score = np.asarray(cv2.matchTemplate(view, patch, cv2.TM_CCOEFF_NORMED), np.float32)
    score[~np.isfinite(score)] = -1.0
    return score


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
        uu, uv, vv = _compute_tensor_at(image, pixels[i, 0], pixels[i, 1], half)
        smaller = 0.5 * (uu + vv) - math.hypot(0.5 * (uu - vv), uv)
        out[i] = math.sqrt(max(smaller, 0.0)) / (2 * half + 1)
    return out


@compiled
def _compute_tensor_at(image: Any, u: int, v: int, half: int) -> tuple[float, float, float]:
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
