"""Laws of the path follower: when it begins to roll, how it steers and how fast, and what stops it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from blackboard import Effect, Entry, Level, Revise, Revised
from generated_boards import Bench, effect_on, made, reasons, to_world
from harvey.testing import HALL, check_source, house, plain_robot
from knowledge_sources.action.path_follower import (
    MAX_ROLLING_ERROR_RAD,
    MAX_ROLLING_START_ERROR_RAD,
    MIN_ROLLING_LEG_M,
    ROLLING_LOOKAHEAD_M,
    PathFollower,
)
from knowledge_sources.methods.floor import P_CAMOUFLAGED, find_floor
from knowledge_sources.methods.motion import ROLLING_STOP_MARGIN_M
from knowledge_sources.methods.motion.clearance import LATENCY_S
from knowledge_sources.methods.motion.pure_pursuit import MAX_CURVATURE_PER_M
from knowledge_sources.priority import Priority
from knowledge_sources.reads import FloorAhead
from knowledge_sources.settings import DEFAULT
from perfect_eye import scan_floor
from world_models.actuator import ActuatorModel
from world_models.entries import Course, Discrepancy, Drift, Leg, MotionReport, MotorCommand, Outcome, Place
from world_models.frames import Pose2

ACTUATOR = ActuatorModel()
STOPPING_M = ACTUATOR.stopping_distance_m()
CREEP_M_PER_S = DEFAULT.action.creep_speed_m_per_s
BLIND = PathFollower(replace(DEFAULT, action=replace(DEFAULT.action, keeps_to_seen_floor=False)))
"""One that does not ask what of the floor is seen."""
SMALL = 1e-6
FROM, TO = Place(HALL, 1.0, 2.0), Place(HALL, 7.0, 2.0)
AHEAD = Pose2(2.0, 2.0, 0.0)


class Rolling:
    """A board with a leg across the hall, and the robot on it: at rest, or on a course that was just reported."""

    def __init__(self, pose: Pose2 = AHEAD, *, rolls: bool = True, continuous: bool = True, bend: float | None = None,
                 way: tuple[Place, Place] = (FROM, TO), **leg: object) -> None:
        self.bench = Bench(plain_robot(continuous=continuous))
        self.belief = self.bench.believe(pose)
        self.sketch = self.bench.sketch(*way)
        self.leg = self.bench.leg(self.sketch, **leg)
        self.course: Entry[Course] | None = None
        if bend is not None:
            self.bench.put(Drift(bend, 0.004, 0.0))
        if rolls:
            self.course = self.bench.put(Course(self.leg.id, 0.4, 0.0))
            self.bench.put(MotionReport(0.0, 0.1, 1.0, 1.0), self.course)
            self.belief = self.bench.revise(self.belief, motion="MotionReport-1")

    def ask(self, source: PathFollower = BLIND) -> tuple[Effect, ...] | None:
        return self.bench.ask(source, self.belief)

    def course_of(self, source: PathFollower = BLIND) -> Course | None:
        found = made(self.ask(source), Course)
        return found[0] if found else None


@pytest.mark.parametrize("more_m", [-SMALL, SMALL])
def test_it_rolls_where_the_leg_is_longer_than_it_needs_to_stop(more_m: float) -> None:
    x_m = TO.x_m - (STOPPING_M + MIN_ROLLING_LEG_M + more_m)
    begun, gone_on = (Rolling(Pose2(x_m, 2.0, 0.0), rolls=rolls).course_of() for rolls in (False, True))
    assert (begun is not None) == (more_m > 0.0)
    assert gone_on is not None and gone_on.is_rolling == (more_m > 0.0)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("most_rad", "rolls"), [(MAX_ROLLING_START_ERROR_RAD, False), (MAX_ROLLING_ERROR_RAD, True)])
def test_it_begins_when_it_faces_its_aim_and_stops_when_that_is_far_aside(
    side: float, most_rad: float, rolls: bool
) -> None:
    for more_rad in (-SMALL, SMALL):
        course = Rolling(Pose2(2.0, 2.0, side * (most_rad + more_rad)), rolls=rolls).course_of()
        assert (course is not None and course.is_rolling) == (more_rad < 0.0)
        assert not rolls or course is not None


@pytest.mark.parametrize(("continuous", "looking_rad", "begins"), [
    (True, None, True), (False, None, False), (True, 0.3, False)])
def test_it_begins_on_wheels_that_are_steered_on_the_move_with_no_look_to_come(
    continuous: bool, looking_rad: float | None, begins: bool
) -> None:
    found = Rolling(rolls=False, continuous=continuous, looking_rad=looking_rad).ask()
    assert (found is not None) == begins


def test_it_begins_only_at_rest_and_steers_only_by_a_belief_that_has_the_last_report() -> None:
    at_rest, rolling = Rolling(rolls=False), Rolling()
    at_rest.bench.put(MotorCommand(0.0, 0.5))
    assert at_rest.ask() is None
    rolling.belief = rolling.bench.revise(rolling.belief, motion="MotionReport-0")
    assert rolling.ask() is None


HINDRANCES: dict[str, tuple[Callable[[Bench], object], bool]] = {
    "ended": (lambda b: b.put(Outcome("stopped", "by a law")), True),
    "lost": (lambda b: b.doubt(), True),
    "doubt": (lambda b: b.doubt(Level.PLAN), True),
    "measured within its bound": (lambda b: b.doubt(Level.PLAN, 30.0), False),
    "measured beyond its bound": (lambda b: b.doubt(Level.PLAN, 30.1), True),
    "small": (lambda b: b.doubt(Level.ACTION, 5.0), False),
    "large": (lambda b: b.doubt(Level.ACTION, 5.1), True),
    "a milestone": (lambda b: b.await_milestone(), True),
    "a milestone that was judged": (lambda b: b.await_milestone(status="verified"), False),
}


@pytest.mark.parametrize("name", list(HINDRANCES))
@pytest.mark.parametrize("rolls", [False, True])
def test_what_hinders_it_stops_it_at_once(name: str, rolls: bool) -> None:
    put, stops = HINDRANCES[name]
    board = Rolling(rolls=rolls)
    put(board.bench)
    effects = board.ask()
    if not stops:
        assert made(effects, Course)[0].is_rolling
    elif not rolls:
        assert effects is None
    else:
        (effect,) = effects or ()
        assert isinstance(effect, Revise) and board.course is not None
        assert effect.value == replace(board.course.value, speed_m_per_s=0.0)
        doubts = {d.id for d in board.bench.view.all(Discrepancy)}
        assert reasons(effect) == {board.course.id, board.belief.id} | doubts


@pytest.mark.parametrize("fields", [{"status": "halted"}, {"status": "arrived"}, {"index": 1}])
def test_a_course_without_its_leg_is_stopped(fields: dict[str, object]) -> None:
    board = Rolling()
    board.bench.revise(board.leg, **fields)
    (course,) = made(board.ask(), Course)
    assert not course.is_rolling
    at_rest = Rolling(rolls=False)
    at_rest.bench.revise(at_rest.leg, **fields)
    assert at_rest.ask() is None


def test_stopping_comes_before_all_and_beginning_before_going_on() -> None:
    begin, go_on, stop = Rolling(rolls=False), Rolling(), Rolling()
    stop.bench.doubt()
    ratings = []
    for board in (begin, go_on, stop):
        case = BLIND.find_case(board.bench.view, Revised(board.belief))
        assert case is not None
        ratings.append(BLIND.rate(case))
    assert ratings == [Priority.STEER, Priority.MOVE, Priority.ENTER]


near_line = st.builds(Pose2, st.floats(1.5, 5.0), st.floats(1.9, 2.1), st.floats(-0.03, 0.03))


@settings(max_examples=80)
@given(near_line, st.none() | st.floats(-1.2, 1.2), st.booleans())
def test_it_steers_an_arc_through_the_point_ahead_less_what_the_wheels_bend(
    pose: Pose2, bend: float | None, rolls: bool
) -> None:
    """In the hall's frame the leg is y = 2, from west to east; recomputed with that alone."""
    board = Rolling(pose, rolls=rolls, bend=bend)
    ahead, left = min(ROLLING_LOOKAHEAD_M, TO.x_m - pose.x_m), pose.y_m - 2.0
    aside = math.atan2(-left, ahead) - pose.heading_rad
    limit = MAX_ROLLING_ERROR_RAD if rolls else MAX_ROLLING_START_ERROR_RAD
    assume(abs(aside) < limit - SMALL)
    effects = board.ask()
    course = effect_on(effects, Course)
    # An arc that is tangent to the heading and leads to (a, b) before the robot has the curvature 2 b / (a^2 + b^2).
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    a, b = c * ahead + s * -left, -s * ahead + c * -left
    wanted = 2.0 * b / (a * a + b * b) - (bend or 0.0)
    assert course.value.curvature_per_m == pytest.approx(max(-MAX_CURVATURE_PER_M, min(MAX_CURVATURE_PER_M, wanted)))
    assert course.value.leg == board.leg.id and course.value.speed_m_per_s == ACTUATOR.speed_m_per_s
    assert isinstance(course, Revise) == rolls
    named = {"Leg", board.belief.id} | ({"Drift-1"} if bend is not None else set()) | ({"Course-1"} if rolls else set())
    assert reasons(course) == named
    leg = effect_on(effects, Leg)
    assert leg.value.increments == (not rolls) and reasons(leg) == {board.leg.id, board.belief.id}
    assert (leg.value.to_go_m, leg.value.left_m) == (pytest.approx(TO.x_m - pose.x_m), pytest.approx(left, abs=1e-9))
    assert leg.value.aim_rad == pytest.approx(aside, abs=1e-9)


def test_a_difference_within_its_bound_is_corrected_by_the_next_course() -> None:
    board = Rolling()
    doubt = board.bench.doubt(Level.ACTION, 4.0)
    effects = board.ask()
    effect = effect_on(effects, Discrepancy)
    assert effect.value == replace(doubt.value, status="corrected") and reasons(effect) == {board.belief.id}
    assert reasons(effect_on(effects, Leg)) == {board.leg.id, board.belief.id, "Discrepancy"}


def see_up_to(gap_m: float, *, is_told: bool = True) -> Rolling:
    """The floor is seen free from wall to wall, up to so far before the robot's axis; by an earlier picture too."""
    board = Rolling()
    wall = [to_world(Pose2(AHEAD.x_m + gap_m + dx, y, 0.0)).position
            for dx, y in ((0.0, 0.2), (0.4, 0.2), (0.4, 3.8), (0.0, 3.8))]
    scan = scan_floor(find_floor(house(), [HALL]), to_world(AHEAD), HALL, things=[shapely.Polygon(wall)],
                      near_m=0.05, forward_m=0.0, half_rad=1.4, count=200)
    board.bench.put(scan if is_told else replace(scan, confirmed_m=()), board.belief)
    return board


@pytest.mark.parametrize("is_told", [False, True])
def test_it_rolls_at_full_speed_only_where_more_than_looks_tells_that_the_floor_is_free(is_told: bool) -> None:
    course = effect_on(see_up_to(3.0, is_told=is_told).ask(PathFollower()), Course)
    fastest = ACTUATOR.speed_m_per_s if is_told else CREEP_M_PER_S / math.sqrt(P_CAMOUFLAGED)
    assert course.value.speed_m_per_s == pytest.approx(fastest)


@pytest.mark.parametrize("gap_m", [0.6, 0.62, 0.7, 1.5])
def test_it_can_stop_before_floor_that_was_not_seen_to_be_free(gap_m: float) -> None:
    board = see_up_to(gap_m)
    course = effect_on(board.ask(PathFollower()), Course)
    free_m = FloorAhead(board.bench.view, board.leg.value, board.belief, DEFAULT).measure_clearance(1.0).free_m
    assert free_m <= gap_m - 0.38 + 0.06  # the floor is asked at points 5 cm apart
    speed = course.value.speed_m_per_s
    harm = speed**2 - 2.0 * ACTUATOR.brake_m_per_s2 * (free_m - ROLLING_STOP_MARGIN_M - LATENCY_S * speed)
    assert (speed == ACTUATOR.speed_m_per_s and harm <= CREEP_M_PER_S**2) or harm == pytest.approx(CREEP_M_PER_S**2)
    assert free_m > 0.2
    assert "FreeFloor-1" in reasons(course)


@pytest.mark.parametrize(("gap_m", "rolls"), [(0.48, False), (0.52, False), (0.66, True)])
def test_it_stops_where_too_little_floor_is_free_and_names_what_tells_that(gap_m: float, rolls: bool) -> None:
    (course,) = [e for e in see_up_to(gap_m).ask(PathFollower()) or () if isinstance(e.value, Course)]
    assert course.value.is_rolling == rolls and "FreeFloor-1" in reasons(course)


def test_it_keeps_the_laws_of_all_sources() -> None:
    for rolls in (False, True):
        board = Rolling(rolls=rolls)
        check_source(BLIND, board.bench, board.bench.revise(board.belief))
