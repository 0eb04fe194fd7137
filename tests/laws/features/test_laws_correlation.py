"""Laws of template correlation on patterns that are known at every real-valued place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.features import (
    Correlation,
    compute_second_peak,
    correlate,
    extract_template,
    measure_corner_strengths,
)

SIZE = 96
few = settings(deadline=None, max_examples=25)
seeds = st.integers(0, 10_000)
fractions = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
shifts = st.tuples(st.floats(-6.0, 6.0), st.floats(-6.0, 6.0))


def self_correlate(image: Any, centre_px: Any, half_px: int, search_px: float) -> Correlation:
    """A patch correlated with its own image."""
    template = extract_template(image, centre_px, half_px)
    found = correlate(template, image, np.rint(np.asarray(centre_px, float)), search_px)
    assert found is not None
    return found


def pattern(seed: int, shift: Any = (0.0, 0.0), scale: float = 1.0) -> Floats:
    """Sum of waves of 6 px and more, moved by a shift and enlarged about the image's middle; exact at every place."""
    rng = np.random.default_rng(seed)
    v, u = (np.mgrid[0:SIZE, 0:SIZE] - SIZE / 2.0)
    u, v = (u - shift[0]) / scale, (v - shift[1]) / scale
    image = np.full((SIZE, SIZE), 128.0)
    for _ in range(16):
        angle, length = rng.uniform(0, 2 * np.pi), rng.uniform(6.0, 25.0)
        wave = 2 * np.pi / length * (u * np.cos(angle) + v * np.sin(angle)) + rng.uniform(0, 2 * np.pi)
        image += 9.0 * np.cos(wave)
    return image


def middle(offset: Any = (0.0, 0.0)) -> Floats:
    return np.asarray(np.array([SIZE / 2.0, SIZE / 2.0]) + offset)


@few
@given(seeds, fractions, shifts)
def test_a_moved_patch_is_found_to_a_twentieth_of_a_pixel(seed: int, fraction: Any, shift: Any) -> None:
    template = extract_template(pattern(seed), middle(fraction), 10)
    found = correlate(template, pattern(seed, shift), middle(fraction), 9.0)
    assert found is not None
    assert found.peak > 0.985
    np.testing.assert_allclose(found.position_px, middle(fraction) + shift, atol=0.05)
    np.testing.assert_allclose(found.moved_px, shift, atol=0.05)


@few
@given(seeds, fractions, st.floats(0.8, 1.3))
def test_a_nearer_or_farther_patch_is_found_when_its_scale_is_told(seed: int, fraction: Any, scale: float) -> None:
    template = extract_template(pattern(seed), middle(fraction), 10)
    found = correlate(template, pattern(seed, (0.0, 0.0), scale), middle(), 6.0, scale=scale)
    assert found is not None
    assert found.peak > 0.97
    np.testing.assert_allclose(found.position_px, middle() + scale * np.array(fraction), atol=0.05)


@few
@given(seeds, st.floats(0.3, 1.6), st.floats(-40.0, 40.0), shifts)
def test_brightness_and_contrast_do_not_matter(seed: int, gain: float, level: float, shift: Any) -> None:
    image = pattern(seed, shift)
    template = extract_template(pattern(seed), middle(), 10)
    a = correlate(template, image, middle(), 9.0)
    b = correlate(template, gain * image + level, middle(), 9.0)
    assert a is not None
    assert b is not None
    np.testing.assert_allclose(a.position_px, b.position_px, atol=2e-3)
    assert a.peak == pytest.approx(b.peak, abs=1e-3)
    assert a.second_peak == pytest.approx(b.second_peak, abs=1e-3)


def brute_force(patch: Floats, image: Floats, half: int, u: int, v: int) -> float:
    seen = image[v - half : v + half + 1, u - half : u + half + 1]
    return float(np.corrcoef(patch.ravel(), seen.ravel())[0, 1])


@settings(deadline=None, max_examples=10)
@given(seeds, seeds)
def test_the_peak_is_the_best_of_all_correlations_worked_out_one_by_one(seed: int, other: int) -> None:
    image, half, search = pattern(other), 6, 4
    template = extract_template(pattern(seed), middle(), half)
    found = correlate(template, image, middle(), float(search))
    assert found is not None
    patch = template.resample().astype(float)
    centre = SIZE // 2
    scores = {
        (u, v): brute_force(patch, image, half, u, v)
        for u in range(centre - search, centre + search + 1)
        for v in range(centre - search, centre + search + 1)
    }
    best = max(scores, key=lambda place: scores[place])
    assert scores[best] - 1e-3 <= found.peak <= 1.4 * max(scores[best], 0.0) + 0.02  # between pixels it may be better
    assert np.abs(found.position_px - centre).max() <= search
    assert np.abs(found.position_px - best).max() <= 1.6


@few
@given(st.floats(0.0, np.pi), st.floats(-3.0, 3.0))
def test_along_an_edge_the_position_is_not_known(angle: float, offset: float) -> None:
    normal = np.array([np.cos(angle), np.sin(angle)])
    v, u = np.mgrid[0:SIZE, 0:SIZE] - SIZE / 2.0
    image = 128.0 + 60.0 * np.tanh((u * normal[0] + v * normal[1] - offset) / 1.5)
    image = np.rint(image + 1.5 * np.random.default_rng(3).standard_normal(image.shape))
    found = self_correlate(image, middle(), 10, 8.0)
    values, axes = np.linalg.eigh(found.covariance_px)
    assert values[0] < 0.1**2
    assert values[1] > 1.0
    assert abs(axes[:, 0] @ normal) > 0.95
    assert found.distinctiveness < 0.1
    assert measure_corner_strengths(image, middle(), 10)[0] < 2.0


@few
@given(seeds)
def test_a_corner_is_known_both_ways_and_stands_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = np.full((SIZE, SIZE), 60.0)
    image[SIZE // 2 :, SIZE // 2 :] = 190.0
    found = self_correlate(image + 2.0 * rng.standard_normal(image.shape), middle(), 10, 8.0)
    assert found.sigma_px < 0.1
    assert found.distinctiveness > 0.2
    assert measure_corner_strengths(image, middle(), 10)[0] > 8.0


@few
@given(st.integers(6, 12), st.floats(0.0, 5.0))
def test_a_repeated_pattern_is_not_distinctive(period: int, phase: float) -> None:
    v, u = np.mgrid[0:SIZE, 0:SIZE]
    image = 128.0 + 50.0 * np.cos(2 * np.pi * (u + phase) / period) * np.cos(2 * np.pi * v / 17.0)
    alone = self_correlate(image, middle(), 10, period / 2.0 - 0.6)
    found = self_correlate(image, middle(), 10, period + 2.0)
    assert found.distinctiveness < 0.02
    assert alone.distinctiveness > found.distinctiveness
    once, twice = (compute_second_peak(image, middle(), 10, window) for window in (period / 2.0 - 0.6, period + 2.0))
    assert once < 0.95 < twice


@pytest.mark.parametrize("noise", [2.0, 5.0, 10.0])
def test_the_covariance_is_true(noise: float) -> None:
    rng = np.random.default_rng(11)
    distances = []
    for seed in range(60):
        shift, fraction = rng.uniform(-4, 4, 2), rng.uniform(-0.5, 0.5, 2)
        seen = [np.rint(pattern(seed, s) + noise * rng.standard_normal((SIZE, SIZE))) for s in ((0.0, 0.0), shift)]
        found = correlate(extract_template(seen[0], middle(fraction), 8), seen[1], middle(fraction), 8.0)
        assert found is not None
        error = found.position_px - middle(fraction) - shift
        distances.append(error @ np.linalg.solve(found.covariance_px, error))
    assert 0.5 < np.mean(distances) < 3.0  # two, were it exact


@few
@given(seeds, st.floats(0.6, 1.6), fractions)
def test_a_resampled_patch_keeps_a_linear_shading_exactly(seed: int, scale: float, fraction: Any) -> None:
    rng = np.random.default_rng(seed)
    slope = rng.uniform(-1.0, 1.0, 2)
    v, u = np.mgrid[0:SIZE, 0:SIZE]
    template = extract_template(100.0 + slope[0] * u + slope[1] * v, middle(fraction), 7)
    dv, du = np.mgrid[-7:8, -7:8] / scale
    centre = middle(fraction)
    expected = 100.0 + slope[0] * (centre[0] + du) + slope[1] * (centre[1] + dv)
    np.testing.assert_allclose(template.resample(scale), expected, atol=0.1 if scale < 1.0 else 0.01)


@pytest.mark.parametrize("search", [4.0, 10.0, 25.0])
def test_a_blank_wall_is_known_nowhere(search: float) -> None:
    rng = np.random.default_rng(13)
    sigmas = []
    for _ in range(40):
        image, other = (np.rint(120.0 + 2.0 * rng.standard_normal((SIZE, SIZE))) for _ in range(2))
        found = correlate(extract_template(image, middle(), 8), other, middle(), search)
        assert found is not None
        assert found.peak < 0.5
        sigmas.append(found.sigma_px)
    assert np.quantile(sigmas, 0.1) > 0.25 * search


@few
@given(seeds, st.integers(-20, 20), st.integers(-20, 20))
def test_the_quick_second_peak_of_a_patch_is_that_of_its_own_correlation(seed: int, du: int, dv: int) -> None:
    image, place = pattern(seed), middle((du, dv))
    expected = self_correlate(image, place, 8, 12.0).second_peak
    assert compute_second_peak(image, place, 8, 12.0) == pytest.approx(expected, abs=1e-3)


@few
@given(seeds)
def test_corner_strength_is_the_same_turned_mirrored_and_negated(seed: int) -> None:
    image, places = pattern(seed), np.array([[30.0, 41.0], [48.0, 48.0], [60.0, 33.0]])
    expected = measure_corner_strengths(image, places, 9)
    turned = measure_corner_strengths(np.ascontiguousarray(image.T), places[:, ::-1], 9)
    mirrored = measure_corner_strengths(np.ascontiguousarray(image[:, ::-1]), np.abs(places - (SIZE - 1, 0)), 9)
    for other in (turned, mirrored, measure_corner_strengths(255.0 - image, places, 9)):
        np.testing.assert_allclose(other, expected, rtol=1e-9)


def test_corner_strength_and_second_peak_need_patches_inside_the_image() -> None:
    with pytest.raises(ValueError, match="expected a patch of half-width 10 inside the image"):
        compute_second_peak(pattern(0), [5.0, 40.0], 10, 12.0)
    with pytest.raises(ValueError, match="expected patches of half-width 10 inside the image"):
        measure_corner_strengths(pattern(0), [[5.0, 40.0]], 10)
