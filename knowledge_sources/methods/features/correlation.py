"""Template correlation (§1.2, §5): locate in one image a patch that was cut from another.

Normalised cross-correlation finds the place to a pixel and measures how good and how unique it is. A least-squares
alignment with free gain and brightness (Lucas-Kanade) refines it to a few hundredths of a pixel and gives its
covariance, which is large along edges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Floats32
from knowledge_sources.methods.features.correlation_peak import find_peak, find_second_peak
from knowledge_sources.methods.features.patch_kernels import compute_corner_strengths, resample_patch
from knowledge_sources.methods.features.picture import estimate_noise_sigma, require_grey
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.features import FeaturesSettings

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
    image: Any, centre_px: Any, half_px: int, settings: FeaturesSettings = DEFAULT.features
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
    return Template(window, centre - (left, top), int(half_px), estimate_noise_sigma(window, settings))


def lies_inside(shape: tuple[int, ...], centre_px: Any, half_px: float) -> bool:
    """Whether a patch of that half-width round a centre (u, v) lies inside an image of that shape (h, w)."""
    u, v = map(float, centre_px)
    return bool(half_px <= u <= shape[1] - 1 - half_px and half_px <= v <= shape[0] - 1 - half_px)


def correlate(
    template: Template, image: Any, predicted_px: Any, search_px: float, *, scale: float = 1.0,
    settings: FeaturesSettings = DEFAULT.features,
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
        settings.alignment_steps, settings.gradient_leak, settings.position_floor_px, settings.peak_lobe_px,
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
    image: Any, centre_px: Any, half_px: int, search_px: float, settings: FeaturesSettings = DEFAULT.features
) -> float:
    """Correlation, -1 to 1, of the patch round a centre (u, v), to the next pixel, with the best other place near it.

    The quick form of :func:`self_correlate` for choosing landmarks.

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
    return float(find_second_peak(score, row, column, settings.peak_lobe_px, half_px // 2))


def self_correlate(
    image: Any, centre_px: Any, half_px: int, search_px: float, settings: FeaturesSettings = DEFAULT.features
) -> Correlation:
    """Correlate a patch with its own image: `distinctiveness` and `covariance_px` rate it as a landmark.

    Raises:
        ValueError: the patch does not lie in the image.
    """
    template = extract_template(image, centre_px, half_px, settings)
    found = correlate(template, image, np.rint(np.asarray(centre_px, float)), search_px, settings=settings)
    if found is None:
        raise ValueError(f"expected a patch of half-width {half_px} inside the image, got centre {centre_px!r}")
    return found


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
