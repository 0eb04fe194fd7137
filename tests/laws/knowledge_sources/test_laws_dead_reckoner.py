"""Laws of the dead reckoner: the belief follows the wheels, grows by what is not known of them, and says why."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Effect, Entry, Level, Post, Revise
from generated_boards import (
    Bench,
    covariances,
    effect_on,
    made,
    mirrored,
    mirrored_covariance,
    poses,
    reasons,
    to_world,
)
from harvey.testing import HALL, STUDY, SURE, check_source, house, plain_robot
from knowledge_sources.action.dead_reckoner import MAX_COUNTED_BESIDE_M, MIN_CLAIMED_PART, DeadReckoner
from knowledge_sources.methods.calibration import SIGMA_YAW_RAD
from knowledge_sources.reads import PLACED_BY
from knowledge_sources.settings import DEFAULT
from world_models.actuator import ActuatorModel
from world_models.entries import (
    BodyFault,
    Contact,
    Course,
    Discrepancy,
    Drift,
    Hypothesis,
    MotionReport,
    MotorCommand,
    PictureRequest,
    Travel,
    begin_travel,
)
from world_models.entries.location import Covariance
from world_models.frames import Pose2

ACTUATOR = ActuatorModel()
YAW_VARIANCE = SIGMA_YAW_RAD**2
SMALL = 1e-6
turns, moves = st.floats(-0.6, 0.6), st.floats(0.0, 0.6)
bends = st.none() | st.floats(-0.03, 0.03)


class Told(NamedTuple):
    """The board after a report, and what the dead reckoner made of it."""

    bench: Bench
    belief: Entry[Hypothesis]
    request: Entry[MotorCommand] | Entry[Course]
    report: Entry[MotionReport]
    effects: tuple[Effect, ...]

    @property
    def moved(self) -> Hypothesis:
        (found,) = made(self.effects, Hypothesis)
        return found


def reckon(
    pose: Pose2, turn_rad: float, move_m: float, *, covariance: Covariance = SURE, bend: float | None = None,
    asked: MotorCommand | Course | None = None, basis: str = "tracks", fault: bool = False, of: str = "",
    contact: bool = False, travel: Travel | None = None,
) -> Told:
    """What follows from a report; ``of``: the request that the fault broke off, by default that of the report."""
    bench = Bench(plain_robot())
    belief = bench.believe(pose, covariance, basis=basis)
    if bend is not None:
        bench.put(Drift(bend, 0.004, 0.1, 0.2, 0.3, 0.4))
    if travel is not None:
        bench.put(travel)
    request = bench.put(asked or MotorCommand(turn_rad, move_m))
    if fault:
        bench.put(BodyFault("base", "stalled", "held", of or request.id, 1.0, turn_rad, move_m))
    if contact:
        bench.put(Contact("bumper", 0.3, 0.2, 1.0), request)
    report = bench.put(MotionReport(turn_rad, move_m, 1.0, 1.0), request)
    effects = bench.ask(DeadReckoner(), report)
    assert effects is not None
    return Told(bench, belief, request, report, effects)


def drive(pose: Pose2, turn_rad: float, move_m: float, bend: float, *, rolling: bool) -> Pose2:
    """Where it comes to, in a thousand steps."""
    x, y, heading, steps = pose.x_m, pose.y_m, pose.heading_rad, 1000
    gone = ACTUATOR.reach * move_m
    if not rolling:
        heading += turn_rad
    each = (bend * gone + (turn_rad if rolling else 0.0)) / steps
    for _ in range(steps):
        x += gone / steps * math.cos(heading + each / 2)
        y += gone / steps * math.sin(heading + each / 2)
        heading += each
    return Pose2(x, y, heading)


@settings(max_examples=60)
@given(poses, covariances, turns, moves, bends, st.booleans())
def test_the_belief_goes_where_the_wheels_claim(
    pose: Pose2, covariance: Covariance, turn: float, move: float, bend: float | None, rolling: bool
) -> None:
    asked = Course("Leg-1", 0.4, 0.0) if rolling else None
    told = reckon(pose, turn, move, covariance=covariance, bend=bend, asked=asked)
    moved, world = told.moved, house()
    there = drive(pose, turn, move, bend or 0.0, rolling=rolling)
    came = to_world(pose).inverse() @ moved.world_from_robot(world)
    meant = pose.inverse() @ there
    assert math.dist(came.position, meant.position) < 1e-6
    assert abs(math.remainder(came.heading_rad - meant.heading_rad, math.tau)) < 1e-9
    assert (moved.basis, moved.motion, moved.status) == ("odometry", told.report.id, "held")
    step = (ACTUATOR.propagate_course if rolling else ACTUATOR.propagate_move)(
        to_world(pose), told.belief.value.covariance_world(world), turn, move, bend or 0.0)[1]
    ahead = moved.world_from_robot(world).position - to_world(pose).position
    aside = np.array([-ahead[1], ahead[0]])
    step[:2, :2] += YAW_VARIANCE * np.outer(aside, aside)
    assert np.allclose(moved.covariance_world(world), step, atol=1e-12)
    assert reasons(effect_on(told.effects, Hypothesis)) == {told.report.id, told.belief.id}


@settings(max_examples=40)
@given(poses, covariances, turns, moves, bends, st.booleans(), st.booleans())
def test_turned_the_other_way_it_comes_to_the_mirrored_place(
    pose: Pose2, covariance: Covariance, turn: float, move: float, bend: float | None, rolling: bool, fault: bool
) -> None:
    asked = [Course("Leg-1", 0.4, 0.0) if rolling else MotorCommand(sign * (turn + 0.1), move + 0.1)
             for sign in (1, -1)]
    one = reckon(pose, turn, move, covariance=covariance, bend=bend, asked=asked[0], fault=fault)
    other = reckon(mirrored(pose), -turn, move, covariance=mirrored_covariance(covariance),
                   bend=None if bend is None else -bend, asked=asked[1], fault=fault)
    back, there = mirrored(other.moved.locale_from_robot), one.moved.locale_from_robot
    assert np.allclose((back.x_m, back.y_m), (there.x_m, there.y_m), atol=1e-9)
    assert abs(math.remainder(back.heading_rad - there.heading_rad, math.tau)) < 1e-9
    assert np.allclose(mirrored_covariance(other.moved.covariance), one.moved.covariance, atol=1e-12)


@settings(max_examples=40)
@given(poses, turns, moves, turns, moves)
def test_what_a_broken_off_motion_leaves_open_widens_the_belief_and_is_named(
    pose: Pose2, turn: float, move: float, more_rad: float, more_m: float
) -> None:
    asked = MotorCommand(turn + more_rad, move + more_m)
    whole, broken = (reckon(pose, turn, move, asked=asked, fault=fault) for fault in (False, True))
    wider = np.subtract(broken.moved.covariance, whole.moved.covariance)
    heading = broken.moved.locale_from_robot.heading_rad
    c, s = math.cos(heading), math.sin(heading)
    assert wider[2][2] == pytest.approx(more_rad**2 / 3, abs=1e-12)
    expected = np.array([[c * c, c * s], [c * s, s * s]]) * more_m**2 / 3
    assert np.allclose(wider[:2, :2], expected, atol=1e-12)
    assert reasons(effect_on(broken.effects, Hypothesis)) == {broken.report.id, broken.belief.id, "BodyFault-1"}


def test_on_the_move_a_fault_leaves_the_stopping_distance_open() -> None:
    pose, asked = Pose2(2.0, 2.0, 0.4), Course("Leg-1", 0.4, 0.0)
    whole, broken = (reckon(pose, 0.0, 0.3, asked=asked, fault=fault) for fault in (False, True))
    wider = np.subtract(broken.moved.covariance, whole.moved.covariance)
    assert np.trace(wider) == pytest.approx(ActuatorModel().stopping_distance_m() ** 2 / 3)
    assert made(broken.effects, PictureRequest) and not made(whole.effects, PictureRequest)


def test_the_fault_of_another_request_widens_nothing() -> None:
    plain, other = (reckon(Pose2(2.0, 2.0, 0.0), 0.1, 0.3, asked=MotorCommand(0.2, 0.4), fault=fault, of="Ride-1")
                    for fault in (False, True))
    assert plain.moved == other.moved
    assert reasons(effect_on(other.effects, Hypothesis)) == {other.report.id, other.belief.id}


@settings(max_examples=40)
@given(poses, turns, moves, bends, st.booleans())
def test_the_stretch_of_the_drift_grows_by_the_motion(
    pose: Pose2, turn: float, move: float, bend: float | None, rolling: bool
) -> None:
    told = reckon(pose, turn, move, bend=bend, asked=Course("Leg-1", 0.4, 0.0) if rolling else None)
    effect = effect_on(told.effects, Drift)
    turn_variance = (0.025 * turn) ** 2 + (0.0 if rolling or turn == 0.0 else math.radians(0.2) ** 2)
    before = (0.0, 0.0, 0.0) if bend is None else (0.2, 0.3, 0.4)
    drift = effect.value
    assert np.allclose((drift.turned_rad, drift.turned_variance, drift.gone_m), np.add(
        before, (turn, turn_variance, 228.3 / 240 * move)))
    assert drift.curvature_per_m == (bend or 0.0)
    if bend is None:
        assert isinstance(effect, Post) and reasons(effect) == {told.report.id}
        assert drift.heading_rad == pytest.approx(to_world(pose).heading_rad)
        assert drift.sigma_per_m == ACTUATOR.curvature_sigma_per_m
    else:
        assert isinstance(effect, Revise) and reasons(effect) == {told.report.id, "Drift-1"}


@settings(max_examples=40)
@given(poses, turns, st.floats(0.1, 0.6), st.sampled_from((*PLACED_BY, "tracks", "milestone")), st.booleans())
def test_the_way_goes_on_unless_the_belief_was_not_by_what_was_seen(
    pose: Pose2, turn: float, move: float, basis: str, has_way: bool
) -> None:
    here = to_world(pose)
    old = begin_travel(Pose2(-5.0, 1.0, 0.0), SURE, 0.3, 0.2).after_motion(Pose2(0.0, 0.0, here.heading_rad), Pose2(
        math.cos(here.heading_rad), math.sin(here.heading_rad), here.heading_rad), 0.01)
    told = reckon(pose, turn, move, basis=basis, travel=old if has_way else None)
    effect, is_new = effect_on(told.effects, Travel), not has_way or basis in PLACED_BY
    way, came = effect.value, told.moved.world_from_robot(house()).position - here.position
    begun_m = (0.0, 0.0) if is_new else (old.x_m, old.y_m)
    assert np.allclose((way.x_m, way.y_m), np.add(begun_m, came))
    assert way.gone_m == pytest.approx((0.0 if is_new else 1.0) + math.hypot(*came))
    slip_m2 = (0.004 * abs(turn) / (math.pi / 2)) ** 2
    assert way.slip_m2 == pytest.approx(slip_m2 + (0.0 if is_new else 0.01**2))
    if is_new:
        assert np.allclose((way.began.x_m, way.began.y_m, way.began.heading_rad),
                           (here.x_m, here.y_m, here.heading_rad))
        assert way.yaw_rad == 0.0 and way.yaw_variance == pytest.approx(YAW_VARIANCE)
        assert np.allclose(way.covariance, told.belief.value.covariance_world(house()))
    else:
        assert (way.began, way.covariance, way.yaw_rad, way.yaw_variance) == (old.began, old.covariance, 0.3, 0.2)
    assert isinstance(effect, Revise) == has_way
    assert reasons(effect) == {told.report.id} | ({"Travel-1"} if has_way else set())


@pytest.mark.parametrize("rolling", [False, True])
@pytest.mark.parametrize("fault", [False, True])
def test_it_asks_for_a_picture_unless_one_was_taken_on_the_move(rolling: bool, fault: bool) -> None:
    told = reckon(Pose2(2.0, 2.0, 0.0), 0.0, 0.3, asked=Course("Leg-1", 0.4, 0.0) if rolling else None, fault=fault)
    asked = made(told.effects, PictureRequest)
    assert asked == ([] if rolling and not fault else [PictureRequest("track")])
    if asked:
        assert reasons(effect_on(told.effects, PictureRequest)) == {"Hypothesis"}


@pytest.mark.parametrize("part", [MIN_CLAIMED_PART - SMALL, MIN_CLAIMED_PART + SMALL, 1.0, 1.2])
@pytest.mark.parametrize("contact", [False, True])
@pytest.mark.parametrize("fault", [False, True])
def test_what_stopped_it_is_a_difference_unless_the_body_says_what_it_was(
    part: float, contact: bool, fault: bool
) -> None:
    told = reckon(Pose2(2.0, 2.0, 0.0), 0.0, part * 0.5, asked=MotorCommand(0.0, 0.5), contact=contact, fault=fault)
    found, is_stopped = made(told.effects, Discrepancy), not fault and (contact or part < MIN_CLAIMED_PART)
    assert len(found) == is_stopped
    is_odd = not fault and not contact and abs(part - 1.0) * 0.5 > MAX_COUNTED_BESIDE_M  # then it may be as far off
    assert told.moved.excess_m == pytest.approx(abs(part - 1.0) * 0.5 if is_odd else 0.0)
    if is_stopped:
        bound = DEFAULT.plan.max_deviation_px
        assert replace(found[0], what="") == Discrepancy(Level.ACTION, "", math.inf, (bound, bound), "px")
        assert f"{part * 0.5:.2f} m of 0.50 m" in found[0].what
        assert reasons(effect_on(told.effects, Discrepancy)) == {told.report.id} | ({"Contact-1"} if contact else set())


@pytest.mark.parametrize("contact", [False, True])
def test_on_the_move_only_a_touch_tells_that_it_was_stopped(contact: bool) -> None:
    told = reckon(Pose2(2.0, 2.0, 0.0), 0.0, 0.01, asked=Course("Leg-1", 0.4, 0.0), contact=contact)
    assert [d.what for d in made(told.effects, Discrepancy)] == ["something was touched on the move"] * contact


def test_of_a_request_that_is_no_longer_on_the_board_only_the_motion_is_taken() -> None:
    bench = Bench(plain_robot())
    bench.believe(basis="tracks")
    command, report = bench.move(0.0, 0.1)
    bench.board.forget(command.id)
    effects = bench.ask(DeadReckoner(), report)
    assert [type(e.value) for e in effects or ()] == [
        Hypothesis, Drift, Travel, PictureRequest]


def test_a_report_that_the_belief_includes_is_not_taken_again() -> None:
    bench = Bench(plain_robot())
    belief = bench.believe()
    _, report = bench.move()
    assert bench.ask(DeadReckoner(), report) is not None
    bench.revise(belief, motion=report.id)
    assert bench.ask(DeadReckoner(), report) is None


@pytest.mark.parametrize(("x_m", "locale"), [(7.6, HALL), (8.05, HALL), (8.6, STUDY)])
def test_in_a_doorway_it_is_still_in_the_room_that_it_comes_from(x_m: float, locale: str) -> None:
    told = reckon(Pose2(7.2, 2.0, 0.0), 0.0, (x_m - 7.2) / ACTUATOR.reach)
    assert told.moved.locale == locale
    assert np.allclose(told.moved.world_from_robot(house()).position, to_world(Pose2(x_m, 2.0, 0.0)).position)


def test_it_keeps_the_laws_of_all_sources() -> None:
    told = reckon(Pose2(2.0, 2.0, 0.0), 0.1, 0.3, bend=0.01, fault=True)
    check_source(DeadReckoner, told.bench, told.report)
