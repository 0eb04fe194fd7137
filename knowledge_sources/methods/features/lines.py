"""Straight edges of an image, to a small part of a pixel, each with its standard deviations (§1.2, §6.1).

Without a prediction the whole image is searched, region by region of like gradients (Burns); with one, only bands round
the predicted lines: perception as a blind man uses his cane (Figure 1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.images import estimate_noise_sigma, to_grey_float
from knowledge_sources.methods.features.line_bands import find_in_bands
from knowledge_sources.methods.features.line_refinement import NOISE_GAIN, Refined, refine, smoothed
from knowledge_sources.methods.features.line_regions import line_regions

LEAST_GRADIENT = 4.0
"""Pixels of a lesser gradient are no edge when the whole image is searched [grey levels per px]."""
_SIGNIFICANT = 4.0
"""Nor are those that do not stand so many standard deviations of the noise above zero."""

SIGMA_END_PX = 0.7
"""Standard deviation of an end along its segment [px]: samples are 2 px apart. Measured on rendered corners."""
SIGMA_ACROSS_PX = 0.7
"""Standard deviation of an end across its model line [px]: finder, JPEG, and what the model does not know."""

_LEAST_SUPPORT = 0.5
"""Share of a segment's length that must lie on its refined line."""


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

    segments_px: NDArray[np.float64]
    sigma_offset_px: NDArray[np.float64]
    sigma_angle_rad: NDArray[np.float64]
    contrast: NDArray[np.float64]
    predicted: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.segments_px)

    @property
    def lengths_px(self) -> NDArray[np.float64]:
        """(n,) lengths [px]."""
        return np.asarray(np.linalg.norm(self.segments_px[:, 1] - self.segments_px[:, 0], axis=1))

    @property
    def sigma_ends_px(self) -> NDArray[np.float64]:
        """(n, 2) standard deviation of an end along its segment and across it [px], the same for both ends."""
        across = np.hypot(self.sigma_offset_px, 0.5 * self.lengths_px * self.sigma_angle_rad)
        return np.stack([np.full(len(self), SIGMA_END_PX), across], axis=1)

    def take(self, index: Any) -> LineSegments:
        """Those that an index array or a mask chooses."""
        return LineSegments(
            self.segments_px[index],
            self.sigma_offset_px[index],
            self.sigma_angle_rad[index],
            self.contrast[index],
            self.predicted[index],
        )


def remove_duplicates(found: LineSegments, within_px: float = 0.7) -> LineSegments:
    """The same segments without repeats, longest first: an edge that lies in two predictions' bands is found twice.

    A segment is a repeat of a longer one if both its ends lie on it, within `within_px` across and 3 px along, and its
    brighter side is the same.
    """
    order = np.argsort(-found.lengths_px, kind="stable")
    sorted_ = found.take(order)
    start, delta = sorted_.segments_px[:, 0], sorted_.segments_px[:, 1] - sorted_.segments_px[:, 0]
    length = sorted_.lengths_px
    along = delta / length[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    on = np.ones((len(found), len(found)), bool)  # [i, j]: segment j lies on segment i
    for end in (0, 1):
        places = sorted_.segments_px[:, end].T
        t, o = (axis @ places - np.sum(axis * start, axis=1)[:, None] for axis in (along, across))
        on &= (np.abs(o) <= within_px) & (t >= -3.0) & (t <= length[:, None] + 3.0)
    bright_right = along * np.sign(sorted_.contrast)[:, None]
    on &= bright_right @ bright_right.T > 0.0
    return sorted_.take(~np.any(np.triu(on, 1), axis=0))


def find_lines(
    image: Any,
    predicted_px: Any = None,
    *,
    band_px: float = 12.0,
    min_length_px: float = 8.0,
    min_contrast: float = 2.0,
    max_turn_rad: float = 0.3,
    systematic_px: float = 0.03,
) -> LineSegments:
    """Straight edges of an image.

    Args:
        image: (h, w) grey levels, uint8 or float on the same scale of 0 to 255.
        predicted_px: None, or (m, 2, 2) lines expected [px]; NaN rows (not visible) find nothing.
        band_px: half-width of the band searched round a prediction, and how far past its ends [px].
        min_length_px: shorter segments are dropped [px].
        min_contrast: fainter segments are dropped [grey levels].
        max_turn_rad: segments turned further from their prediction are dropped [rad].
        systematic_px: added in quadrature to the deviations: what no length of edge averages out, such as a lens that
            is not quite known, or a renderer that places a vertical edge to a sixteenth of a pixel.

    Raises:
        ValueError: the image is not (h, w), the predictions are not (m, 2, 2), or a limit is not positive.

    Source: §1.2 [21, 6], §6.1.4.
    """
    pixels = to_grey_float(image)
    if not (band_px > 0 and min_length_px > 0):
        raise ValueError(f"expected positive band_px and min_length_px, got {band_px} and {min_length_px}")
    noise, smooth = estimate_noise_sigma(pixels), smoothed(pixels)
    if predicted_px is None:
        least = max(LEAST_GRADIENT, _SIGNIFICANT * NOISE_GAIN * noise)
        rough = line_regions(smooth, least, min_length_px)
        fit = refine(smooth, rough, np.ones(len(rough)), noise, (2, 2))
        return _checked(fit, np.full(len(rough), -1, np.intp), min_length_px, min_contrast, systematic_px)
    near = find_in_bands(pixels, _predictions(predicted_px), noise, band_px, min_length_px, max_turn_rad)
    fit = refine(smooth, near.segments_px, near.sign, noise, (2,))
    return _checked(fit, near.predicted, min_length_px, min_contrast, systematic_px)


def _predictions(predicted_px: Any) -> NDArray[np.float64]:
    predicted = np.asarray(predicted_px, float)
    if predicted.size == 0:
        return np.zeros((0, 2, 2))
    if predicted.ndim != 3 or predicted.shape[1:] != (2, 2):
        raise ValueError(f"expected predicted lines of shape (m, 2, 2), got {predicted.shape}")
    return predicted


def _checked(
    fit: Refined, owner: NDArray[np.intp], min_length: float, min_contrast: float, systematic: float
) -> LineSegments:
    length = np.linalg.norm(fit.segments_px[:, 1] - fit.segments_px[:, 0], axis=1)
    keep = (length >= min_length) & (np.abs(fit.contrast) >= min_contrast) & (fit.support >= _LEAST_SUPPORT)
    offset = np.hypot(fit.sigma_offset_px, systematic)
    # A displacement spread evenly along a segment of length L has, as a slope, deviation sqrt(12) / L.
    angle = np.hypot(fit.sigma_angle_rad, 12.0**0.5 * systematic / np.maximum(length, 1.0))
    return LineSegments(fit.segments_px, offset, angle, fit.contrast, owner).take(keep)
