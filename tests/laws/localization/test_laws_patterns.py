"""Lines in a pattern that the model does not have tell nothing of a place (:func:`find_distinct`)."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from knowledge_sources.methods.verification import (
    LINE_TOLERANCE_PX,
    LINE_TOLERANCE_RAD,
    MIN_COVERED_FRACTION,
    compute_coverage,
    find_distinct,
)
from knowledge_sources.methods.verification.line_check import MAX_PATTERN_PART, PATTERN_REACH_PX, PATTERN_STEP_PX

Floats = NDArray[np.float64]
TOLERANCES = LINE_TOLERANCE_PX, LINE_TOLERANCE_RAD
some = settings(max_examples=40, deadline=None)
angles, places = st.floats(-3.1, 3.1), st.floats(150.0, 350.0)


def draw_line(x: float, y: float, angle: float, length: float = 120.0) -> Floats:
    """(2, 2) about a middle."""
    half, middle = 0.5 * length * np.array([np.cos(angle), np.sin(angle)]), np.array([x, y])
    return np.stack([middle - half, middle + half])


def lay_beside(line: Floats, aside_px: Floats) -> Floats:
    """(n, 2, 2) the same line at so many distances aside."""
    along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    return np.asarray(line + aside_px[:, None, None] * np.array([-along[1], along[0]]))


@some
@given(places, places, angles, st.floats(2.0, 5.0))
def test_a_line_among_stripes_tells_nothing_and_the_same_line_alone_does(
    x: float, y: float, angle: float, step_px: float
) -> None:
    line = draw_line(x, y, angle)
    stripes = lay_beside(line, np.arange(-60.0, 60.0, step_px))
    assert not find_distinct(line[None], stripes)[0]
    assert find_distinct(line[None], line[None])[0]
    assert find_distinct(line[None], np.zeros((0, 2, 2)))[0]


@some
@given(places, places, angles, st.floats(3.0, 6.0))
def test_stripes_that_the_model_has_are_no_pattern(x: float, y: float, angle: float, step_px: float) -> None:
    """The panes of a window, the boards of a shelf: all are expected, and all are found."""
    stripes = lay_beside(draw_line(x, y, angle), np.arange(-30.0, 31.0, step_px))
    assert find_distinct(stripes, stripes).all()


@some
@given(places, places, angles, st.floats(0.2, 1.3))
def test_stripes_across_a_line_take_nothing_from_it(x: float, y: float, angle: float, turned: float) -> None:
    line = draw_line(x, y, angle)
    across = lay_beside(draw_line(x, y, angle + turned), np.arange(-60.0, 60.0, 4.0))
    assert find_distinct(line[None], np.concatenate([across, line[None]]))[0]


@some
@given(st.integers(0, 2**32 - 1), st.integers(0, 80))
def test_it_is_what_counting_place_by_place_says_and_the_mirror_and_the_order_change_nothing(
    seed: int, count: int
) -> None:
    rng = np.random.default_rng(seed)
    lines = rng.uniform(50.0, 450.0, (6, 2, 2))
    lines[rng.random(6) < 0.2] = np.nan
    near = lines[rng.integers(0, 6, count)] + rng.normal(0.0, 12.0, (count, 1, 2))
    segments = near[~np.isnan(near).any(axis=(1, 2))]
    found = find_distinct(lines, segments)
    steps = np.arange(PATTERN_REACH_PX[0], PATTERN_REACH_PX[1] + 1e-9, PATTERN_STEP_PX)
    whole = lines[~np.isnan(lines).any(axis=(1, 2))]
    for line, distinct in zip(lines, found, strict=True):
        if np.isnan(line).any():
            assert distinct  # not in view: nothing covers it
            continue
        beside = lay_beside(line, np.concatenate([-steps, steps]))
        parts = [np.mean(compute_coverage(beside, by, *TOLERANCES) >= MIN_COVERED_FRACTION)
                 for by in (segments, whole)]
        assert distinct == (parts[0] - parts[1] <= MAX_PATTERN_PART)
    order = rng.permutation(len(segments))
    mirror = np.array([-1.0, 1.0])
    assert np.array_equal(found, find_distinct(lines, segments[order]))
    assert np.array_equal(found, find_distinct(lines * mirror, segments * mirror))
