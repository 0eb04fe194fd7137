"""Laws of the motion between two pictures: the surer of wheels and beliefs tells it, and neither claims too much."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry
from generated_boards import Bench, to_world
from harvey.testing import plain_robot
from knowledge_sources.methods.floor import MotionBetween
from knowledge_sources.reads import HELD, find_motion_between
from knowledge_sources.reads.motion_between import MAX_APART_SIGMAS, add_reports
from world_models.actuator import ActuatorModel, arc
from world_models.entries import BodyFault, Drift, FloorView, MotionReport, MotorCommand, diagonal
from world_models.frames import Pose2, wrap_angle

ACTUATOR = ActuatorModel()
KNOWN = Drift(0.004, 0.002, 0.0)
HERE = Pose2(3.0, 2.0, 0.4)
parts = st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(0.01, 0.6)), min_size=1, max_size=5)
seeds = st.integers(0, 2**32 - 1)


def report(turn_rad: float, move_m: float) -> MotionReport:
    return MotionReport(turn_rad, move_m, 1.0, 1.0)


def roll(way: list[tuple[float, float]]) -> Pose2:
    return add_reports(ACTUATOR, KNOWN, [report(*part) for part in way]).moved


class Way:
    """A board on which the robot kept a picture, and went on."""

    def __init__(self, way: list[tuple[float, float]], sigma_rad: float, off_rad: float = 0.0) -> None:
        self.bench, self.way = Bench(plain_robot()), way
        start, self.before = to_world(HERE), self.report(0.0, 0.1)
        self.kept = FloorView("frame", "belief", start.x_m, start.y_m, start.heading_rad, 0.0, 1.0,
                              min(0.01, sigma_rad), sigma_rad, self.before.id)
        self.reports = [self.report(*part) for part in way]
        self.bench.put(KNOWN)
        there = HERE @ roll(way)
        self.believed = Pose2(there.x_m, there.y_m, there.heading_rad + off_rad)
        self.bench.believe(self.believed, diagonal(min(0.01, sigma_rad), sigma_rad), motion=self.reports[-1].id)

    def report(self, turn_rad: float, move_m: float) -> Entry[MotionReport]:
        return self.bench.put(report(turn_rad, move_m), self.bench.put(MotorCommand(turn_rad, move_m)))

    def find(self) -> MotionBetween:
        motion, told = find_motion_between(self.bench.view, self.kept, HELD.of(self.bench.view))
        asked = {entry.id for entry in told}
        assert not asked or asked == {"Drift-1", *(entry.id for entry in self.reports)}
        assert asked or self.believes(motion)
        return motion

    def believes(self, found: MotionBetween) -> bool:
        """Whether it is the motion by both beliefs."""
        return math.isclose(found.sigma_rad, math.hypot(self.kept.sigma_rad, self.kept.sigma_rad), rel_tol=1e-9)


def assert_same(one: Pose2, other: Pose2) -> None:
    assert math.dist(one.position, other.position) < 1e-9
    assert abs(wrap_angle(one.heading_rad - other.heading_rad)) < 1e-9


@given(parts)
def test_the_surer_of_both_tells_it(way: list[tuple[float, float]]) -> None:
    unsure, sure = Way(way, 0.3), Way(way, 1e-6)
    assert not unsure.believes(unsure.find()) and sure.believes(sure.find())
    assert_same(unsure.find().moved, roll(way))
    assert_same(sure.find().moved, HERE.inverse() @ sure.believed)


def test_wheels_that_say_otherwise_are_not_believed() -> None:
    way = [(0.0, 0.5)]
    sigma_rad = math.hypot(math.hypot(0.02, 0.02), add_reports(ACTUATOR, KNOWN, [report(0.0, 0.5)]).sigma_rad)
    for sigmas in (MAX_APART_SIGMAS - 0.01, MAX_APART_SIGMAS + 0.01):
        pushed = Way(way, 0.02, sigmas * sigma_rad)
        assert pushed.believes(pushed.find()) == (sigmas > MAX_APART_SIGMAS)


@pytest.mark.parametrize("part", [0, 1, 2])
def test_nor_are_those_of_a_motion_that_was_broken_off(part: int) -> None:
    way = Way([(0.0, 0.3)] * 3, 0.3)
    way.bench.put(BodyFault("base", "stalled", "", way.reports[part].because[0].id, 1.0, status="over"))
    assert way.believes(way.find())


@pytest.mark.parametrize("gone", [False, True])
def test_nor_where_a_report_is_not_on_the_board_any_more(gone: bool) -> None:
    way = Way([(0.0, 0.1)] * 3, 0.3)
    if gone:
        way.bench.retract(way.before)
    assert way.believes(way.find()) == gone


@given(st.tuples(parts, parts))
def test_one_way_after_another_is_the_whole_way(ways: tuple[list[tuple[float, float]], ...]) -> None:
    one, other = ways
    assert_same(roll([*one, *other]), roll(one) @ roll(other))
    whole, part = (add_reports(ACTUATOR, KNOWN, [report(*step) for step in way]) for way in ([*one, *other], one))
    assert whole.sigma_m >= part.sigma_m and whole.sigma_rad >= part.sigma_rad


@given(parts)
def test_a_mirrored_way_is_mirrored(way: list[tuple[float, float]]) -> None:
    mirrored = Drift(-KNOWN.curvature_per_m, KNOWN.sigma_per_m, 0.0)
    there = roll(way)
    other = add_reports(ACTUATOR, mirrored, [report(-turn, move) for turn, move in way])
    assert_same(other.moved, Pose2(there.x_m, -there.y_m, -there.heading_rad))


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_wheels_are_no_surer_than_they_are(seed: int) -> None:
    """Of 200 ways as the actuator model draws them, no more end beyond two deviations than should."""
    rng = np.random.default_rng(seed)
    beyond = []
    for _ in range(200):
        way = [(float(rng.uniform(-0.3, 0.3)) * (rng.random() < 0.3), float(rng.uniform(0.1, 0.6))) for _ in range(3)]
        truth = Pose2(0.0, 0.0, 0.0)
        reach = rng.normal(ACTUATOR.reach, ACTUATOR.reach_sigma)
        mean = rng.normal(KNOWN.curvature_per_m, KNOWN.sigma_per_m)
        for turn, move in way:
            off = rng.normal(0.0, math.sqrt(ACTUATOR.turn_variance(turn)))
            bent = rng.normal(mean, ACTUATOR.bend_sigma_per_m)
            truth = truth @ Pose2(0.0, 0.0, turn + off) @ arc(reach * move, bent)
        found = add_reports(ACTUATOR, KNOWN, [report(*part) for part in way])
        away = wrap_angle(truth.heading_rad - found.moved.heading_rad)
        beyond.append((abs(away) > 2.0 * found.sigma_rad,
                       math.dist(truth.position, found.moved.position) > 2.0 * math.sqrt(2.0) * found.sigma_m))
    assert np.all(np.mean(beyond, axis=0) < 0.1)
