"""The blind man's cane (Figure 1): edges are looked for only in bands round predicted lines.

Each band is straightened into a strip whose columns run across the predicted line; the strips stand side by side in one
canvas. Smoothing then runs *along* the predicted direction, which brings out faint edges, and an edge is a chain of
gradient peaks, column after column.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.sampling import sample
from world_models.camera import clip_segments

_ALONG_PX = 2.0
_ACROSS_PX = 1.0
_GUARD_PX = 6
"""Columns beyond each end of a strip that only feed the smoothing."""

_SIGNIFICANT = 4.0
"""A peak must stand this many standard deviations of the noise above zero."""

_FAINTEST = 0.5
"""No gradient under this is an edge [grey levels per px]."""

_LEAST_DENSITY = 0.6
"""Share of a chain's columns that must have a peak on its line."""


@dataclass(frozen=True, slots=True)
class _Strips:
    """The bands: x, y (rows, columns) [px] of every canvas cell, each column's prediction, which may hold peaks."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    owner: NDArray[np.intp]
    usable: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Found:
    """Segments (n, 2, 2) [px]; 1 where the right-hand side is brighter, else -1 (n,); whose band each is in (n,)."""

    segments_px: NDArray[np.float64]
    sign: NDArray[np.float64]
    predicted: NDArray[np.intp]


def find_in_bands(
    image: NDArray[np.float32],
    predicted_px: NDArray[np.float64],
    noise: float,
    band_px: float,
    min_length_px: float,
    max_turn_rad: float,
) -> Found:
    """Rough segments near predicted lines (m, 2, 2) [px]; ends run the way of the prediction."""
    strips = _strips(image.shape, predicted_px, band_px)
    if strips is None:
        return Found(np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0, np.intp))
    gradient = _gradient(sample(image, strips.x, strips.y))
    threshold = max(_SIGNIFICANT * noise * _noise_gain(), _FAINTEST)
    parts = []
    for sign in (1.0, -1.0):
        chains = _chains(sign * gradient, strips.usable, threshold, min_length_px)
        ends, owner = _straight(strips, *chains, min_length_px, max_turn_rad)
        parts.append(Found(ends, np.full(len(ends), sign), owner))
    return Found(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("segments_px", "sign", "predicted")))


def _strips(shape: tuple[int, ...], predicted: NDArray[np.float64], band: float) -> _Strips | None:
    # What is further outside than the band cannot show, however far a prediction runs.
    clipped, usable = clip_segments(predicted + band, round(shape[1] + 2.0 * band), round(shape[0] + 2.0 * band))
    predicted = clipped - band
    delta = predicted[:, 1] - predicted[:, 0]
    length = np.linalg.norm(delta, axis=1)
    usable &= length > 1e-6
    if not usable.any():
        return None
    which = np.flatnonzero(usable)
    along = delta[which] / length[which, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    margin = band + _GUARD_PX
    # A whole number of columns stays that number when the band is shifted and its length rounds up by a last bit.
    counts = np.ceil(length[which] + 2.0 * margin - 1e-6).astype(np.intp) + 1
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    strip = np.repeat(np.arange(len(which)), counts)
    step = np.arange(len(strip)) - first[strip]
    t = step - (counts[strip] - 1 - length[which][strip]) / 2.0
    half = int(np.ceil(band)) + 2
    offset = np.arange(-half, half + 1, dtype=float)[:, None]
    base = predicted[which, 0][strip] + t[:, None] * along[strip]
    x = base[:, 0] + offset * across[strip, 0]
    y = base[:, 1] + offset * across[strip, 1]
    inside = (x > 1.0) & (x < shape[1] - 2.0) & (y > 1.0) & (y < shape[0] - 2.0)
    inside &= (step >= _GUARD_PX) & (step < counts[strip] - _GUARD_PX) & (np.abs(offset) <= band)
    return _Strips(x, y, which[strip], inside)


def _gradient(canvas: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(cv2.sepFilter2D(canvas, cv2.CV_32F, _gaussian(_ALONG_PX), _derivative(_ACROSS_PX)))


def _gaussian(sigma: float) -> NDArray[np.float64]:
    reach = int(np.ceil(3.0 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.asarray(kernel / kernel.sum())


def _derivative(sigma: float) -> NDArray[np.float64]:
    """Correlating with it gives the derivative of the smoothed signal [per px]."""
    smooth = _gaussian(sigma)
    place = np.arange(len(smooth)) - len(smooth) // 2
    kernel = smooth * place
    return np.asarray(kernel / (kernel * place).sum())


def _noise_gain() -> float:
    """Standard deviation of the gradient of white noise of deviation one."""
    return float(np.linalg.norm(_gaussian(_ALONG_PX)) * np.linalg.norm(_derivative(_ACROSS_PX)))


Chains = tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.intp]]


def _chains(gradient: NDArray[np.float32], usable: NDArray[np.bool_], threshold: float, min_length: float) -> Chains:
    """Column, sub-pixel row and chain number of each gradient peak, by chain, without chains sure to be too short."""
    peak = np.zeros(gradient.shape, bool)
    mid = gradient[1:-1]
    peak[1:-1] = (mid > threshold) & (mid >= gradient[:-2]) & (mid > gradient[2:])
    peak &= usable
    joined = cv2.dilate(peak.view(np.uint8), np.ones((1, 5), np.uint8))
    _, labels = cv2.connectedComponents(joined, connectivity=8)
    row, column = np.nonzero(peak)
    label = labels[row, column]
    enough = np.bincount(label) >= max(_LEAST_DENSITY * min_length, 3.0)
    renumbered = np.cumsum(enough) - 1
    keep = enough[label]
    order = np.argsort(label[keep], kind="stable")
    row, column, label = row[keep][order], column[keep][order], renumbered[label[keep][order]]
    a, b, c = (gradient[row + k, column].astype(float) for k in (-1, 0, 1))
    bend = a - 2.0 * b + c
    shift = np.where(bend < -1e-9, 0.5 * (a - c) / np.where(bend < -1e-9, bend, 1.0), 0.0)
    return column, row + np.clip(shift, -0.5, 0.5), label.astype(np.intp)


def _straight(
    strips: _Strips,
    column: NDArray[np.intp],
    row: NDArray[np.float64],
    label: NDArray[np.intp],
    min_length: float,
    max_turn: float,
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """A line through each chain; chains too short, too bent or too far turned are dropped."""
    if not len(label):
        return np.zeros((0, 2, 2)), np.zeros(0, np.intp)
    n = int(label.max()) + 1
    offset, slope, weight = np.zeros(n), np.zeros(n), np.ones(len(row))
    for _ in range(3):
        mass = np.bincount(label, weight, n)
        safe = np.maximum(mass, 1e-9)
        mean_c, mean_r = np.bincount(label, weight * column, n) / safe, np.bincount(label, weight * row, n) / safe
        dc, dr = column - mean_c[label], row - mean_r[label]
        slope = np.bincount(label, weight * dc * dr, n) / np.maximum(np.bincount(label, weight * dc * dc, n), 1e-9)
        offset = mean_r - slope * mean_c
        residual = row - offset[label] - slope[label] * column
        weight = 1.0 / (1.0 + (residual / 0.5) ** 2) ** 2
    on_line = np.abs(residual) < 1.0
    start = np.flatnonzero(np.diff(label, prepend=-1))
    low = np.minimum.reduceat(np.where(on_line, column, np.inf), start)
    high = np.maximum.reduceat(np.where(on_line, column, -np.inf), start)
    count = np.bincount(label[on_line], minlength=n)
    length = high - low + 1.0
    good = (count >= 3) & (length >= min_length) & (count >= _LEAST_DENSITY * length)
    good &= np.abs(slope) <= np.tan(max_turn)
    which = np.flatnonzero(good)
    ends = np.stack([_place(strips, c[which], (offset + slope * c)[which]) for c in (low, high)], axis=1)
    owner = np.zeros(n, np.intp)
    owner[label] = strips.owner[column]
    return ends, owner[which]


def _place(strips: _Strips, column: NDArray[np.float64], row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (n, 2) of canvas places: columns are whole, rows continue linearly."""
    c = column.astype(np.intp)
    step = np.stack([strips.x[1, c] - strips.x[0, c], strips.y[1, c] - strips.y[0, c]], axis=1)
    return np.asarray(np.stack([strips.x[0, c], strips.y[0, c]], axis=1) + row[:, None] * step)
