"""Laws of the region segmenter."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.arrays import Image
from knowledge_sources.methods.features import MAX_VALLEY_SHARE, MIN_MODE_SHARE, segment_regions
from knowledge_sources.methods.features.regions import find_histogram_valleys

few = settings(deadline=None, max_examples=20)
seeds = st.integers(0, 10_000)
sides = st.integers(20, 45)


def boxes(seed: int, noise: float = 2.0) -> Image:
    """Rectangles of clearly different brightness on a plain ground."""
    rng = np.random.default_rng(seed)
    image = np.full((128, 160), 40.0)
    for level in rng.permutation([90.0, 140.0, 190.0, 240.0]):
        u, v = rng.integers(0, 120), rng.integers(0, 90)
        image[v : v + rng.integers(15, 40), u : u + rng.integers(15, 40)] = level
    return np.clip(np.rint(image + noise * rng.standard_normal(image.shape)), 0, 255).astype(np.uint8)


@few
@given(seeds)
def test_regions_part_the_image_into_connected_pieces(seed: int) -> None:
    image = boxes(seed)
    labels = segment_regions(image)
    assert labels.shape == image.shape
    assert np.array_equal(np.unique(labels), np.arange(labels.max() + 1))
    for k in range(labels.max() + 1):
        assert cv2.connectedComponents((labels == k).astype(np.uint8), connectivity=4)[0] == 2


@few
@given(seeds, st.integers(1, 300))
def test_no_region_is_smaller_than_asked(seed: int, least: int) -> None:
    areas = np.bincount(segment_regions(boxes(seed), min_area_px=least).ravel())
    assert areas.min() >= least or len(areas) == 1


@few
@given(st.tuples(st.integers(10, 80), st.integers(10, 60)), sides, sides, st.floats(0.0, 4.0), seeds)
def test_a_box_on_a_plain_ground_is_one_region(
    corner: tuple[int, int], width: int, height: int, noise: float, seed: int
) -> None:
    u, v = corner
    truth = np.zeros((128, 160), bool)
    truth[v : v + height, u : u + width] = True
    image = np.where(truth, 170.0, 70.0) + noise * np.random.default_rng(seed).standard_normal(truth.shape)
    labels = segment_regions(image)
    mine = labels == np.bincount(labels[truth]).argmax()
    assert np.sum(mine & truth) / np.sum(mine | truth) > 0.9


@few
@given(seeds, st.integers(-30, 15))
def test_a_brighter_image_has_the_same_regions(seed: int, level: int) -> None:
    image = boxes(seed, 0.0)
    a = segment_regions(image)
    b = segment_regions((image.astype(int) + level).astype(float))
    # Bins are four levels wide, so the same regions up to their thin borders.
    assert a.max() == b.max()
    means = [np.sort([image[labels == k].mean() for k in range(a.max() + 1)]) for labels in (a, b)]
    np.testing.assert_allclose(means[1], means[0], atol=1.0)


@few
@given(st.integers(20, 90), st.integers(60, 130), st.floats(2.0, 6.0), st.floats(0.2, 0.8), seeds)
def test_two_modes_are_parted_between_them(low: int, gap: int, spread: float, share: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(4000 * share)
    levels = np.concatenate([rng.normal(low, spread, count), rng.normal(low + gap, spread, 4000 - count)])
    cuts = find_histogram_valleys(np.clip(np.rint(levels), 0, 255).astype(np.uint8).reshape(50, 80))
    assert len(cuts) >= 1
    assert np.any((cuts > low + 2 * spread - 4) & (cuts < low + gap - 2 * spread + 4))
    assert len(find_histogram_valleys(np.full((50, 80), low, np.uint8))) == 0


@few
@given(st.sampled_from([-1, 1]), st.booleans())
def test_a_valley_needs_so_many_pixels_on_each_side_and_to_be_so_low(side: int, is_share: bool) -> None:
    """Just below and just above the least share of a mode, and the greatest share of the lower peak."""
    total = 20_000
    if is_share:
        fewer = int((MIN_MODE_SHARE * (1.0 + 0.05 * side)) * total)
        levels = np.concatenate([np.full(total - fewer, 50), np.full(fewer, 200)])
        is_valley = side > 0
    else:
        weights = np.ones(41)
        weights[24:] = 2.0  # the lower peak counts
        weights[17:24] = MAX_VALLEY_SHARE * (1.0 + 0.05 * side)  # as wide as the smoothing: its bottom stays
        counts = np.rint(weights * 400).astype(int)
        levels = np.repeat(40 + 4 * np.arange(41), counts)
        is_valley = side < 0
    cuts = find_histogram_valleys(levels.astype(np.uint8).reshape(1, -1))
    assert (len(cuts) > 0) == is_valley
