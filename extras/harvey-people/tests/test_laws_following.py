"""Laws of following: who walks is surely followed, what stands never walks, and how the way ahead is judged by it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harvey_people.following import GATE, MAX_UNSEEN_S, WALK_M_PER_S, follow, predict
from harvey_people.meeting import may_go, measure_meeting
from harvey_people.mover import Mover
from harvey_people.sightings import SIDE_M, Sighting, is_seen_free, list_sightings
from world_models.actuator import ActuatorModel
from world_models.entries import FreeFloor
from world_models.frames import Pose2

WALKS, EACH_S = ActuatorModel(), 0.4
ANGLES = st.floats(-math.pi, math.pi)


def floor(at_s: float, far: tuple[float, ...] = (), ends: tuple[str, ...] = ()) -> FreeFloor:
    """A reading at the origin in as many directions round the circle."""
    count = len(far)
    bearings = tuple(math.tau * k / max(1, count - 1) - math.pi for k in range(count))
    return FreeFloor("ranges", "hall", 0.0, 0.0, bearings, (0.35,) * count, far, ends, (0.02,) * count,  # type: ignore
                     (), at_s)


def seen(x: float, y: float, sigma_m: float = 0.05) -> Sighting:
    return Sighting(np.array([x, y]), (sigma_m**2 + SIDE_M**2) * np.eye(2), "a law")


def watch(places: list[tuple[float, float]], each_s: float = EACH_S) -> Mover:
    """Who is followed by these sightings, one after the other."""
    known: list[Mover] = []
    for number, (x, y) in enumerate(places):
        known = [step.mover for step in follow(known, [seen(x, y)], floor(number * each_s), 0)]
    return known[0]


@settings(deadline=None, max_examples=40)
@given(ANGLES, st.floats(0.8, 1.6), st.integers(0, 10**6))
def test_who_walks_is_surely_followed(way_rad: float, speed: float, seed: int) -> None:
    """After a way of 2.4 m it is sure; the velocity is right to three standard deviations and 0.3 m/s."""
    rng, count = np.random.default_rng(seed), 2 + math.ceil(2.4 / (speed * EACH_S))
    velocity = speed * np.array([math.cos(way_rad), math.sin(way_rad)])
    found = watch([tuple(k * EACH_S * velocity + rng.normal(0.0, 0.05, 2)) for k in range(count)])
    assert found.is_moving and found.sights == count
    sigma = math.sqrt(found.covariance[2][2])
    assert np.all(np.abs(found.state[2:] - velocity) < 3.0 * sigma + 0.3) and sigma < WALK_M_PER_S


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.floats(0.1, 1.3))
def test_what_stands_never_walks(seed: int, each_s: float) -> None:
    """Whatever side of it is seen: its sightings lie within the half width that is assumed, and a little noise."""
    rng = np.random.default_rng(seed)
    places = [tuple(rng.uniform(-SIDE_M, SIDE_M, 2) + rng.normal(0.0, 0.03, 2)) for _ in range(12)]
    assert not any(watch(places[:count], each_s).is_moving for count in range(1, 13))


@given(st.permutations(range(3)))
def test_sightings_are_given_to_whom_they_fit_in_any_order(order: list[int]) -> None:
    ends = [(0.0, 0.0), (2.0, 0.0), (0.0, 3.0)]
    known = [step.mover for step in follow([], [seen(*end) for end in ends], floor(0.0), 0)]
    now = follow(known, [seen(ends[k][0] + 0.1, ends[k][1]) for k in order], floor(0.2), 3)
    assert [step.before for step in now] == [0, 1, 2]
    assert [step.mover.sights for step in now] == [2, 2, 2]
    far = follow(known[:1], [seen(0.0, 10.0)], floor(0.2), 3)
    assert [(step.before, step.mover.sights) for step in far] == [(0, 1), (None, 1)] and GATE < 12.0
    assert far[1].mover.name == "mover-4"


def test_who_is_not_seen_is_gone_where_the_floor_is_seen_free_or_after_a_while() -> None:
    known = watch([(1.0, 0.0)])
    hidden, free = floor(0.2), floor(0.2, (3.0,) * 121, ("sight",) * 121)
    assert [step.mover.status for step in follow([known], [], hidden, 1)] == ["may move"]
    assert is_seen_free(free, np.array([1.0, 0.0]), 0.3) and not is_seen_free(free, np.array([2.9, 0.0]), 0.3)
    assert [step.mover.status for step in follow([known], [], free, 1)] == ["gone"]
    assert [step.mover.status for step in follow([known], [], floor(MAX_UNSEEN_S + 0.1), 1)] == ["gone"]


@given(st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_doubt_grows_and_predicting_twice_is_predicting_once(one_s: float, more_s: float) -> None:
    start = watch([(0.0, 0.0), (0.4, 0.1), (0.8, 0.2)])
    twice, once = predict(predict(start, start.at_s + one_s), start.at_s + one_s + more_s), predict(
        start, start.at_s + one_s + more_s)
    assert np.allclose(twice.state, once.state, atol=1e-3)
    assert np.allclose(twice.covariance, once.covariance, atol=1e-3)
    assert once.sigma_m >= start.sigma_m - 1e-6


@given(ANGLES, st.floats(0.8, 3.0))
def test_an_echo_that_the_model_lacks_is_a_sighting_where_it_is(bearing: float, away_m: float) -> None:
    count = 121
    bearings = np.array(floor(0.0, (1.0,) * count).bearings_rad)
    near = np.abs(np.remainder(bearings - bearing + math.pi, math.tau) - math.pi) < math.radians(8.0)
    far = tuple(np.where(near, away_m, 4.0).tolist())
    (found,) = list_sightings(floor(0.0, far, tuple(np.where(near, "thing", "model").tolist())))
    off = found.place - (away_m + 0.1) * np.array([math.cos(bearing), math.sin(bearing)])
    assert float(off @ np.linalg.solve(found.covariance, off)) < 4.0
    assert not list_sightings(floor(0.0, (4.0,) * count, ("model",) * count))


def walker(x: float, y: float, vx: float, vy: float) -> Mover:
    """One who surely walks, seen just now."""
    return watch([(x + k * EACH_S * vx, y + k * EACH_S * vy) for k in range(-9, 1)])


@pytest.mark.parametrize(("mover", "goes"), [
    (walker(1.2, 0.0, -1.0, 0.0), False),   # comes towards it
    (walker(0.6, 1.2, 0.0, -1.0), False),   # crosses before it
    (walker(1.5, 0.0, 1.4, 0.0), True),     # walks away
    (walker(-2.0, 1.5, 0.0, 1.2), True),    # behind it, and away
    (walker(6.0, 0.0, -1.0, 0.0), True),    # far off
])
def test_it_goes_where_nobody_is_met(mover: Mover, goes: bool) -> None:
    clearance, (p,) = measure_meeting([mover], Pose2(0.0, 0.0, 0.0), 0.0, 0.6, 0.35, 0.6, mover.at_s)
    assert may_go(clearance, 0.6, WALKS) is goes
    assert 0.0 <= p <= 1.0 and bool(p < 0.01) is goes


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), ANGLES)
def test_a_mirrored_meeting_is_as_probable_and_one_more_never_makes_it_less(x: float, y: float, way: float) -> None:
    one = walker(x, y, math.cos(way), math.sin(way))
    other = walker(x, -y, math.cos(way), -math.sin(way))
    here, args = Pose2(0.0, 0.0, 0.0), (0.0, 0.6, 0.35, 0.6, one.at_s)
    clear, (p,) = measure_meeting([one], here, *args)
    _, (mirrored,) = measure_meeting([other], here, *args)
    both, _ = measure_meeting([one, other], here, *args)
    assert p == pytest.approx(mirrored, abs=2e-3)
    assert np.all(both.p >= clear.p - 1e-9)
