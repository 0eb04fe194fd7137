"""Regions of like brightness (§1.2).

The image is cut into sectors, so that a small thing's mode is not drowned by the rest of the picture; in each, the
histogram's valleys part the grey levels; what touches across a sector's border and is alike is joined.
Source: [2]; J. Beveridge et al., Segmenting images using localized histograms and region merging, IJCV 2, 1989.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.images import to_grey_float

_BINS = 64
_BIN_WIDTH = 256.0 / _BINS


@dataclass(frozen=True, slots=True, eq=False)
class Regions:
    """Connected regions of an image.

    Attributes:
        labels: (h, w) int32, 0 .. n - 1.
        areas_px: (n,) pixel counts.
        means: (n,) mean grey level.
        deviations: (n,) standard deviation of the grey level.
    """

    labels: NDArray[np.int32]
    areas_px: NDArray[np.int64]
    means: NDArray[np.float64]
    deviations: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.areas_px)


def segment_regions(
    image: Any, *, sector_px: int = 64, min_area_px: int = 60, join_levels: float = 12.0
) -> Regions:
    """Regions of like brightness of an image (h, w) of grey levels.

    Args:
        sector_px: side of the sectors whose histograms are taken [px].
        min_area_px: smaller regions join the neighbour that is most like them.
        join_levels: parts of different sectors join where they differ less along their border [grey levels].

    Raises:
        ValueError: not a grey image, or a limit is not positive.
    """
    pixels = to_grey_float(image)
    if sector_px < 8 or min_area_px < 1 or join_levels <= 0:
        got = f"{sector_px}, {min_area_px}, {join_levels}"
        raise ValueError(f"expected sector_px >= 8, min_area_px >= 1, join_levels > 0, got {got}")
    levels = np.clip(np.rint(pixels), 0, 255).astype(np.uint8)
    smooth = np.asarray(cv2.medianBlur(levels, 3), np.uint8)
    labels = _sector_labels(smooth, sector_px)
    labels = _joined_sectors(labels, smooth.astype(np.float32), sector_px, join_levels)
    labels = _absorbed(labels, pixels, min_area_px)
    areas, means, deviations = _statistics(labels, pixels)
    return Regions(labels, areas, means, deviations)


def find_histogram_valleys(levels: NDArray[np.uint8], least_share: float = 0.02) -> NDArray[np.float64]:
    """Grey levels that part the modes of a histogram; empty where there is one mode.

    A valley counts where it is under 0.6 of the lower of its two peaks and each side holds `least_share` of the pixels.
    """
    counts = np.histogram(levels, _BINS, (0.0, 256.0))[0].astype(float)
    smooth = np.convolve(np.pad(counts, 3, mode="edge"), np.array([1, 3, 6, 7, 6, 3, 1]) / 27.0, mode="valid")
    cuts: list[int] = []
    start = 0
    for valley in _minima(smooth):
        left, right = smooth[start : valley + 1].max(), smooth[valley:].max()
        share = counts[start:valley].sum(), counts[valley:].sum()
        if smooth[valley] < 0.6 * min(left, right) and min(share) >= least_share * levels.size:
            cuts.append(valley)
            start = valley
    return (np.array(cuts, float) + 0.5) * _BIN_WIDTH


def _minima(smooth: NDArray[np.float64]) -> list[int]:
    inner = np.flatnonzero((smooth[1:-1] <= smooth[:-2]) & (smooth[1:-1] < smooth[2:])) + 1
    return [int(k) for k in inner]


def _sector_labels(levels: NDArray[np.uint8], side: int) -> NDArray[np.int32]:
    """Connected parts of one histogram mode, each within one sector.

    A sector's histogram is taken a quarter of its side beyond it, lest what only just reaches into it have no mode.
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


def _joined_sectors(
    labels: NDArray[np.int32], levels: NDArray[np.float32], side: int, join: float
) -> NDArray[np.int32]:
    """Parts that meet at a sector's border join, the most alike first.

    They must agree along their border, and so must, twice as loosely, the whole regions that they have become part of:
    otherwise a chain of small steps would join everything.
    """
    edges = [_border_pairs(labels, levels, side), _border_pairs(labels.T, levels.T, side)]
    a, b, difference = (np.concatenate(parts) for parts in zip(*edges, strict=True))
    areas, means, _ = _statistics(labels, levels)
    key, where = np.unique(a.astype(np.int64) * len(areas) + b, return_inverse=True)
    length = np.bincount(where, minlength=len(key))
    step = np.abs(np.bincount(where, difference, len(key))) / np.maximum(length, 1)
    alike = np.flatnonzero((step < join) & (length >= 3))
    alike = alike[np.argsort(step[alike], kind="stable")]
    root = _agglomerated(key[alike] // len(areas), key[alike] % len(areas), areas, means, 2.0 * join)
    return _renumbered(labels, root)


def _agglomerated(
    a: NDArray[np.int64], b: NDArray[np.int64], areas: NDArray[np.int64], means: NDArray[np.float64], limit: float
) -> NDArray[np.int64]:
    """Whose region each part is in after joining, in order, pairs whose regions' means differ less than `limit`."""
    parent = list(range(len(areas)))
    area, mean = areas.astype(float).tolist(), means.tolist()

    def root(k: int) -> int:
        while parent[k] != k:
            parent[k] = parent[parent[k]]
            k = parent[k]
        return k

    for x, y in zip(a.tolist(), b.tolist(), strict=True):
        p, q = root(x), root(y)
        if p != q and abs(mean[p] - mean[q]) < limit:
            mean[p] = (mean[p] * area[p] + mean[q] * area[q]) / (area[p] + area[q])
            area[p] += area[q]
            parent[q] = p
    return np.array([root(k) for k in range(len(parent))])


def _border_pairs(
    labels: NDArray[np.int32], levels: NDArray[np.float32], side: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
    """Labels on both sides of each place of the horizontal sector borders, and the step in brightness across it."""
    rows = np.arange(side, labels.shape[0], side)
    return (
        labels[rows - 1].ravel(),
        labels[rows].ravel(),
        (levels[rows] - levels[rows - 1]).ravel(),
    )


def _renumbered(labels: NDArray[np.int32], root: NDArray[np.int64]) -> NDArray[np.int32]:
    """The label image with each label replaced by its root, numbered from 0 without gaps."""
    return np.asarray(np.unique(root, return_inverse=True)[1][labels], np.int32)


def _absorbed(labels: NDArray[np.int32], pixels: NDArray[np.float32], min_area: int) -> NDArray[np.int32]:
    """Regions that are too small join the touching region of nearest brightness, in rounds until none is left."""
    areas, means, _ = _statistics(labels, pixels)
    while len(areas) > 1 and areas.min() < min_area:
        a, b = _touching(labels)
        of_small = areas[a] < min_area
        a, b = a[of_small], b[of_small]
        order = np.lexsort((b, np.abs(means[a] - means[b]), a))
        nearest = order[np.unique(a[order], return_index=True)[1]]
        labels = _renumbered(labels, _agglomerated(a[nearest], b[nearest], areas, means, math.inf))
        areas, means, _ = _statistics(labels, pixels)
    return labels


def _touching(labels: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of regions that share a border, both ways round."""
    n = int(labels.max()) + 1
    side = [(labels[:, :-1], labels[:, 1:]), (labels[:-1], labels[1:])]
    pairs = np.unique(np.concatenate([(x.astype(np.int64) * n + y)[x != y] for x, y in side]))
    a, b = pairs // n, pairs % n
    return np.concatenate([a, b]), np.concatenate([b, a])


def _statistics(
    labels: NDArray[np.int32], pixels: NDArray[np.float32]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    flat, values = labels.ravel(), pixels.ravel().astype(np.float64)
    areas = np.bincount(flat)
    means = np.bincount(flat, values) / areas
    variance = np.bincount(flat, (values - means[flat]) ** 2) / areas
    return areas, means, np.sqrt(variance)
