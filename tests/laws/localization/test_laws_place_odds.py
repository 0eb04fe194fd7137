"""Laws of the odds of where the robot was told to be: a prior that is counted once, and never against what is so."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from knowledge_sources.methods.belief import MIN_P_BELIEVED
from knowledge_sources.methods.localization import MAX_ALIKE_LOG_RATIO, P_STATED, compute_prior
from knowledge_sources.methods.localization.place_odds import compute_place_odds, is_within_reach
from world_models.frames import Pose2

logs = st.lists(st.floats(-30.0, 30.0), min_size=2, max_size=8)
shares = st.floats(0.01, 0.99)
small = st.floats(-0.5, 0.5)


@given(logs, st.lists(st.booleans(), min_size=8, max_size=8), st.lists(st.booleans(), min_size=8, max_size=8), shares)
def test_probabilities_sum_to_one(values: list[float], told: list[bool], alike: list[bool], p: float) -> None:
    n = len(values)
    odds = compute_place_odds(values, told[:n], alike[:n], p)
    assert math.isclose(sum(odds), 1.0) and all(0.0 <= o <= 1.0 for o in odds)


@given(logs, shares, st.lists(st.booleans(), min_size=8, max_size=8))
def test_they_are_bayes_rule_where_nothing_is_alike_by_the_model(
    values: list[float], p: float, _: list[bool]
) -> None:
    n = len(values)
    odds = compute_place_odds(values, [True, *[False] * (n - 1)], [False] * n, p)
    prior = np.array([p, *[(1.0 - p) / (n - 1)] * (n - 1)])
    joint = prior * np.exp(np.array(values) - max(values))
    assert np.allclose(odds, joint / joint.sum())


@given(logs, st.lists(st.booleans(), min_size=8, max_size=8), shares, shares)
def test_a_surer_telling_never_makes_the_told_place_less_likely(
    values: list[float], alike: list[bool], one: float, other: float
) -> None:
    n, low, high = len(values), min(one, other), max(one, other)
    told = [True, *[False] * (n - 1)]
    less, more = (compute_place_odds(values, told, alike[:n], p)[0] for p in (low, high))
    assert more >= less - 1e-12


@given(logs, shares)
def test_nothing_is_known_of_places_of_which_none_was_told(values: list[float], p: float) -> None:
    n = len(values)
    odds = compute_place_odds(values, [False] * n, [True] * n, p)
    weights = np.exp(np.array(values) - max(values))
    assert np.allclose(odds, weights / weights.sum())


@given(st.integers(2, 40), st.floats(-30.0, 30.0))
def test_twins_by_every_picture_are_left_to_the_prior_alone(twins: int, log: float) -> None:
    odds = compute_place_odds([log] * twins, [True, *[False] * (twins - 1)], [True] * twins, P_STATED)
    assert math.isclose(odds[0], P_STATED)
    assert odds[0] >= MIN_P_BELIEVED


@given(st.integers(2, 40), st.floats(0.5, 30.0))
def test_the_prior_alone_is_not_believed_where_the_pictures_speak_for_another(twins: int, log: float) -> None:
    for alike in (True, False):
        odds = compute_place_odds([0.0, log, *[0.0] * (twins - 2)], [True, *[False] * (twins - 1)], [alike] * twins,
                                  P_STATED)
        bare = math.log(odds[0] / odds[1])
        even = compute_place_odds([0.0] * twins, [True, *[False] * (twins - 1)], [alike] * twins, P_STATED)
        assert bare < math.log(even[0] / even[1])
    if twins == 2:
        assert odds[0] < MIN_P_BELIEVED


@given(st.floats(3.0, 30.0), st.sampled_from((-1.0, 1.0)))
def test_between_places_alike_by_the_model_only_so_much_is_no_chance(log: float, side: float) -> None:
    """For the told one as against it."""
    odds = compute_place_odds([side * log, 0.0], [True, False], [True, True], P_STATED)
    most = P_STATED / (1.0 - P_STATED) * math.exp(side * MAX_ALIKE_LOG_RATIO)
    assert odds[0] / odds[1] == pytest.approx(most)


@given(st.integers(0, 6))
def test_what_was_believed_and_led_astray_is_believed_less(times: int) -> None:
    assert math.isclose(compute_prior(0), P_STATED)
    assert compute_prior(times + 1) < compute_prior(times)
    assert compute_prior(1) < MIN_P_BELIEVED


@given(small, small, small, st.floats(0.001, 0.5), st.floats(1.0, 4.0))
def test_a_wider_covariance_reaches_no_less(x: float, y: float, turn: float, sigma: float, factor: float) -> None:
    pose, told, here = Pose2(x, y, turn), Pose2(0.0, 0.0, 0.0), np.zeros((3, 3))
    narrow, wide = (np.eye(3) * (sigma * f) ** 2 for f in (1.0, factor))
    assert is_within_reach(pose, here, told, wide) >= is_within_reach(pose, here, told, narrow)


@given(small, small, small, st.floats(0.01, 1.0), st.floats(0.01, 1.0))
def test_how_sure_the_place_is_reaches_as_far_as_how_surely_it_was_told(
    x: float, y: float, turn: float, one: float, other: float
) -> None:
    pose, told = Pose2(x, y, turn), Pose2(0.0, 0.0, 0.0)
    first, second = np.diag([one, one, 0.1]) ** 2, np.diag([other, other, 0.2]) ** 2
    assert is_within_reach(pose, first, told, second) == is_within_reach(pose, second, told, first)


def test_a_room_away_is_out_of_reach() -> None:
    narrow = np.diag([0.02, 0.02, 0.02]) ** 2
    assert is_within_reach(Pose2(0.05, -0.05, 0.03), narrow, Pose2(0.0, 0.0, 0.0), narrow)
    assert not is_within_reach(Pose2(4.4, 0.0, 0.0), narrow, Pose2(0.0, 0.0, 0.0), narrow)
    assert not is_within_reach(Pose2(0.0, 0.0, math.pi), narrow, Pose2(0.0, 0.0, 0.0), narrow)
