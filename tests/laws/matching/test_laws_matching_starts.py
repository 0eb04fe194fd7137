"""Laws of the matching's evidence, against scipy's distributions, and of its starts, on models that were moved."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import lomax, norm

from knowledge_sources.methods.matching import (
    CHANCE_EXPONENT,
    CHANCE_LENGTH_PX,
    HOUGH_CELLS,
    HOUGH_STEP_RAD,
    HOUGH_WINDOW_PX,
    build_line_table,
)
from knowledge_sources.methods.matching.image_matching import _suppress_non_maxima, find_hough_peaks
from knowledge_sources.methods.matching.search import build_likelihood_terms

CENTRE = np.array([256.0, 256.0])
lengths_px = st.lists(st.floats(5.0, 400.0), min_size=1, max_size=10).map(np.array)


@given(lengths=lengths_px, sigma_px=st.floats(0.2, 5.0), start_px=st.floats(1.0, 40.0), part=st.floats(0.0, 1.0))
@settings(max_examples=100, deadline=None)
def test_terms_are_minus_log_likelihoods(
    lengths: np.ndarray, sigma_px: float, start_px: float, part: float
) -> None:
    """Of ends by a normal distribution, of what clutter covers by a Lomax distribution, of a start by its error."""
    terms = build_likelihood_terms(lengths, 3, sigma_px, start_px)
    off = 1.7 * sigma_px
    np.testing.assert_allclose(
        terms.end_weights * off**2, norm.logpdf(0.0, scale=sigma_px) - norm.logpdf(off, scale=sigma_px))
    every = np.arange(len(lengths))
    clutter = lomax(CHANCE_EXPONENT, scale=CHANCE_LENGTH_PX)
    np.testing.assert_allclose(
        terms.compute_omission(np.full(len(lengths), part), every),
        clutter.logsf((1.0 - part) * lengths) - clutter.logsf(lengths), atol=1e-9)
    shift, turn, growth = terms.anchor_weights
    half_px = 0.5 * float(lengths.max())  # so far out, a turn or a growth moves as much as a shift
    one_sigma = norm.logpdf(0.0) - norm.logpdf(1.0)
    levers = np.array([1.0, half_px, half_px])
    np.testing.assert_allclose(np.array([shift, turn, growth]) * (start_px / levers) ** 2, one_sigma)


@given(seed=st.integers(0, 2**32 - 1), u=st.floats(-0.95, 0.95), v=st.floats(-0.95, 0.95), turn=st.floats(-0.25, 0.25))
@settings(max_examples=40, deadline=None)
def test_a_model_moved_within_the_window_is_found_where_it_is(seed: int, u: float, v: float, turn: float) -> None:
    """In any direction, also where lines that lie askew are moved further across than either window is wide."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, math.pi) + np.arange(12) * math.pi / 12
    middle, half = rng.uniform(-20.0, 20.0, (12, 1, 2)), rng.uniform(40.0, 80.0, 12)
    along = half[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lines = middle + np.stack([-along, along], axis=1)
    shift = HOUGH_WINDOW_PX * np.array([u, v])
    c, s = math.cos(turn), math.sin(turn)
    moved = lines @ np.array([[c, s], [-s, c]]) + shift
    best = find_hough_peaks(
        build_line_table(lines + CENTRE, CENTRE), build_line_table(moved + CENTRE, CENTRE), 1)[0]
    cell_px = 2.0 * HOUGH_WINDOW_PX / (HOUGH_CELLS - 1)
    assert np.abs(np.array(best.shift_px) - shift).max() <= 2.0 * cell_px
    assert abs(best.turn_rad - turn) <= 1.5 * HOUGH_STEP_RAD
    normals = build_line_table(moved, np.zeros(2)).normals
    is_within = np.abs(normals @ shift) <= HOUGH_WINDOW_PX
    assert best.votes >= 0.5 * np.sum(2.0 * half[is_within])


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 6), is_even=st.booleans())
@settings(max_examples=25, deadline=None)
def test_peaks_are_the_highest_cells_that_are_apart(seed: int, count: int, is_even: bool) -> None:
    """Against all cells sorted; of equal cells the one of the smaller motion comes first."""
    turns, axis, window_px, window_rad = np.linspace(-0.3, 0.3, 9), np.linspace(-40.0, 40.0, 9), 40.0, 0.3
    rng = np.random.default_rng(seed)
    scores = rng.integers(0, 3, (9, 9, 9)).astype(float) if is_even else rng.uniform(0.0, 100.0, (9, 9, 9))
    motions = (np.abs(turns)[:, None, None] / window_rad
               + np.hypot(axis[None, :, None], axis[None, None, :]) / window_px)
    ranks = scores - 1e-6 * motions
    found = _suppress_non_maxima(scores, turns, axis, count, window_px, window_rad)
    taken: list[np.ndarray] = []
    for cell in found:
        apart = np.ones(scores.shape, bool)
        for t, v, u in taken:
            apart[max(t - 2, 0) : t + 3, max(v - 2, 0) : v + 3, max(u - 2, 0) : u + 3] = False
        assert apart[tuple(cell)]
        assert ranks[tuple(cell)] == np.max(ranks[apart])
        taken.append(cell)
    assert len(found) == count
