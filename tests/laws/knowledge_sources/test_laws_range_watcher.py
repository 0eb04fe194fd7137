"""Laws of the range watcher: the newest reading tells of free floor while the robot's place is known."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from generated_boards import Bench, all_reasons, effect_on, made, to_world
from harvey.testing import HALL, check_source, plain_robot
from knowledge_sources.methods.floor import see_ranges
from knowledge_sources.model.range_watcher import (
    MAX_BELIEF_SIGMA_M,
    MAX_EARLIER_READINGS,
    MAX_RANGE_AGE_S,
    RangeWatcher,
)
from knowledge_sources.settings import DEFAULT
from world_models.entries import FreeFloor, Ranges, diagonal
from world_models.frames import Pose2

RING = tuple(math.radians(a) for a in range(-150, 151, 30))
NOW_S, SMALL = 20.0, 1e-6


def reading(when_s: float = NOW_S, *near: float | None) -> Ranges:
    return Ranges(RING, near or (None,) * len(RING), 0.02, math.radians(12.0), 3.0, when_s)


def earlier_floor(seen_s: float, sense: str = "ranges") -> FreeFloor:
    return FreeFloor(sense, HALL, 1.0, 1.0, (0.0,), (0.0,), (1.0,), ("sight",), (0.1,), (), seen_s)  # type: ignore[arg-type]


@pytest.mark.parametrize(("sigma_m", "is_told"), [
    (MAX_BELIEF_SIGMA_M - SMALL, True), (MAX_BELIEF_SIGMA_M + SMALL, False)])
def test_it_tells_while_the_place_is_known(sigma_m: float, is_told: bool) -> None:
    bench = Bench(plain_robot())
    bench.believe(covariance=diagonal(sigma_m, 0.001))
    assert (bench.ask(RangeWatcher(), bench.put(reading())) is not None) == is_told


def test_only_the_newest_reading_counts_and_only_where_ranges_are_used() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    old, new = bench.put(reading(1.0)), bench.put(reading(2.0))
    assert bench.ask(RangeWatcher(), old) is None and bench.ask(RangeWatcher(), new) is not None
    unused = RangeWatcher(replace(DEFAULT, floor=replace(DEFAULT.floor, use_ranges=False)))
    assert bench.ask(unused, new) is None


ages = st.lists(st.tuples(st.sampled_from((0.5, MAX_RANGE_AGE_S - SMALL, MAX_RANGE_AGE_S + SMALL, 9.0)),
                          st.sampled_from(("ranges", "camera"))), max_size=2 * MAX_EARLIER_READINGS)


@settings(max_examples=40)
@given(ages)
def test_it_compares_with_the_last_readings_that_are_not_too_old(drawn: list[tuple[float, str]]) -> None:
    bench = Bench(plain_robot())
    belief = bench.believe()
    posted = [bench.put(earlier_floor(NOW_S - age_s, sense)) for age_s, sense in drawn]
    taken = bench.put(reading())
    of_ranges = [entry for entry in reversed(posted) if entry.value.sense == "ranges"][:MAX_EARLIER_READINGS]
    kept = [entry for entry in of_ranges if NOW_S - entry.value.seen_s <= MAX_RANGE_AGE_S]
    effects = bench.ask(RangeWatcher(), taken)
    assert effects is not None
    robot, pose = plain_robot(), to_world(belief.value.locale_from_robot)
    b = belief.value
    expected = see_ranges(robot, HALL, pose, b.sigma_m, b.sigma_rad, taken.value, [entry.value for entry in kept])
    assert made(effects, FreeFloor) == [expected]
    assert all_reasons(effects) == {taken.id, belief.id, *(entry.id for entry in kept[:1])}


def find_things(pose: Pose2, near: tuple[float | None, ...]) -> list[tuple[float, float, float]]:
    """The middle of each thing that the model lacks [m, hall], and how likely it is."""
    bench = Bench(plain_robot())
    bench.believe(pose)
    floor = effect_on(bench.ask(RangeWatcher(), bench.put(reading(NOW_S, *near))), FreeFloor).value
    hall_from_world = to_world(Pose2(0.0, 0.0, 0.0)).inverse()
    found = []
    for thing in floor.things:
        x_m, y_m = shapely.Polygon(thing.footprint).centroid.coords[0]
        own = hall_from_world @ Pose2(x_m, y_m, 0.0)
        found.append((own.x_m, own.y_m, thing.p_thing))
    return found


def test_a_thing_stands_on_the_side_on_which_it_was_heard() -> None:
    for index, side in ((RING.index(math.radians(60)), 1.0), (RING.index(math.radians(-60)), -1.0)):
        near = [None] * len(RING)
        near[index] = 0.8  # type: ignore[call-overload]
        ((_, y_m, _),) = find_things(Pose2(4.0, 2.0, 0.0), tuple(near))
        assert side * (y_m - 2.0) > 0.5


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    check_source(RangeWatcher, bench, bench.put(reading()))
