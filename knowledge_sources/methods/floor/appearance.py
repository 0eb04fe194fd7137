"""What the floor looks like: brightness and colour with covariance, from the model and from pictures.

Light is not modelled: only the hue of the model's colour is relied on, and each picture tells how bright the floor is.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats

MIN_FLOOR_PIXELS = 150  # with fewer pixels of a floor in sight, its looks are not known from a picture
MAX_CHROMA_ERROR = 0.035
"""Largest difference from the model's colour, in its parts of red and blue, of what may be floor."""
MIN_CHROMA_SIGMA = 0.005  # floor of the standard deviation of the floor's colour
MIN_BRIGHTNESS_SIGMA = 0.05  # floor of the standard deviation of the logarithm of the floor's brightness
MAX_UNLIKE = 5.0  # pixels further than so many standard deviations from the floor's looks do not look like it
MAX_SHADE_STEP = 2.5
"""From floor in light to floor in shade, neighbouring pixels differ by at most so many standard deviations of the
floor's looks."""
MAX_SHADE_CHROMA = 0.06  # largest difference of the parts of red and blue between floor in light and in shade

DARK = 6.0
"""Added to the sum of the three channels [0..765]: in the dark, noise is no colour."""
TRIM = 9.0
"""Pixels within this squared Mahalanobis distance go on to the next round of the fit."""
ROUNDS = 4


def compute_appearance(colours: Floats | NDArray[np.float32]) -> Floats:
    """Logarithm of the brightness, and red and blue as parts of it, (..., 3), of colours (..., 3) of 0..255."""
    total = colours[..., 0].astype(float) + colours[..., 1] + colours[..., 2] + DARK
    parts = np.stack([np.log(total), (colours[..., 0] + DARK / 3.0) / total, (colours[..., 2] + DARK / 3.0) / total])
    return np.moveaxis(parts, 0, -1)  # each of the three lies together in memory: they are asked one by one


def default_covariance() -> Floats:
    """(3, 3) of looks, where none is fitted: the least that is ever taken."""
    return np.diag([MIN_BRIGHTNESS_SIGMA**2, MIN_CHROMA_SIGMA**2, MIN_CHROMA_SIGMA**2])


def fit_appearance(
    appearance: Floats, expected: Floats, is_lit: bool, max_chroma_error: float = MAX_CHROMA_ERROR
) -> tuple[Floats, Floats] | None:
    """Mean (3,) and covariance (3, 3) of the looks (n, 3) of a floor in one picture; None where it is not to be seen.

    Most of what may be floor by its hue decides how bright the floor is; it is fitted by trimming, so that things on it
    do not count.

    Args:
        expected: (3,) looks by the model, in the light of the last picture if that is known.
        is_lit: whether the brightness of ``expected`` tells anything.
        max_chroma_error: least difference in hue from ``expected`` of what is no floor.
    """
    alike = _has_hue(appearance, expected, max_chroma_error)
    near = np.ascontiguousarray(appearance.compress(alike, axis=0).T)  # (3, n), faster
    if near.shape[1] < MIN_FLOOR_PIXELS:
        return None
    least = default_covariance()
    mean, covariance = _find_mode(near.T, expected if is_lit else None, least), 4.0 * least
    for _ in range(ROUNDS):
        kept = near.compress(measure_unlike(near.T, mean, covariance) <= TRIM, axis=1)
        if kept.shape[1] < MIN_FLOOR_PIXELS:
            return None
        mean = kept.mean(axis=1)
        variances = kept.var(axis=1, mean=mean[:, None])
        covariance = np.maximum(np.diag(variances * 1.1), least)  # 1.1: trimming makes it smaller
    return mean, covariance


def measure_unlike(appearance: Floats, mean: Floats, covariance: Floats) -> Floats:
    """Squared Mahalanobis distance (...) of looks (..., 3) from the floor's."""
    information = np.linalg.inv(covariance)
    off = [appearance[..., part] - mean[part] for part in range(3)]
    squares = np.zeros(appearance.shape[:-1])
    for i, j in np.argwhere(information):  # 3 of 9 where the parts are independent; ten times as fast as einsum
        squares += off[i] * information[i, j] * off[j]
    return squares


def find_floor_in_shade(
    appearance: Floats, here: NDArray[np.bool_], mean: Floats, covariance: Floats
) -> NDArray[np.bool_]:
    """Which pixels (rows, columns) of ``here`` look like the floor, or like it in other light.

    Light changes the brightness, and the hue a little, as walls reflect it; and mostly little by little. What has about
    the floor's hue is floor too where a way leads to floor on which the looks change nowhere at once. At the foot of a
    thing they do.

    Args:
        appearance: (rows, columns, 3); mean, covariance: the floor's.
    """
    alike = np.zeros(here.shape, bool)
    alike[here] = measure_unlike(appearance[here], mean, covariance) <= MAX_UNLIKE**2
    may_be = here & _has_hue(appearance, mean, MAX_SHADE_CHROMA)
    around, sigmas = np.ones((3, 3), np.uint8), np.sqrt(np.diag(covariance))
    for part, sigma in zip(np.moveaxis(appearance.astype(np.float32), -1, 0), sigmas, strict=True):
        may_be &= cv2.dilate(part, around) - cv2.erode(part, around) <= MAX_SHADE_STEP * sigma
    _, parts = cv2.connectedComponents(((here & alike) | may_be).astype(np.uint8), connectivity=4)
    reached = np.zeros(int(parts.max()) + 1, bool)
    reached[parts[alike]] = True
    reached[0] = False
    return np.asarray(reached[parts])


def _has_hue(appearance: Floats, expected: Floats, limit: float) -> NDArray[np.bool_]:
    """Which of the looks (..., 3) have the red and the blue of the expected ones (3,), within the limit."""
    red, blue = (np.abs(appearance[..., part] - expected[part]) <= limit for part in (1, 2))
    return np.asarray(red & blue)


def _find_mode(appearance: Floats, expected: Floats | None, least: Floats) -> Floats:
    """The most frequent brightness of looks (n, 3) and the median hue there; near the expected, if it is."""
    sigma = math.sqrt(least[0, 0])
    values = appearance[:, 0]
    if expected is not None:
        near = np.abs(values - expected[0]) <= 6.0 * sigma
        values = values[near] if np.count_nonzero(near) > len(values) // 4 else values
    counts, edges = np.histogram(values, bins=max(1, math.ceil(float(np.ptp(values)) / sigma)))
    wide = np.convolve(counts, np.ones(3), "same")
    best = int(np.argmax(wide))
    middle = 0.5 * (edges[best] + edges[best + 1])
    there = np.abs(appearance[:, 0] - middle) <= 2.0 * sigma
    return np.median(appearance[there], axis=0) if there.any() else np.median(appearance, axis=0)
