"""The scores of traced maps: against their definition, and on pictures drawn by hand."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from harvey_buildings.experiments.rosmaps_scores import (
    MapTruth,
    correlate_rooms,
    count_found,
    draw_beside,
    draw_rooms,
    read_truth,
)

LABELS = arrays(np.int32, (6, 7), elements=st.integers(0, 3))


def matthews(one: np.ndarray, other: np.ndarray) -> float:
    """The correlation of two sets of cells, as Pearson's of their indicators."""
    if one.std() == 0 or other.std() == 0:
        return 0.0
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1])


@settings(deadline=None)
@given(truth=LABELS, traced=LABELS)
def test_rooms_are_correlated_as_defined_over_the_best_pairing(truth: np.ndarray, traced: np.ndarray) -> None:
    rooms = [k for k in (1, 2, 3) if (truth == k).any()]
    if not rooms:
        return
    best = max(np.sum([matthews(truth == k, traced == j) for k, j in zip(rooms, order, strict=False)])
               for order in permutations((1, 2, 3), len(rooms)))
    assert correlate_rooms(truth, traced)[0] * len(rooms) == pytest.approx(best, abs=1e-9)


def test_the_same_rooms_by_other_numbers_correlate_fully() -> None:
    truth = np.array([[1, 1, 0, 2, 2], [1, 1, 0, 2, 2]], np.int32)
    assert correlate_rooms(truth, np.array([0, 2, 1], np.int32)[truth]) == pytest.approx((1.0, 1.0))
    assert correlate_rooms(truth, np.zeros_like(truth)) == (0.0, 0.0)


def test_each_opening_finds_one_doorway() -> None:
    truth = np.array([[0.0, 0.0], [0.3, 0.0], [5.0, 5.0]])
    assert count_found(truth, [np.array([0.1, 0.0])]) == 1
    assert count_found(truth, [np.array([0.1, 0.0]), np.array([0.2, 0.0]), np.array([5.0, 5.6])]) == 2
    assert count_found(truth, []) == 0


def test_a_line_across_a_doorway_is_the_truth_of_it(tmp_path: Path) -> None:
    plain = np.zeros((60, 100), np.uint8)
    plain[5:55, 5:45] = plain[5:55, 50:95] = plain[20:40, 45:50] = 255
    plain[42:54, 46:49] = 255  # a pocket in the wall is no doorway
    divided = plain.copy()
    divided[20:40, 45:50] = 0
    for name, picture in (("plain", plain), ("divided", divided)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture)
    truth = read_truth(tmp_path / "plain.png", tmp_path / "divided.png", 0.05)
    assert truth.rooms.max() == 2
    assert truth.doorways == pytest.approx(np.array([[47.5 * 0.05, 30.0 * 0.05]]))
    drawn = draw_rooms({"a": np.array([[5, 5], [45, 5], [45, 55], [5, 55]]) * 0.05,
                        "b": np.array([[50, 5], [95, 5], [95, 55], [50, 55]]) * 0.05}, (60, 100), 0.05)
    assert correlate_rooms(truth.rooms, drawn)[0] == pytest.approx(1.0)


def test_the_true_rooms_are_drawn_beside_the_traced(tmp_path: Path) -> None:
    """Outside is dark, doorways are red, and each room has one shade."""
    rooms = np.zeros((40, 60), np.int32)
    rooms[5:35, 5:55] = 1
    draw_beside(MapTruth(rooms, np.array([[1.5, 1.0]])), MapTruth(rooms, np.zeros((0, 2))), 0.05, tmp_path / "m.png")
    picture = cv2.imread(str(tmp_path / "m.png"))
    assert picture is not None and picture.shape == (40, 60 + 8 + 60, 3)
    assert picture[19, 30].tolist() == [0, 0, 255] and picture[19, 98].tolist() == picture[10, 10].tolist()
    assert picture[2, 2].max() < 30 < picture[10, 10].max() and (picture[:, 60:68] == 255).all()
