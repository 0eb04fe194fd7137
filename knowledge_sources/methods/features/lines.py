"""Straight edges of an image, to a small part of a pixel, each with its standard deviations (§1.2, §6.1).

Without a prediction the whole image is searched for line-support regions (Burns); with one, only bands round the
predicted lines (Figure 1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from knowledge_sources.methods.arrays import Floats, Indices
from knowledge_sources.methods.features.line_bands import find_in_bands
from knowledge_sources.methods.features.line_refinement import (
    RefinedSegments,
    compute_noise_gain,
    refine_segments,
    smooth_image,
)
from knowledge_sources.methods.features.line_regions import find_line_regions
from knowledge_sources.methods.features.picture import estimate_noise_sigma, to_grey_float
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.features import FeaturesSettings


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

    def compute_end_sigmas(self, settings: FeaturesSettings = DEFAULT.features) -> Floats:
        """(n, 2) standard deviation of an end along its segment and across it [px], the same for both ends."""
        across = np.hypot(self.sigma_offset_px, 0.5 * self.lengths_px * self.sigma_angle_rad)
        return np.stack([np.full(len(self), settings.sigma_along_px), across], axis=1)

    def take(self, index: Any) -> LineSegments:
        """Those that an index array or a mask chooses."""
        return LineSegments(
            self.segments_px[index],
            self.sigma_offset_px[index],
            self.sigma_angle_rad[index],
            self.contrast[index],
            self.predicted[index],
        )


def remove_duplicates(found: LineSegments, settings: FeaturesSettings = DEFAULT.features) -> LineSegments:
    """Drop segments that repeat a longer one; the others, longest first (non-maximum suppression).

    An edge that lies in the bands of two predictions is found twice. A segment is a repeat if both its ends lie on the
    longer one, within ``max_duplicate_offset_px`` across and ``max_duplicate_overhang_px`` along, and its brighter side
    is the same.
    """
    ordered = found.take(np.argsort(-found.lengths_px, kind="stable"))
    start, delta = ordered.segments_px[:, 0], ordered.segments_px[:, 1] - ordered.segments_px[:, 0]
    length, overhang = ordered.lengths_px, settings.max_duplicate_overhang_px
    along = delta / length[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    on = np.ones((len(found), len(found)), bool)  # [i, j]: segment j lies on segment i
    for end in (0, 1):
        places = ordered.segments_px[:, end].T
        t, o = (axis @ places - np.sum(axis * start, axis=1)[:, None] for axis in (along, across))
        on &= (np.abs(o) <= settings.max_duplicate_offset_px) & (t >= -overhang) & (t <= length[:, None] + overhang)
    bright_right = along * np.sign(ordered.contrast)[:, None]
    on &= bright_right @ bright_right.T > 0.0
    return ordered.take(~np.any(np.triu(on, 1), axis=0))


def find_lines(
    image: Any,
    predicted_px: Any = None,
    *,
    band_px: float | None = None,
    min_length_px: float | None = None,
    settings: FeaturesSettings = DEFAULT.features,
) -> LineSegments:
    """Find the straight edges of an image, everywhere or near predicted lines only.

    Args:
        image: (h, w) grey levels, uint8 or float on the same scale of 0 to 255.
        predicted_px: None, or (m, 2, 2) lines expected [px]; NaN rows (not visible) find nothing.
        band_px: half-width of the band round a prediction, also beyond its ends [px]; by default ``settings.band_px``.
        min_length_px: least length of a segment [px]; by default ``settings.min_line_length_px``.

    Raises:
        ValueError: the image is not (h, w), the predictions are not (m, 2, 2), or a limit is not positive.

    Source: §1.2 [21, 6], §6.1.4.
    """
    pixels = to_grey_float(image)
    band_px = settings.band_px if band_px is None else band_px
    min_length_px = settings.min_line_length_px if min_length_px is None else min_length_px
    if not (band_px > 0 and min_length_px > 0):
        raise ValueError(f"expected positive band_px and min_length_px, got {band_px} and {min_length_px}")
    noise, smooth = estimate_noise_sigma(pixels, settings), smooth_image(pixels, settings)
    if predicted_px is None:
        min_gradient = max(
            settings.min_gradient_per_px, settings.min_gradient_sigmas * compute_noise_gain(settings) * noise)
        rough = find_line_regions(smooth, min_gradient, min_length_px, settings)
        fit = refine_segments(smooth, rough, np.ones(len(rough)), noise, 2, settings)
        return _select(fit, np.full(len(rough), -1, np.intp), min_length_px, settings)
    near = find_in_bands(pixels, _require_segments(predicted_px), noise, band_px, min_length_px, settings)
    fit = refine_segments(smooth, near.segments_px, near.sign, noise, 1, settings)
    return _select(fit, near.predicted, min_length_px, settings)


def _require_segments(predicted_px: Any) -> Floats:
    """Predictions as (m, 2, 2). Raises ValueError for another shape."""
    predicted = np.asarray(predicted_px, float)
    if predicted.size == 0:
        return np.zeros((0, 2, 2))
    if predicted.ndim != 3 or predicted.shape[1:] != (2, 2):
        raise ValueError(f"expected predicted lines of shape (m, 2, 2), got {predicted.shape}")
    return predicted


def _select(
    fit: RefinedSegments, predicted: Indices, min_length: float, settings: FeaturesSettings
) -> LineSegments:
    """The segments long, strong and straight enough, with the systematic error in their deviations."""
    length = np.linalg.norm(fit.segments_px[:, 1] - fit.segments_px[:, 0], axis=1)
    keep = (length >= min_length) & (np.abs(fit.contrast) >= settings.min_line_contrast)
    keep &= fit.support >= settings.min_line_support
    systematic = settings.line_systematic_px
    offset = np.hypot(fit.sigma_offset_px, systematic)
    # A displacement spread evenly along a segment of length L has, as a slope, deviation sqrt(12) / L.
    angle = np.hypot(fit.sigma_angle_rad, 12.0**0.5 * systematic / np.maximum(length, 1.0))
    return LineSegments(fit.segments_px, offset, angle, fit.contrast, predicted).take(keep)
