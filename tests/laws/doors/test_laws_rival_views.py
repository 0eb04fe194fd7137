"""Laws of the views that share what an opening shows: shut, open."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from knowledge_sources.methods.arrays import Floats, Ints
from knowledge_sources.methods.doors.leaf import MAX_RIVAL_BETTER
from knowledge_sources.methods.doors.rival_views import MIN_SURFACE_SAMPLES, Views, fit_views

SIDE = 16
ACROSS, HEIGHT_M = (axis.ravel() for axis in np.meshgrid((np.arange(SIDE) + 0.5) / SIDE, np.linspace(0.1, 1.9, SIDE)))
CASES = st.tuples(st.integers(0, 999), st.floats(0.2, 0.8), st.floats(0.15, 0.6))
"""Chance; where a wall begins, across; what is floor, of the height."""


def draw(seed: int, wall: float, foot_m: float) -> tuple[Ints, Floats, Floats]:
    """The surfaces beyond; an open view of them in any colors, told apart by 0.4 at least; and a leaf. (n, 3) each."""
    rng = np.random.default_rng(seed)
    surfaces = np.where(foot_m > HEIGHT_M, 2, (wall < ACROSS).astype(int))
    colors = rng.permutation(3)[:, None] * 0.5 + rng.uniform(-0.05, 0.05, (3, 3))
    light = np.outer(ACROSS - 0.5, np.ones(3)) * rng.uniform(-0.3, 0.3) + rng.normal(0.0, 0.01, (len(ACROSS), 3))
    return surfaces, 4.0 + colors[surfaces] + light, 4.2 + light


def fit(logs: Floats, surfaces: Ints) -> Views:
    return fit_views(logs, surfaces, ACROSS, HEIGHT_M)


@given(CASES)
def test_what_is_there_explains_best(case: tuple[int, float, float]) -> None:
    """Whatever the colors, and however the light falls off; as much better as what is told asks for."""
    surfaces, opened, leaf = draw(*case)
    seen = fit(opened, surfaces)
    assert seen.shut - seen.opened > MAX_RIVAL_BETTER
    shut = fit(leaf, surfaces)
    assert abs(shut.shut - shut.opened) <= MAX_RIVAL_BETTER


@given(CASES, st.floats(-2.0, 2.0))
def test_mirrored_or_in_any_light_it_is_the_same(case: tuple[int, float, float], gain: float) -> None:
    surfaces, opened, _ = draw(*case)
    seen = fit(opened, surfaces)
    assert fit(opened + gain, surfaces) == pytest.approx(seen, abs=1e-6)
    assert fit_views(opened, surfaces, 1.0 - ACROSS, HEIGHT_M) == pytest.approx(seen, abs=1e-6)


@pytest.mark.parametrize(("others", "is_told"), [(MIN_SURFACE_SAMPLES, True), (MIN_SURFACE_SAMPLES - 1, False)])
def test_with_one_surface_beyond_nothing_tells_the_views_apart(others: int, is_told: bool) -> None:
    surfaces = np.zeros(len(ACROSS), int)
    surfaces[:others] = 1
    logs = np.where(surfaces[:, None] == 1, 5.0, 4.0) * np.ones(3)
    assert (fit(logs, surfaces) != Views()) is is_told
