"""Regions of like brightness (§1.2), by localized histograms and region merging.

The image is divided into sectors, so that a small thing's mode is not hidden by the rest of the picture. In each sector
the valleys of the histogram separate the grey levels; connected parts are regions, and those that touch across a
sector's border and are alike are merged.
Source: [2]; J. Beveridge et al., Segmenting images using localized histograms and region merging, IJCV 2, 1989.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats, Floats32, Image, Ints
from knowledge_sources.methods.features.picture import to_grey_float

MAX_VALLEY_SHARE = 0.6  # largest height of a histogram's valley as a share of the lower of its two peaks
MIN_MODE_SHARE = 0.02  # least share of a sector's pixels on each side of a valley
HISTOGRAM_BINS = 64  # bins of a sector's histogram of grey levels
MAX_BORDER_STEP = 12.0  # grey levels; largest step across a sector's border between parts that are joined

Labels = NDArray[np.int32]


def segment_regions(
    image: Any, *, sector_px: int = 64, min_area_px: int = 60
) -> Labels:
    """Segment an image (h, w) of grey levels into connected regions of like brightness: labels (h, w), 0 .. n - 1.

    Args:
        sector_px: side of the sectors whose histograms are taken [px].
        min_area_px: smaller regions are merged into the most similar neighbour [px].

    Raises:
        ValueError: not a grey image, or a limit is too small.
    """
    pixels = to_grey_float(image)
    if sector_px < 8 or min_area_px < 1:
        raise ValueError(f"expected sector_px >= 8 and min_area_px >= 1, got {sector_px} and {min_area_px}")
    levels = np.clip(np.rint(pixels), 0, 255).astype(np.uint8)
    smooth = np.asarray(cv2.medianBlur(levels, 3), np.uint8)
    labels = _label_sectors(smooth, sector_px)
    labels = _merge_sectors(labels, smooth.astype(np.float32), sector_px, MAX_BORDER_STEP)
    return _merge_small(labels, pixels, min_area_px)


def find_histogram_valleys(levels: Image) -> Floats:
    """Grey levels (n,) that separate the modes of a histogram; empty where there is one mode.

    A valley counts where it is low enough against the lower of its two peaks (``max_valley_share``) and each side holds
    enough pixels (``min_mode_share``).
    """
    bins = HISTOGRAM_BINS
    counts = np.histogram(levels, bins, (0.0, 256.0))[0].astype(float)
    smooth = np.convolve(np.pad(counts, 3, mode="edge"), np.array([1, 3, 6, 7, 6, 3, 1]) / 27.0, mode="valid")
    minima = np.flatnonzero((smooth[1:-1] <= smooth[:-2]) & (smooth[1:-1] < smooth[2:])) + 1
    valleys: list[int] = []
    start = 0
    for valley in minima.tolist():
        left, right = smooth[start : valley + 1].max(), smooth[valley:].max()
        pixels = min(counts[start:valley].sum(), counts[valley:].sum())
        is_low = smooth[valley] < MAX_VALLEY_SHARE * min(left, right)
        if is_low and pixels >= MIN_MODE_SHARE * levels.size:
            valleys.append(valley)
            start = valley
    return (np.array(valleys, float) + 0.5) * (256.0 / bins)


def _label_sectors(levels: Image, side: int) -> Labels:
    """Connected parts of one histogram mode, each within one sector.

    A sector's histogram is taken a quarter of its side beyond it, so that what only just reaches into it has a mode.
    """
    margin = side // 4
    height, width = levels.shape
    labels = np.zeros((height, width), np.int32)
    used = 0
    for top in range(0, height, side):
        for left in range(0, width, side):
            sector = levels[top : top + side, left : left + side]
            around = levels[max(top - margin, 0) : top + side + margin, max(left - margin, 0) : left + side + margin]
            modes = np.digitize(sector, find_histogram_valleys(around))
            for mode in range(int(modes.max()) + 1):
                count, parts = cv2.connectedComponents((modes == mode).astype(np.uint8), connectivity=4)
                block = labels[top : top + side, left : left + side]
                block[parts > 0] = parts[parts > 0] + (used - 1)
                used += count - 1
    return labels


def _merge_sectors(labels: Labels, levels: Floats32, side: int, max_step: float) -> Labels:
    """Merge parts that meet at a sector's border, the most similar first.

    They must agree along their border, and so must, within twice the step, the whole regions that they have become part
    of: otherwise a chain of small steps would merge everything.
    """
    edges = [_find_border_pairs(labels, levels, side), _find_border_pairs(labels.T, levels.T, side)]
    a, b, difference = (np.concatenate(parts) for parts in zip(*edges, strict=True))
    areas, means = _compute_statistics(labels, levels)
    key, where = np.unique(a.astype(np.int64) * len(areas) + b, return_inverse=True)
    length = np.bincount(where, minlength=len(key))
    step = np.abs(np.bincount(where, difference, len(key))) / np.maximum(length, 1)
    alike = np.flatnonzero((step < max_step) & (length >= 3))
    alike = alike[np.argsort(step[alike], kind="stable")]
    root = _merge_pairs(key[alike] // len(areas), key[alike] % len(areas), areas, means, 2.0 * max_step)
    return _renumber(labels, root)


def _merge_pairs(a: Ints, b: Ints, areas: Ints, means: Floats, limit: float) -> Ints:
    """Union-find: the region of each part after merging, in order, pairs whose regions' means differ less than a limit.
    """
    parent = list(range(len(areas)))
    area, mean = areas.astype(float).tolist(), means.tolist()

    def find_root(k: int) -> int:
        while parent[k] != k:
            parent[k] = parent[parent[k]]
            k = parent[k]
        return k

    for x, y in zip(a.tolist(), b.tolist(), strict=True):
        p, q = find_root(x), find_root(y)
        if p != q and abs(mean[p] - mean[q]) < limit:
            mean[p] = (mean[p] * area[p] + mean[q] * area[q]) / (area[p] + area[q])
            area[p] += area[q]
            parent[q] = p
    return np.array([find_root(k) for k in range(len(parent))])


def _find_border_pairs(labels: Labels, levels: Floats32, side: int) -> tuple[Labels, Labels, Floats32]:
    """Labels on both sides of each place of the horizontal sector borders, and the step in brightness across it."""
    rows = np.arange(side, labels.shape[0], side)
    return (
        labels[rows - 1].ravel(),
        labels[rows].ravel(),
        (levels[rows] - levels[rows - 1]).ravel(),
    )


def _renumber(labels: Labels, root: Ints) -> Labels:
    """The label image with each label replaced by its root, numbered from 0 without gaps."""
    return np.asarray(np.unique(root, return_inverse=True)[1][labels], np.int32)


def _merge_small(labels: Labels, pixels: Floats32, min_area: int) -> Labels:
    """Merge regions that are too small into the touching region of nearest brightness, in rounds until none is left."""
    areas, means = _compute_statistics(labels, pixels)
    while len(areas) > 1 and areas.min() < min_area:
        a, b = _find_touching(labels)
        of_small = areas[a] < min_area
        a, b = a[of_small], b[of_small]
        order = np.lexsort((b, np.abs(means[a] - means[b]), a))
        nearest = order[np.unique(a[order], return_index=True)[1]]
        labels = _renumber(labels, _merge_pairs(a[nearest], b[nearest], areas, means, math.inf))
        areas, means = _compute_statistics(labels, pixels)
    return labels


def _find_touching(labels: Labels) -> tuple[Ints, Ints]:
    """Pairs of regions that share a border, in both orders."""
    n = int(labels.max()) + 1
    side = [(labels[:, :-1], labels[:, 1:]), (labels[:-1], labels[1:])]
    pairs = np.unique(np.concatenate([(x.astype(np.int64) * n + y)[x != y] for x, y in side]))
    a, b = pairs // n, pairs % n
    return np.concatenate([a, b]), np.concatenate([b, a])


def _compute_statistics(labels: Labels, pixels: Floats32) -> tuple[Ints, Floats]:
    """Area and mean of each region."""
    flat, values = labels.ravel(), pixels.ravel().astype(np.float64)
    areas = np.bincount(flat)
    return areas, np.bincount(flat, values) / areas
