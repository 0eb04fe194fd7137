"""Straight edges of an image, to a small part of a pixel, each with its standard deviations (§1.2, §6.1).

Without a prediction the whole image is searched for line-support regions (Burns); with one, only bands round the
predicted lines (Figure 1). A rough segment is then moved to where the brightness changes fastest across it: at places
along it the peak of the gradient across is found to a fraction of a pixel, and a line is fitted to the peaks by
reweighted least squares: the squared gradient (a peak's variance falls with it) times Tukey's biweight of the residual.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Floats32, Indices
from knowledge_sources.methods.features.line_candidates import MIN_GRADIENT_SIGMAS, find_in_bands, find_line_regions
from knowledge_sources.methods.features.picture import estimate_noise_sigma, to_grey_float
from world_models.compiled import compiled

LINE_SYSTEMATIC_PX = 0.03
"""Error of a segment's place that does not average out along it, added in quadrature (measured: a lens not quite
known, a renderer that places edges to a sixteenth of a pixel)."""
SIGMA_ACROSS_PX = 0.7
"""Standard deviation of a segment's end across its model line, with the model's own errors (measured on rendered
edges (tests/laws/features))."""
BAND_PX = 12.0  # half-width of the band searched round a predicted line, also beyond its ends (§6.1.4, Figure 1)


# px; standard deviation of the Gaussian smoothing before an edge is located (engineering judgement; the phase-bias
# table below was computed for it)
EDGE_SMOOTHING_PX = 0.8
# px; standard deviation of a sharp edge's gradient profile after smoothing and differencing (measured on rendered
# edges (tests/laws/features))
EDGE_PROFILE_PX = 1.1
MIN_LINE_LENGTH_PX = 8.0  # px; least length of a segment (§6.1.4)
MIN_LINE_CONTRAST = 2.0  # grey levels; least brightness step across a segment
MIN_LINE_SUPPORT = 0.5  # least share of a segment's samples that lie on its refined line
MIN_GRADIENT_PER_PX = 4.0  # grey levels/px; least gradient of an edge pixel when the whole image is searched
SAMPLE_SPACING_PX = 2.0  # px; distance of the places along a segment at which the edge is located
MIN_SAMPLES = 5  # least number of such places on a segment
REFINEMENT_REACH_PX = 2  # px; distance across a rough segment up to which its edge is looked for
# least gradient within the ends of an edge, as a share of the strongest within two samples (measured on rendered
# corners)
MIN_END_GRADIENT_SHARE = 0.35
# px; error of a single gradient peak that remains without noise (measured on rendered edges (tests/laws/features))
PEAK_FLOOR_PX = 0.03
# variance of a mean of neighbouring peaks over that of independent ones (measured on rendered edges
# (tests/laws/features))
PEAK_CORRELATION = 2.0
PRIOR_PEAKS = 4.0  # number of peaks as which the predicted scatter counts against the measured one


@dataclass(frozen=True, slots=True, eq=False)
class LineSegments:
    """Segments found in an image.

    Without predictions ends are ordered so that the brighter side is on the right of end 0 -> end 1 as seen in the
    picture; with predictions they run the way of the prediction, and contrast is negative where the left is brighter.

    Attributes:
        segments_px: (n, 2, 2) ends (u, v) [px].
        sigma_offset_px: (n,) standard deviation of the middle's offset across the segment [px].
        sigma_angle_rad: (n,) standard deviation of the direction [rad].
        contrast: (n,) brightness step from the left to the right side [grey levels].
        predicted: (n,) index of the prediction in whose band a segment was found; -1 without predictions.
    """

    segments_px: Floats
    sigma_offset_px: Floats
    sigma_angle_rad: Floats
    contrast: Floats
    predicted: Indices

    def __len__(self) -> int:
        return len(self.segments_px)

    @property
    def lengths_px(self) -> Floats:
        """(n,) lengths [px]."""
        return np.asarray(np.linalg.norm(self.segments_px[:, 1] - self.segments_px[:, 0], axis=1))

    def take(self, index: Any) -> LineSegments:
        """Those that an index array or a mask chooses."""
        return LineSegments(self.segments_px[index], self.sigma_offset_px[index], self.sigma_angle_rad[index],
                            self.contrast[index], self.predicted[index])


def find_lines(
    image: Any,
    predicted_px: Any = None,
    *,
    band_px: float | None = None,
    min_length_px: float | None = None,
) -> LineSegments:
    """Find the straight edges of an image, everywhere or near predicted lines only.

    Args:
        image: (h, w) grey levels, uint8 or float on the same scale of 0 to 255.
        predicted_px: None, or (m, 2, 2) lines expected [px]; NaN rows (not visible) find nothing.
        band_px: half-width of the band round a prediction, also beyond its ends [px]; by default ``BAND_PX``.
        min_length_px: least length of a segment [px]; by default ``MIN_LINE_LENGTH_PX``.

    Raises:
        ValueError: the image is not (h, w), the predictions are not (m, 2, 2), or a limit is not positive.

    Source: §1.2 [21, 6], §6.1.4.
    """
    pixels = to_grey_float(image)
    band_px = BAND_PX if band_px is None else band_px
    min_length_px = MIN_LINE_LENGTH_PX if min_length_px is None else min_length_px
    if not (band_px > 0 and min_length_px > 0):
        raise ValueError(f"expected positive band_px and min_length_px, got {band_px} and {min_length_px}")
    noise, smooth = estimate_noise_sigma(pixels), smooth_image(pixels)
    if predicted_px is None:
        min_gradient = max(
            MIN_GRADIENT_PER_PX, MIN_GRADIENT_SIGMAS * compute_noise_gain() * noise)
        rough = find_line_regions(smooth, min_gradient, min_length_px)
        fit = refine_segments(smooth, rough, np.ones(len(rough)), noise, 2)
        return _select(fit, np.full(len(rough), -1, np.intp), min_length_px)
    near = find_in_bands(pixels, _require_segments(predicted_px), noise, band_px, min_length_px)
    fit = refine_segments(smooth, near.segments_px, near.sign, noise, 1)
    return _select(fit, near.predicted, min_length_px)


def _require_segments(predicted_px: Any) -> Floats:
    """Predictions as (m, 2, 2). Raises ValueError for another shape."""
    predicted = np.asarray(predicted_px, float)
    if predicted.size == 0:
        return np.zeros((0, 2, 2))
    if predicted.ndim != 3 or predicted.shape[1:] != (2, 2):
        raise ValueError(f"expected predicted lines of shape (m, 2, 2), got {predicted.shape}")
    return predicted


def _select(
    fit: RefinedSegments, predicted: Indices, min_length: float
) -> LineSegments:
    """The segments long, strong and straight enough, with the systematic error in their deviations."""
    length = np.linalg.norm(fit.segments_px[:, 1] - fit.segments_px[:, 0], axis=1)
    keep = (length >= min_length) & (np.abs(fit.contrast) >= MIN_LINE_CONTRAST)
    keep &= fit.support >= MIN_LINE_SUPPORT
    systematic = LINE_SYSTEMATIC_PX
    offset = np.hypot(fit.sigma_offset_px, systematic)
    # A displacement spread evenly along a segment of length L has, as a slope, deviation sqrt(12) / L.
    angle = np.hypot(fit.sigma_angle_rad, 12.0**0.5 * systematic / np.maximum(length, 1.0))
    return LineSegments(fit.segments_px, offset, angle, fit.contrast, predicted).take(keep)


_BENDS = (0.44, 0.57, 0.65, 0.72, 0.76)
"""Bend of the logarithm of the gradient's peak behind a lens of blur 1.0, 0.7, 0.5, 0.3 and 0 px.

Computed, as the next table, for a smoothing of 0.8 px.
"""

_SHIFT_PER_SKEW = (0.205, 0.26, 0.335, 0.51, 0.63)
"""Displacement of that peak over the third moment of bilinear interpolation, for each."""


class RefinedSegments(NamedTuple):
    """Refined segments; their ends are ordered as they came.

    Attributes:
        segments_px: (n, 2, 2), cut to where the edge is.
        sigma_offset_px: (n,) of the middle, across the segment.
        sigma_angle_rad: (n,) of the direction.
        contrast: (n,) brightness step [grey levels], positive where the right-hand side (v down) is brighter.
        support: (n,) share of the segment's samples that lie on the line.
    """

    segments_px: Floats
    sigma_offset_px: Floats
    sigma_angle_rad: Floats
    contrast: Floats
    support: Floats


def smooth_image(image: Floats32) -> Floats32:
    """Smooth an image (h, w) with the Gaussian before it is differentiated."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), EDGE_SMOOTHING_PX), np.float32)


def compute_noise_gain() -> float:
    """Standard deviation of the smoothed gradient of white noise of deviation one [1/px]."""
    return 1.0 / (math.sqrt(8.0 * math.pi) * EDGE_SMOOTHING_PX**2)


def refine_segments(
    smooth: Floats32, segments_px: Floats, sign: Floats, noise: float, passes: int
) -> RefinedSegments:
    """Refine rough segments of an image to sub-pixel accuracy.

    Args:
        smooth: (h, w), see :func:`smooth_image`.
        segments_px: (n, 2, 2), of non-zero length.
        sign: (n,) 1 where the right-hand side is the brighter one, else -1.
        noise: standard deviation of the pixel noise [grey levels].
        passes: how often each segment is refined.
    """
    profile_px = EDGE_PROFILE_PX
    peak = noise * math.sqrt(3.0 / (16.0 * math.pi)) / EDGE_SMOOTHING_PX**3 * profile_px**2
    segments, sign = np.array(segments_px, float, order="C"), np.array(sign, float)
    ends, facts = _refine_all(smooth, segments, sign, peak, passes, REFINEMENT_REACH_PX)
    contrast = sign * facts[:, 2] * math.sqrt(2.0 * math.pi) * profile_px
    return RefinedSegments(ends, np.sqrt(facts[:, 0]), np.sqrt(facts[:, 1]), contrast, facts[:, 3])


@compiled
def _refine_all(
    smooth: Any, segments: Any, sign: Any, noise_peak: float, passes: int, reach: int
) -> tuple[Any, Any]:
    """Ends (n, 2, 2), and (n, 4) variance of offset and of slope, gradient, support."""
    ends, facts = segments.copy(), np.zeros((len(segments), 4))
    for i in range(len(segments)):
        for turn in range(passes):
            end = ends[i]
            u, v = 0.5 * (end[0, 0] + end[1, 0]), 0.5 * (end[0, 1] + end[1, 1])
            along_u, along_v = end[1, 0] - end[0, 0], end[1, 1] - end[0, 1]
            length = math.hypot(along_u, along_v)
            along_u, along_v = along_u / length, along_v / length
            t, peaks, heights = _find_peaks(smooth, u, v, along_u, along_v, length, sign[i], reach)
            offset, slope, inlier = _fit_peaks(t, peaks, heights, noise_peak, facts[i])
            low, high = -0.5 * length, 0.5 * length
            on = np.flatnonzero(inlier)
            if turn == passes - 1 and len(on):  # cut to the outermost samples that lie on the line
                half = 0.5 * length / len(t)
                low, high = t[on[0]] - half, t[on[-1]] + half
            for e, at in enumerate((low, high)):
                off = offset + slope * at
                end[e, 0], end[e, 1] = u + at * along_u - off * along_v, v + at * along_v + off * along_u
    return ends, facts


@compiled
def _find_peaks(
    smooth: Any, u: float, v: float, along_u: float, along_v: float, length: float, sign: float, reach: int,
) -> tuple[Any, Any, Any]:
    """Places along a segment (n,) [px], the gradient's peak across it at each [px] and its height.

    The height is 0 where there is no peak within the reach.
    """
    count = max(round(length / SAMPLE_SPACING_PX), MIN_SAMPLES)
    t, peaks, heights = np.empty(count), np.zeros(count), np.zeros(count)
    profile, gradient = np.empty(2 * reach + 3), np.empty(2 * reach + 1)
    for k in range(count):
        t[k] = ((k + 0.5) / count - 0.5) * length
        on_u, on_v = u + t[k] * along_u, v + t[k] * along_v
        for j in range(len(profile)):
            profile[j] = _interpolate(smooth, on_u - (j - reach - 1) * along_v, on_v + (j - reach - 1) * along_u)
        best = 0
        for j in range(len(gradient)):
            gradient[j] = 0.5 * sign * (profile[j + 2] - profile[j])
            if gradient[j] > gradient[best]:
                best = j
        best = min(max(best, 1), 2 * reach - 1)
        left, mid, right = gradient[best - 1], gradient[best], gradient[best + 1]
        if left <= 0.0 or right <= 0.0 or mid < left or mid < right:
            continue
        # A blurred step has a Gaussian gradient: its logarithm is the parabola.
        a, b, c = math.log(left), math.log(mid), math.log(right)
        bend = max(2.0 * b - a - c, 1e-9)
        shift = min(max(0.5 * (c - a) / bend, -0.5), 0.5)
        off = best - reach
        bias = _compute_phase_bias(on_u - off * along_v, on_v + off * along_u, -along_v, along_u, bend)
        peaks[k], heights[k] = off + shift - bias, mid
    return t, peaks, heights


@compiled
def _interpolate(image: Any, u: float, v: float) -> float:
    """Bilinear value of an image between its pixels; the border value continues outside."""
    height, width = image.shape
    u, v = min(max(u, 0.0), width - 1.0), min(max(v, 0.0), height - 1.0)
    x, y = min(int(u), width - 2), min(int(v), height - 2)
    right, low = u - x, v - y
    above = image[y, x] + right * (image[y, x + 1] - image[y, x])
    below = image[y + 1, x] + right * (image[y + 1, x + 1] - image[y + 1, x])
    return float(above + low * (below - above))


@compiled
def _compute_phase_bias(u: float, v: float, normal_u: float, normal_v: float, bend: float) -> float:
    """Displacement of a peak by bilinear interpolation [px].

    At a fraction f of a pixel it weighs the neighbours by 1 - f and f: unbiased in the mean, but skewed, with third
    moment f (1 - f) (1 - 2 f). On a vertical edge all samples share f and nothing averages out. The displacement that
    follows was computed for a step behind lenses of several blurs; the parabola's bend says which of them applies.
    """
    f, g = u % 1.0, v % 1.0
    skew = normal_u**3 * f * (1.0 - f) * (1.0 - 2.0 * f) + normal_v**3 * g * (1.0 - g) * (1.0 - 2.0 * g)
    k = 0
    while k < len(_BENDS) - 2 and bend > _BENDS[k + 1]:
        k += 1
    share = min(max((bend - _BENDS[k]) / (_BENDS[k + 1] - _BENDS[k]), 0.0), 1.0)
    return skew * (_SHIFT_PER_SKEW[k] + share * (_SHIFT_PER_SKEW[k + 1] - _SHIFT_PER_SKEW[k]))


@compiled
def _fit_peaks(
    t: Any, peaks: Any, heights: Any, noise_peak: float, facts: Any
) -> tuple[float, float, Any]:
    """Fit the line offset + slope t to the peaks by reweighted least squares (Tukey); which of them lie on it (n,).

    ``facts`` receives the variance of the offset and of the slope, the gradient, and the share of peaks on the line.
    """
    count = len(t)
    weights, tukey, scale = heights**2, np.ones(count), 0.5
    for _ in range(3):
        offset, slope, mass, middle, spread = _fit_weighted_line(t, peaks, weights)
        bound, seen, mass = 4.0 * max(scale, 0.05), 0.0, 0.0
        for k in range(count):
            residual = peaks[k] - offset - slope * t[k]
            tukey[k] = max(1.0 - (residual / bound) ** 2, 0.0) ** 2
            weights[k] = heights[k] ** 2 * tukey[k]
            mass, seen = mass + weights[k], seen + weights[k] * residual**2
        scale = math.sqrt(seen / mass) if mass > 0.0 else 0.0
    offset, slope, mass, middle, spread = _fit_weighted_line(t, peaks, weights)
    safe = mass if mass > 0.0 else 1.0
    gradient = squares = seen = 0.0
    inlier = np.zeros(count, np.bool_)
    for k in range(count):
        gradient, squares = gradient + weights[k] * heights[k] / safe, squares + weights[k] ** 2
        seen += weights[k] * (peaks[k] - offset - slope * t[k]) ** 2 / safe
        strongest = heights[max(k - 2, 0) : k + 3].max()
        inlier[k] = tukey[k] > 0.1 and heights[k] > MIN_END_GRADIENT_SHARE * strongest
    found = float(np.sum(inlier))
    variance = _compute_peak_variance(seen, found, gradient, noise_peak)
    per_mean = PEAK_CORRELATION * variance / max(mass**2 / max(squares, 1e-12), 1.0)
    facts[1] = per_mean / max(spread, 1e-6)
    facts[0] = per_mean + middle**2 * facts[1]
    facts[2], facts[3] = gradient, found / count
    return offset, slope, inlier


@compiled
def _compute_peak_variance(
    seen: float, found: float, gradient: float, noise_peak: float
) -> float:
    """Variance of one peak [px^2]: what the noise predicts, combined with the measured scatter.

    White noise of deviation s, smoothed by sigma, has a second derivative of variance 3 s^2 / (16 pi sigma^6); a peak
    of height g and width b has curvature g / b^2; the quotient, ``noise_peak`` / g, is the peak's displacement.
    """
    prior = (noise_peak / max(gradient, 1e-6)) ** 2 + PEAK_FLOOR_PX**2
    freedom = max(found - 2.0, 0.0)
    scatter = freedom * seen * found / max(freedom, 1.0)
    return (PRIOR_PEAKS * prior + scatter) / (PRIOR_PEAKS + freedom)


@compiled
def _fit_weighted_line(t: Any, peaks: Any, weights: Any) -> tuple[float, float, float, float, float]:
    """Offset at t = 0 and slope, with the weights' sum, mean place and variance of place along the line."""
    mass = t1 = t2 = p1 = tp = 0.0
    for k in range(len(t)):
        w = weights[k]
        mass, t1, t2 = mass + w, t1 + w * t[k], t2 + w * t[k] * t[k]
        p1, tp = p1 + w * peaks[k], tp + w * t[k] * peaks[k]
    safe = mass if mass > 0.0 else 1.0
    middle, level = t1 / safe, p1 / safe
    spread = max(t2 / safe - middle * middle, 0.0)
    slope = (tp / safe - middle * level) / spread if spread > 0.25 else 0.0
    return level - slope * middle, slope, mass, middle, spread
