"""Sub-pixel refinement: a rough segment is moved to where the brightness changes fastest across it.

Across each segment, every 2 px along it, the peak of the gradient is found to a fraction of a pixel; a line is fitted
to the peaks, weighted by the squared gradient (a peak's variance falls with it) and Tukey's function of the residual.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.lines_sample import sample

SMOOTHING_PX = 0.8
"""Standard deviation of the smoothing before differentiation [px]."""

_SPACING_PX = 2.0
_EDGE_BLUR_PX = 1.1
"""Standard deviation of a sharp edge's gradient profile after pixel area, smoothing and differencing [px]."""

_FLOOR_PX = 0.03
"""What sampling and rounding leave in a single peak [px]."""

_BENDS = (0.44, 0.57, 0.65, 0.72, 0.76)
"""Bend of the logarithm of the gradient's peak behind a lens of blur 1.0, 0.7, 0.5, 0.3 and 0 px."""

_SHIFT_PER_SKEW = (0.205, 0.26, 0.335, 0.51, 0.63)
"""Displacement of that peak over the third moment of bilinear reading, for each."""

_CORRELATION = 2.0
"""Neighbouring peaks share smoothed noise: variance of a mean over that of independent peaks."""

_END_SHARE = 0.35
"""A sample is past the end of its edge if its gradient is below this share of the strongest within two samples."""

_PRIOR_PEAKS = 4.0
"""How many peaks the predicted scatter counts for beside the measured one."""


@dataclass(frozen=True, slots=True)
class Refined:
    """Refined segments, ends ordered as they came.

    Attributes:
        segments_px: (n, 2, 2), cut to where the edge is.
        sigma_offset_px: (n,) of the middle, across the segment.
        sigma_angle_rad: (n,) of the direction.
        contrast: (n,) brightness step [grey levels], positive where the right-hand side (v down) is brighter.
        support: (n,) share of the segment's samples that lie on the line.
    """

    segments_px: NDArray[np.float64]
    sigma_offset_px: NDArray[np.float64]
    sigma_angle_rad: NDArray[np.float64]
    contrast: NDArray[np.float64]
    support: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Rulers:
    """Sample places along all segments, one after another: `start` is the first of each, `owner` whose each is."""

    origin: NDArray[np.float64]
    along: NDArray[np.float64]
    across: NDArray[np.float64]
    half: NDArray[np.float64]
    t: NDArray[np.float64]
    owner: NDArray[np.intp]
    start: NDArray[np.intp]

    def total(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.add.reduceat(values, self.start, axis=0))


def refine(
    image: NDArray[np.float32],
    segments_px: NDArray[np.float64],
    sign: NDArray[np.float64],
    noise: float,
    reaches_px: tuple[int, ...],
) -> Refined:
    """Refine rough segments of an image.

    Args:
        segments_px: (n, 2, 2), of non-zero length.
        sign: (n,) 1 where the right-hand side is the brighter one, else -1.
        noise: standard deviation of the pixel noise [grey levels].
        reaches_px: how far across to look, in as many passes.
    """
    if not len(segments_px):
        empty = np.zeros(0)
        return Refined(np.zeros((0, 2, 2)), empty, empty, empty, empty)
    smooth = np.asarray(cv2.GaussianBlur(image, (0, 0), SMOOTHING_PX), np.float32)
    rulers = _rulers(segments_px)
    for reach in reaches_px[:-1]:
        rulers = _rulers(_moved(rulers, _fit(rulers, *_peaks(smooth, rulers, sign, reach), noise), cut=False))
    fit = _fit(rulers, *_peaks(smooth, rulers, sign, reaches_px[-1]), noise)
    return Refined(
        _moved(rulers, fit, cut=True),
        np.sqrt(fit.variance_offset),
        np.sqrt(fit.variance_slope),
        sign * fit.gradient * math.sqrt(2.0 * math.pi) * _EDGE_BLUR_PX,
        fit.support,
    )


def _rulers(segments: NDArray[np.float64]) -> _Rulers:
    delta = segments[:, 1] - segments[:, 0]
    length = np.linalg.norm(delta, axis=1)
    along = delta / length[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    counts = np.maximum(np.rint(length / _SPACING_PX).astype(np.intp), 5)
    start = np.concatenate([[0], np.cumsum(counts)[:-1]])
    owner = np.repeat(np.arange(len(segments)), counts)
    place = (np.arange(len(owner)) - start[owner] + 0.5) / counts[owner] - 0.5
    return _Rulers(segments.mean(axis=1), along, across, length / 2.0, place * length[owner], owner, start)


def _gradient(
    smooth: NDArray[np.float32], rulers: _Rulers, reach: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gradient across (samples, 2 reach + 1) [1/px] at offsets -reach .. reach px, and the samples' places."""
    offsets = np.arange(-reach - 1, reach + 2, dtype=float)
    on_line = rulers.origin[rulers.owner] + rulers.t[:, None] * rulers.along[rulers.owner]
    normal = rulers.across[rulers.owner]
    x = on_line[:, :1] + normal[:, :1] * offsets
    y = on_line[:, 1:] + normal[:, 1:] * offsets
    profile = sample(smooth, x, y).astype(np.float64)
    return (profile[:, 2:] - profile[:, :-2]) / 2.0, on_line


def _peaks(
    smooth: NDArray[np.float32], rulers: _Rulers, sign: NDArray[np.float64], reach: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Offset [px] and height of each sample's gradient peak; height 0 where there is none inside the reach."""
    gradient, on_line = _gradient(smooth, rulers, reach)
    gradient *= sign[rulers.owner, None]
    rows = np.arange(len(gradient))
    best = np.clip(np.argmax(gradient, axis=1), 1, 2 * reach - 1)
    left, mid, right = gradient[rows, best - 1], gradient[rows, best], gradient[rows, best + 1]
    inside = (mid > 0) & (mid >= left) & (mid >= right) & (left > 0) & (right > 0)
    # A blurred step has a Gaussian gradient: its logarithm is the parabola.
    a, b, c = (np.log(np.where(inside, v, 1.0)) for v in (left, mid, right))
    bend = np.maximum(2.0 * b - a - c, 1e-9)
    shift = np.clip(0.5 * (c - a) / bend, -0.5, 0.5) - _phase_bias(on_line, rulers, best - reach, bend)
    return best - reach + shift, np.where(inside, mid, 0.0)


def _phase_bias(
    on_line: NDArray[np.float64], rulers: _Rulers, offset: NDArray[np.intp], bend: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How far bilinear reading moves a peak [px].

    At a fraction f of a pixel it weighs the neighbours by 1 - f and f: unbiased in the mean, but skewed, with third
    moment f (1 - f) (1 - 2 f). On a vertical edge all samples share f and nothing averages out. How far that skew moves
    the top of the parabola was computed for a step behind lenses of several blurs; the parabola's bend tells which.
    """
    normal = rulers.across[rulers.owner]
    f = (on_line + offset[:, None] * normal) % 1.0
    skew = np.sum(normal**3 * (f * (1.0 - f) * (1.0 - 2.0 * f)), axis=1)
    return np.asarray(skew * np.interp(bend, _BENDS, _SHIFT_PER_SKEW))


@dataclass(frozen=True, slots=True)
class _Fit:
    offset: NDArray[np.float64]
    slope: NDArray[np.float64]
    variance_offset: NDArray[np.float64]
    variance_slope: NDArray[np.float64]
    gradient: NDArray[np.float64]
    support: NDArray[np.float64]
    inlier: NDArray[np.bool_]


def _fit(rulers: _Rulers, peak: NDArray[np.float64], height: NDArray[np.float64], noise: float) -> _Fit:
    """Lines offset + slope * t through the peaks of each segment, by reweighted least squares."""
    owner, t = rulers.owner, rulers.t
    weight = height**2
    scale = np.full(len(rulers.start), 0.5)
    for _ in range(3):
        offset, slope, _ = _weighted_line(rulers, peak, weight)
        residual = peak - offset[owner] - slope[owner] * t
        u = residual / (4.0 * np.maximum(scale, 0.05)[owner])
        tukey = np.where(np.abs(u) < 1.0, (1.0 - u**2) ** 2, 0.0)
        weight = height**2 * tukey
        mass = rulers.total(weight)
        scale = np.sqrt(rulers.total(weight * residual**2) / np.where(mass > 0, mass, 1.0))
    offset, slope, moments = _weighted_line(rulers, peak, weight)
    residual = peak - offset[owner] - slope[owner] * t
    mass, middle, spread = moments
    gradient = rulers.total(weight * height) / np.where(mass > 0, mass, 1.0)
    inlier = (tukey > 0.1) & (height > _END_SHARE * _strongest_near(height, owner))
    count = rulers.total(inlier.astype(float))
    variance = _peak_variance(rulers, weight, residual, mass, count, gradient, noise)
    effective = mass**2 / np.maximum(rulers.total(weight**2), 1e-12)
    per_mean = _CORRELATION * variance / np.maximum(effective, 1.0)
    variance_slope = per_mean / np.maximum(spread, 1e-6)
    variance_offset = per_mean + middle**2 * variance_slope
    samples = np.diff(np.append(rulers.start, len(owner)))
    return _Fit(offset, slope, variance_offset, variance_slope, gradient, count / samples, inlier)


def _strongest_near(height: NDArray[np.float64], owner: NDArray[np.intp]) -> NDArray[np.float64]:
    """The greatest height among the two samples on either side, of the same segment, and the sample itself."""
    strongest = height.copy()
    for k in (1, 2):
        same = owner[k:] == owner[:-k]
        strongest[k:] = np.maximum(strongest[k:], np.where(same, height[:-k], 0.0))
        strongest[:-k] = np.maximum(strongest[:-k], np.where(same, height[k:], 0.0))
    return strongest


def _peak_variance(
    rulers: _Rulers,
    weight: NDArray[np.float64],
    residual: NDArray[np.float64],
    mass: NDArray[np.float64],
    count: NDArray[np.float64],
    gradient: NDArray[np.float64],
    noise: float,
) -> NDArray[np.float64]:
    """Variance of one peak [px^2]: what the noise predicts, corrected by the scatter that is seen.

    White noise of deviation s, smoothed by sigma, has a second derivative of variance 3 s^2 / (16 pi sigma^6); a peak
    of height g and width b has curvature g / b^2; the quotient is the peak's displacement.
    """
    predicted = noise * math.sqrt(3.0 / (16.0 * math.pi)) / SMOOTHING_PX**3 * _EDGE_BLUR_PX**2
    prior = (predicted / np.maximum(gradient, 1e-6)) ** 2 + _FLOOR_PX**2
    seen = rulers.total(weight * residual**2) / np.where(mass > 0, mass, 1.0)
    freedom = np.maximum(count - 2.0, 0.0)
    return (_PRIOR_PEAKS * prior + freedom * seen * count / np.maximum(freedom, 1.0)) / (_PRIOR_PEAKS + freedom)


def _weighted_line(
    rulers: _Rulers, peak: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[NDArray[np.float64], ...]]:
    """Offset at t = 0 and slope, with the weights' sum, mean place and variance of place along the line."""
    t = rulers.t
    terms = np.stack([np.ones_like(t), t, t * t, peak, t * peak], axis=1)
    mass, t1, t2, p1, tp = rulers.total(weight[:, None] * terms).T
    safe = np.where(mass > 0, mass, 1.0)
    middle, level = t1 / safe, p1 / safe
    spread = np.maximum(t2 / safe - middle**2, 0.0)
    slope = np.where(spread > 0.25, (tp / safe - middle * level) / np.maximum(spread, 0.25), 0.0)
    return level - slope * middle, slope, (mass, middle, spread)


def _moved(rulers: _Rulers, fit: _Fit, cut: bool) -> NDArray[np.float64]:
    """The segments on their fitted lines, cut at the outermost samples that lie on the line if so asked."""
    low, high = -rulers.half, rulers.half
    if cut:
        spacing = 2.0 * rulers.half / np.diff(np.append(rulers.start, len(rulers.t)))
        first = np.minimum.reduceat(np.where(fit.inlier, rulers.t, np.inf), rulers.start) - spacing / 2.0
        last = np.maximum.reduceat(np.where(fit.inlier, rulers.t, -np.inf), rulers.start) + spacing / 2.0
        some = np.isfinite(first) & np.isfinite(last)
        low, high = np.where(some, first, low), np.where(some, last, high)
    t = np.stack([low, high], axis=1)
    v = fit.offset[:, None] + fit.slope[:, None] * t
    return rulers.origin[:, None] + t[..., None] * rulers.along[:, None] + v[..., None] * rulers.across[:, None]
