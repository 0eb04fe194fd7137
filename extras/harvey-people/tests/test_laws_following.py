"""Laws of following: who walks is surely followed, what stands never walks, and how the way ahead is judged by it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harvey_people.behaving.meeting import THINKS_S, find_speed, measure_meeting, plan_straight
from harvey_people.behaving.passing import find_way, shift
from harvey_people.seeing.following import GATE, MAX_UNSEEN_S, TURNS_M2_PER_S3, WALK_M_PER_S, follow, predict
from harvey_people.seeing.mover import Mover
from harvey_people.seeing.sightings import SIDE_M, Sighting, is_seen_free, list_sightings
from world_models.actuator import ActuatorModel
from world_models.entries import FreeFloor, Leg
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


def test_what_stands_becomes_a_thing_and_who_pauses_does_not() -> None:
    """What was never seen to walk is known to stand after two seconds; who walked is so after four more."""
    assert watch([(1.0, 0.0)]).may_go_on and not watch([(1.0, 0.0)] * 6).may_go_on
    ways = [(0.4 * k, 0.0) for k in range(8)]
    assert watch([*ways, *[ways[-1]] * 6]).may_go_on
    assert not watch([*ways, *[ways[-1]] * 24]).may_go_on


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


HERE, BORNE = Pose2(0.0, 0.0, 0.0), 0.09
LEG = Leg("PlanSketch-1", 0, 0.0, 0.0, 8.0, 0.0, 0.1)


@pytest.mark.parametrize(("mover", "goes"), [
    (walker(1.6, 0.0, -1.0, 0.0), False),   # comes towards it
    (walker(0.8, 1.2, 0.0, -1.0), False),   # crosses before it
    (walker(1.5, 0.0, 1.4, 0.0), True),     # walks away
    (walker(-2.0, 1.5, 0.0, 1.2), True),    # behind it, and away
    (walker(-2.0, 0.0, 1.4, 0.0), True),    # comes from behind: its own motion adds nothing to that
    (walker(7.0, 0.0, -1.0, 0.0), True),    # far off
])
def test_it_goes_where_nobody_is_met(mover: Mover, goes: bool) -> None:
    speed = find_speed([mover], HERE, 0.0, 0.35, WALKS, mover.at_s + THINKS_S, BORNE)
    assert (speed == WALKS.speed_m_per_s) is goes


def meet(*movers: Mover, heading_rad: float = 0.0, move_m: float = 0.72, speed: float = 0.6) -> list[float]:
    """How probably they are met up to each moment of a move from the origin."""
    clearance, _ = measure_meeting(movers, plan_straight(HERE, heading_rad, move_m, 0.35, speed, movers[0].at_s))
    return clearance.p.tolist()


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), ANGLES)
def test_a_mirrored_meeting_is_as_probable_and_one_more_never_makes_it_less(x: float, y: float, way: float) -> None:
    one = walker(x, y, math.cos(way), math.sin(way))
    other = walker(x, -y, math.cos(way), -math.sin(way))
    assert meet(one) == pytest.approx(meet(other), abs=2e-3)
    assert np.all(np.array(meet(one, other)) >= np.array(meet(one)) - 1e-9)


@pytest.mark.parametrize("speed", [0.3, 0.6])
def test_what_is_met_is_as_probable_as_drawn_people_touch_it(speed: float) -> None:
    """Of 4000 who come as the mover says, so many touch the front as told, each by the square of the cosine."""
    mover, rng, step_s = walker(1.6, 0.3, -0.9, 0.0), np.random.default_rng(1), 0.02
    state = rng.multivariate_normal(mover.state, np.array(mover.covariance), 4000)
    kicks, harm = math.sqrt(TURNS_M2_PER_S3 * step_s), np.zeros(len(state))
    for k in range(round(1.2 / step_s)):
        off = state[:, :2] - (k * step_s * speed, 0.0)
        away_m = np.hypot(*off.T)
        touches = (away_m < 0.65) & (harm == 0.0)
        harm[touches] = np.maximum(1e-9, off[touches, 0] / away_m[touches]) ** 2
        state[:, :2] += step_s * state[:, 2:]
        state[:, 2:] += rng.normal(0.0, kicks, (len(state), 2))
    assert meet(mover, move_m=1.2 * speed, speed=speed)[-1] == pytest.approx(float(harm.mean()), abs=0.05)


@pytest.mark.parametrize("heading_rad", [0.5, 2.0, math.pi])
def test_a_way_is_found_however_the_robot_faces(heading_rad: float) -> None:
    near = walker(1.3, 0.0, -1.0, 0.0)
    args = LEG, Pose2(0.0, 0.0, heading_rad), 0.35, WALKS, near.at_s, BORNE, lambda aim: True
    way = find_way([near], *args)
    assert way is None or way.speed_m_per_s <= WALKS.speed_m_per_s


@given(st.floats(0.5, 3.0), st.floats(-1.5, 1.5), st.floats(-1.4, 1.4), st.floats(-1.4, 1.4))
def test_what_is_chosen_is_borne_and_to_nobody_it_does_nothing(x: float, y: float, vx: float, vy: float) -> None:
    """The expected harm of the way that is chosen is no greater than that of a certain touch at the speed borne."""
    mover = walker(x, y, vx, vy)
    given_ = (0.35, WALKS, mover.at_s, BORNE, lambda aim: True)
    way = find_way([mover], LEG, HERE, *given_)
    if way is None:
        assert find_speed([mover], HERE, 0.0, 0.35, WALKS, mover.at_s + THINKS_S, BORNE) == WALKS.speed_m_per_s
    elif way.speed_m_per_s > 0.0:
        assert way.leg == shift(LEG, way.aside_m) and way.who is mover
        heading_rad = math.atan2(way.aside_m, 1.2)
        turns_s = 0.4 + abs(heading_rad) / math.radians(45.0) if way.aside_m else 0.0
        move = plan_straight(HERE, heading_rad, 1.2 * way.speed_m_per_s, 0.35, way.speed_m_per_s,
                             mover.at_s + THINKS_S + turns_s)
        met, _ = measure_meeting([mover], move)
        assert np.all(met.p[met.at_m < 1.2 * way.speed_m_per_s - 1e-6] * way.speed_m_per_s**2 <= BORNE**2 + 1e-9)
    assert find_way([], LEG, HERE, *given_) is None


def test_people_are_passed_on_the_right_where_there_is_room_and_else_waited_for() -> None:
    comes = walker(1.5, 0.0, -1.0, 0.0)
    given_ = ([comes], LEG, HERE, 0.35, WALKS, comes.at_s, BORNE)
    right, wall = find_way(*given_, lambda aim: True), find_way(*given_, lambda aim: aim[1] > -0.1)
    assert right is not None and right.aside_m < 0.0 < right.speed_m_per_s
    assert wall is not None and wall.aside_m > 0.0
    near = walker(1.3, 0.0, -1.0, 0.0)
    shut = find_way([near], LEG, HERE, 0.35, WALKS, near.at_s, BORNE, lambda aim: False)
    assert shut is not None and shut.speed_m_per_s == shut.aside_m == 0.0
