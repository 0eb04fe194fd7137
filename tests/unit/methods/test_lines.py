"""The line finder's edges: empty, malformed and extreme arguments."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.perception.locate_camera import remove_duplicates
from knowledge_sources.methods.features import find_lines


def square() -> np.ndarray:
    image = np.full((64, 80), 40, np.uint8)
    image[16:48, 20:60] = 200
    return image


def test_no_predictions_find_nothing() -> None:
    assert len(find_lines(square(), [])) == 0
    assert len(find_lines(square(), np.zeros((0, 2, 2)))) == 0


def test_invisible_and_pointlike_predictions_find_nothing_and_keep_the_numbering() -> None:
    predicted = np.array([[[np.nan] * 2] * 2, [[30.0, 30.0]] * 2, [[22.0, 17.0], [58.0, 17.0]]])
    found = find_lines(square(), predicted)
    assert set(found.predicted.tolist()) == {2}


def test_predictions_outside_the_image_find_nothing() -> None:
    assert len(find_lines(square(), [[[500.0, 500.0], [600.0, 600.0]]])) == 0


def test_a_prediction_that_runs_to_the_horizon_costs_no_more_than_the_image() -> None:
    found = find_lines(square(), [[[-1e9, 17.0], [1e9, 17.0]]], min_length_px=20.0)
    assert len(found) == 1
    np.testing.assert_allclose(found.segments_px[0, :, 1], 15.5, atol=0.05)


def test_both_edges_of_a_thin_stripe_are_found_with_opposite_signs() -> None:
    image = np.full((64, 64), 180, np.uint8)
    image[:, 30:36] = 60
    found = find_lines(image, [[[33.0, 60.0], [33.0, 4.0]]])
    order = np.argsort(found.segments_px[:, :, 0].mean(axis=1))
    np.testing.assert_allclose(found.segments_px[order, :, 0].mean(axis=1), [29.5, 35.5], atol=0.1)
    assert np.sign(found.contrast[order]).tolist() == [-1.0, 1.0]


def test_the_same_image_gives_the_same_lines_as_bytes_and_as_floats() -> None:
    a, b = find_lines(square()), find_lines(square().astype(float))
    np.testing.assert_array_equal(a.segments_px, b.segments_px)


def test_an_edge_in_two_bands_is_found_twice_and_is_one_distinct_edge() -> None:
    predicted = np.array([[[20.0, 18.0], [59.0, 18.0]], [[59.0, 13.0], [20.0, 13.0]]])
    found = find_lines(square(), predicted, min_length_px=20.0)
    assert sorted(found.predicted.tolist()) == [0, 1]
    once = remove_duplicates(found)
    assert len(once) == 1
    assert once.lengths_px[0] == found.lengths_px.max()


def test_both_edges_of_a_thin_stripe_are_distinct() -> None:
    image = np.full((64, 64), 180, np.uint8)
    image[:, 30:34] = 60
    found = find_lines(image, [[[33.0, 60.0], [33.0, 4.0]]])
    assert len(remove_duplicates(found, offset_px=6.0)) == 2


def test_take_keeps_every_field_together() -> None:
    found = find_lines(square())
    some = found.take([1])
    assert len(some) == 1
    assert some.contrast[0] == found.contrast[1]
    assert some.sigma_offset_px[0] == found.sigma_offset_px[1]


@pytest.mark.parametrize("image", [np.zeros(5), np.zeros((4, 4, 3)), np.zeros((1, 9))])
def test_an_image_must_be_grey_and_two_dimensional(image: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"expected a grey image of shape \(h, w\)"):
        find_lines(image)


def test_predictions_must_be_segments() -> None:
    with pytest.raises(ValueError, match=r"expected predicted lines of shape \(m, 2, 2\), got \(3, 4\)"):
        find_lines(square(), np.zeros((3, 4)))


def test_limits_must_be_positive() -> None:
    with pytest.raises(ValueError, match="expected positive band_px and min_length_px"):
        find_lines(square(), band_px=0.0)
