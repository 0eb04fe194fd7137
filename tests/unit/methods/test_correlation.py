"""Template correlation at the border, and with arguments that make no sense."""

from __future__ import annotations

import numpy as np
import pytest

from knowledge_sources.methods.features import correlate, extract_template


def scene() -> np.ndarray:
    rng = np.random.default_rng(5)
    return np.kron(rng.integers(20, 230, (16, 20)), np.ones((5, 5))).astype(np.uint8)


def test_a_patch_that_leaves_the_image_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a patch of half-width 8 inside 100 x 80 px"):
        extract_template(scene(), (5.0, 40.0), 8)


@pytest.mark.parametrize("centre", [(8.0, 8.0), (91.0, 71.0), (8.0, 71.0)])
def test_a_patch_in_the_corner_of_the_image_is_found(centre: tuple[float, float]) -> None:
    found = correlate(extract_template(scene(), centre, 8), scene(), np.rint(centre), 6.0)
    assert found is not None
    np.testing.assert_allclose(found.position_px, centre, atol=0.02)


def test_a_prediction_far_outside_gives_none() -> None:
    template = extract_template(scene(), (40.0, 40.0), 8)
    assert correlate(template, scene(), (300.0, 40.0), 10.0) is None
    assert correlate(template, scene(), (40.0, -30.0), 10.0) is None


def test_a_place_at_the_edge_of_the_window_is_marked() -> None:
    template = extract_template(scene(), (40.0, 40.0), 8)
    inside = correlate(template, scene(), (41.0, 40.0), 5.0)
    outside = correlate(template, scene(), (47.0, 40.0), 5.0)
    assert inside is not None
    assert outside is not None
    assert not inside.at_border
    assert outside.peak < 0.9


def test_a_window_of_one_place_has_no_second_peak() -> None:
    template = extract_template(scene(), (40.0, 40.0), 8)
    image = scene()[32:49, 32:49]
    found = correlate(template, image, (8.0, 8.0), 4.0)
    assert found is not None
    assert found.peak == pytest.approx(1.0, abs=1e-4)
    assert found.second_peak == -1.0
    assert found.at_border


def test_a_black_image_correlates_with_nothing() -> None:
    template = extract_template(scene(), (40.0, 40.0), 8)
    found = correlate(template, np.zeros((80, 100), np.uint8), (40.0, 40.0), 6.0)
    assert found is not None
    assert found.peak <= 0.0 or found.peak < 0.5


@pytest.mark.parametrize(("scale", "search"), [(0.1, 5.0), (9.0, 5.0), (1.0, 0.0)])
def test_scale_and_search_have_limits(scale: float, search: float) -> None:
    template = extract_template(scene(), (40.0, 40.0), 8)
    with pytest.raises(ValueError, match="expected a"):
        correlate(template, scene(), (40.0, 40.0), search, scale=scale)


def test_a_prediction_must_be_finite() -> None:
    template = extract_template(scene(), (40.0, 40.0), 8)
    with pytest.raises(ValueError, match="expected a finite prediction"):
        correlate(template, scene(), (np.nan, 40.0), 5.0)


def test_bytes_and_floats_agree() -> None:
    template = extract_template(scene(), (40.3, 40.1), 8)
    a = correlate(template, scene(), (41.0, 41.0), 5.0)
    b = correlate(template, scene().astype(float), (41.0, 41.0), 5.0)
    assert a is not None
    assert b is not None
    np.testing.assert_array_equal(a.position_px, b.position_px)
