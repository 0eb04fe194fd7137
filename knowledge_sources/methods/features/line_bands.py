"""Prediction-guided line search (Figure 1): edges are looked for only in bands round predicted lines.

Each band is straightened into a strip whose columns run across the predicted line; the strips stand side by side in one
canvas. Smoothing then runs *along* the predicted direction, which brings out faint edges, and an edge is a chain of
gradient peaks, column after column.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from knowledge_sources.methods.arrays import Floats, Floats32, Indices, Mask
from knowledge_sources.settings.features import FeaturesSettings
from world_models.camera import clip_segments

_MAP_WIDTH = 1024
"""Columns of the maps given to OpenCV, which limits both sides of its result to 32767."""


@dataclass(frozen=True, slots=True)
class _Strips:
    """The bands side by side.

    Attributes:
        x, y: (rows, columns) place in the image of every canvas cell [px].
        owner: (columns,) index of each column's prediction.
        usable: (rows, columns) cells that may hold peaks.
    """

    x: Floats
    y: Floats
    owner: Indices
    usable: Mask


@dataclass(frozen=True, slots=True)
class BandSegments:
    """Rough segments found in bands.

    Attributes:
        segments_px: (n, 2, 2) [px].
        sign: (n,) 1 where the right-hand side is brighter, else -1.
        predicted: (n,) index of the prediction in whose band a segment lies.
    """

    segments_px: Floats
    sign: Floats
    predicted: Indices


@dataclass(frozen=True, slots=True)
class _Chains:
    """Gradient peaks by chain: column (n,), sub-pixel row (n,) and number of the chain (n,)."""

    column: Indices
    row: Floats
    label: Indices


def find_in_bands(
    image: Floats32, predicted_px: Floats, noise: float, band_px: float, min_length_px: float,
    settings: FeaturesSettings,
) -> BandSegments:
    """Find rough segments near predicted lines; their ends run the way of the prediction.

    Args:
        image: (h, w) grey levels.
        predicted_px: (m, 2, 2) [px]; NaN rows find nothing.
        noise: standard deviation of the pixel noise [grey levels].
        band_px: half-width of a band, and its reach beyond the prediction's ends [px].
        min_length_px: least length of a segment [px].
    """
    smooth, derivative = (
        _build_gaussian(settings.band_smoothing_along_px), _build_derivative(settings.band_smoothing_across_px))
    strips = _build_strips(image.shape, predicted_px, band_px, guard=len(smooth) // 2)
    if strips is None:
        return BandSegments(np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0, np.intp))
    gradient = np.asarray(cv2.sepFilter2D(_sample(image, strips.x, strips.y), cv2.CV_32F, smooth, derivative))
    noise_gain = float(np.linalg.norm(smooth) * np.linalg.norm(derivative))
    threshold = max(settings.min_gradient_sigmas * noise * noise_gain, settings.min_band_gradient_per_px)
    parts = []
    for sign in (1.0, -1.0):
        chains = _find_chains(sign * gradient, strips.usable, threshold, min_length_px, settings)
        ends, owner = _fit_chains(strips, chains, min_length_px, settings)
        parts.append((ends, np.full(len(ends), sign), owner))
    ends, signs, owners = zip(*parts, strict=True)
    return BandSegments(np.concatenate(ends), np.concatenate(signs), np.concatenate(owners))


def _build_strips(shape: tuple[int, ...], predicted: Floats, band: float, guard: int) -> _Strips | None:
    """The strips of all predictions; ``guard`` columns beyond each end of a strip only feed the smoothing."""
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
    margin = band + guard
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
    inside &= (step >= guard) & (step < counts[strip] - guard) & (np.abs(offset) <= band)
    return _Strips(x, y, which[strip], inside)


def _sample(image: Floats32, x: Floats, y: Floats) -> Floats32:
    """Bilinear values of an image (h, w) at places x, y [px] of any one shape; the border value continues outside."""
    count = x.size
    rows = -(-count // _MAP_WIDTH)
    maps = np.zeros((2, rows * _MAP_WIDTH), np.float32)
    maps[0, :count], maps[1, :count] = x.ravel(), y.ravel()
    map_x, map_y = maps.reshape(2, rows, _MAP_WIDTH)
    values = cv2.remap(image, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, np.float32).ravel()[:count].reshape(x.shape)


def _build_gaussian(sigma: float) -> Floats:
    """A normalised kernel that reaches to three standard deviations."""
    reach = int(np.ceil(3.0 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.asarray(kernel / kernel.sum())


def _build_derivative(sigma: float) -> Floats:
    """A kernel that correlates to the derivative of the smoothed signal [per px]."""
    smooth = _build_gaussian(sigma)
    place = np.arange(len(smooth)) - len(smooth) // 2
    kernel = smooth * place
    return np.asarray(kernel / (kernel * place).sum())


def _find_chains(
    gradient: Floats32, usable: Mask, threshold: float, min_length: float, settings: FeaturesSettings
) -> _Chains:
    """Join the gradient peaks of neighbouring columns to chains, without those sure to be too short."""
    peak = np.zeros(gradient.shape, bool)
    mid = gradient[1:-1]
    peak[1:-1] = (mid > threshold) & (mid >= gradient[:-2]) & (mid > gradient[2:])
    peak &= usable
    joined = cv2.dilate(peak.view(np.uint8), np.ones((1, 2 * settings.chain_gap_px + 1), np.uint8))
    _, labels = cv2.connectedComponents(joined, connectivity=8)
    row, column = np.nonzero(peak)
    label = labels[row, column]
    enough = np.bincount(label) >= max(settings.min_edge_density * min_length, 3.0)
    renumbered = np.cumsum(enough) - 1
    keep = enough[label]
    order = np.argsort(label[keep], kind="stable")
    row, column, label = row[keep][order], column[keep][order], renumbered[label[keep][order]]
    a, b, c = (gradient[row + k, column].astype(float) for k in (-1, 0, 1))
    bend = a - 2.0 * b + c
    shift = np.where(bend < -1e-9, 0.5 * (a - c) / np.where(bend < -1e-9, bend, 1.0), 0.0)
    return _Chains(column, row + np.clip(shift, -0.5, 0.5), label.astype(np.intp))


def _fit_chains(
    strips: _Strips, chains: _Chains, min_length: float, settings: FeaturesSettings
) -> tuple[Floats, Indices]:
    """Fit a line to each chain by reweighted least squares (Geman-McClure); drop those too short, bent or turned.

    Returns:
        Segments (n, 2, 2) [px], and the prediction (n,) of each.
    """
    column, row, label = chains.column, chains.row, chains.label
    if not len(label):
        return np.zeros((0, 2, 2)), np.zeros(0, np.intp)
    n = int(label.max()) + 1
    offset, slope, weight = np.zeros(n), np.zeros(n), np.ones(len(row))
    for _ in range(settings.chain_iterations):
        mass = np.bincount(label, weight, n)
        safe = np.maximum(mass, 1e-9)
        mean_c, mean_r = np.bincount(label, weight * column, n) / safe, np.bincount(label, weight * row, n) / safe
        dc, dr = column - mean_c[label], row - mean_r[label]
        slope = np.bincount(label, weight * dc * dr, n) / np.maximum(np.bincount(label, weight * dc * dc, n), 1e-9)
        offset = mean_r - slope * mean_c
        residual = row - offset[label] - slope[label] * column
        weight = 1.0 / (1.0 + (residual / settings.chain_scale_px) ** 2) ** 2
    on_line = np.abs(residual) < settings.max_chain_residual_px
    start = np.flatnonzero(np.diff(label, prepend=-1))
    low = np.minimum.reduceat(np.where(on_line, column, np.inf), start)
    high = np.maximum.reduceat(np.where(on_line, column, -np.inf), start)
    count = np.bincount(label[on_line], minlength=n)
    length = high - low + 1.0
    good = (count >= 3) & (length >= min_length) & (count >= settings.min_edge_density * length)
    good &= np.abs(slope) <= np.tan(settings.max_band_turn_rad)
    which = np.flatnonzero(good)
    ends = np.stack([_to_image(strips, c[which], (offset + slope * c)[which]) for c in (low, high)], axis=1)
    owner = np.zeros(n, np.intp)
    owner[label] = strips.owner[column]
    return ends, owner[which]


def _to_image(strips: _Strips, column: Floats, row: Floats) -> Floats:
    """Places (n, 2) in the image [px] of canvas places: columns are whole, rows continue linearly."""
    c = column.astype(np.intp)
    step = np.stack([strips.x[1, c] - strips.x[0, c], strips.y[1, c] - strips.y[0, c]], axis=1)
    return np.asarray(np.stack([strips.x[0, c], strips.y[0, c]], axis=1) + row[:, None] * step)
