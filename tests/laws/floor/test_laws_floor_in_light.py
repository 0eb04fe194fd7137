"""The floor in light and shade and in tinted pictures: what stands on it is told from what does not."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from knowledge_sources.methods.floor.appearance import compute_appearance, default_covariance, find_floor_in_shade
from knowledge_sources.methods.floor.model_floor import ModelFloor
from knowledge_sources.methods.floor.see_floor import find_unlike

FLOOR = np.array([110.0, 104.0, 98.0])
SHAPE = (90, 160)
NOWHERE = np.full(SHAPE, np.inf, np.float32)
MODEL = ModelFloor(np.zeros(SHAPE, np.int64), FLOOR[None] / 255.0, np.ones(SHAPE, bool), NOWHERE, NOWHERE)


def shaded(gain: NDArray[np.float64]) -> NDArray[np.float64]:
    rng = np.random.default_rng(0)
    return np.clip(FLOOR * gain[..., None] + rng.normal(0.0, 0.35, (*SHAPE, 3)), 0.0, 255.0)


@settings(deadline=None, max_examples=30)
@given(st.floats(0.4, 0.9), st.floats(12.0, 60.0), st.floats(-3.1, 3.1))
def test_what_darkens_little_by_little_is_floor_and_a_thing_in_it_is_not(
    dark: float, width_px: float, direction: float
) -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    along = (x - 80) * math.cos(direction) + (y - 45) * math.sin(direction)
    picture = shaded(dark + (1.0 - dark) / (1.0 + np.exp(along / width_px)))
    mean, everywhere = compute_appearance(FLOOR), np.ones(SHAPE, bool)
    assert find_floor_in_shade(compute_appearance(picture), everywhere, mean, default_covariance()).mean() > 0.97
    picture[40:60, 70:95] *= 0.5
    with_thing = find_floor_in_shade(compute_appearance(picture), everywhere, mean, default_covariance())
    assert with_thing[42:58, 72:93].mean() < 0.05, "its own edges part it from the floor"
    assert with_thing[:38].mean() > 0.97


@settings(deadline=None, max_examples=30)
@given(st.floats(0.75, 1.3), st.floats(0.75, 1.3), st.floats(0.3, 1.5))
def test_a_tinted_picture_has_floor_and_a_thing_on_it(red: float, blue: float, gain: float) -> None:
    picture = np.clip(shaded(np.full(SHAPE, gain)) * (red, 1.0, blue), 0.0, 255.0)
    picture[40:60, 70:95] = np.clip(picture[40:60, 70:95] * (0.45, 0.3, 0.3), 0.0, 255.0)
    model = MODEL
    unlike, tells, _ = find_unlike(picture.astype(np.uint8), model)
    if gain * 110.0 * max(red, 1.0, blue) < 250.0 and tells.any():
        assert unlike[43:57, 73:92].mean() > 0.95
        assert unlike[:38].mean() < 0.02


@settings(deadline=None, max_examples=20)
@given(st.integers(95, 140), st.floats(0.35, 0.55), st.floats(0.35, 0.55))
def test_a_thing_that_fills_the_picture_at_once_is_not_the_floor_in_other_light(
    width: int, red: float, blue: float
) -> None:
    model = MODEL
    picture = shaded(np.ones(SHAPE))
    _, _, light = find_unlike(picture.astype(np.uint8), model)
    assert light is not None and np.allclose(light, 0.0, atol=0.1)
    picture[:, :width] = np.clip(picture[:, :width] * (red, 0.8, blue), 0.0, 255.0)
    unlike, _, _ = find_unlike(picture.astype(np.uint8), model, light)
    assert unlike[:, : width - 3].mean() > 0.95
    assert unlike[:, width + 3 :].mean() < 0.02


@settings(deadline=None, max_examples=10)
@given(st.floats(0.8, 1.25), st.floats(0.8, 1.25))
def test_white_balance_that_changes_little_by_little_is_followed(red: float, blue: float) -> None:
    model = MODEL
    light = None
    for part in np.linspace(0.0, 1.0, 12):
        gains = (red**part, 1.0, blue**part)
        unlike, tells, light = find_unlike((shaded(np.ones(SHAPE)) * gains).astype(np.uint8), model, light)
        assert tells.all() and unlike.mean() < 0.02


@settings(deadline=None, max_examples=20)
@given(st.integers(10, 60), st.integers(0, 30), st.floats(0.75, 1.25))
def test_what_hides_most_of_the_picture_is_not_taken_for_the_floor(left: int, above: int, gain: float) -> None:
    """A grey patch on the lens, larger than the floor that is left: the floor beside it is floor still."""
    picture = shaded(np.ones(SHAPE))
    hidden = np.zeros(SHAPE, bool)
    hidden[above:, left:] = True
    picture[hidden] = 104.0 * gain
    model = MODEL.behind(hidden)
    unlike, tells, _ = find_unlike(picture.astype(np.uint8), model)
    assert not tells[hidden].any() and tells[~hidden].all()
    assert unlike[:, : left - 2].mean() < 0.02
