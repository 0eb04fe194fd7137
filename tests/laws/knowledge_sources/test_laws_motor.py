"""Laws of the motor: one increment at a time, along the leg, as far as the floor is known to be free."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from blackboard import Effect, Entry, Level
from generated_boards import (
    Bench,
    all_reasons,
    effect_on,
    made,
    near,
    poses,
    reasons,
    to_world,
)
from harvey.testing import HALL, check_source, house, plain_robot
from knowledge_sources.action.motor import LOOKAHEAD_M, Motor
from knowledge_sources.methods.floor import P_CAMOUFLAGED, find_floor
from knowledge_sources.methods.motion import MAX_HEADING_ERROR_RAD, count_increment, plan_increment
from knowledge_sources.methods.motion.clearance import LATENCY_S, MIN_MOVE_M, Clearance, choose_move
from knowledge_sources.methods.motion.pure_pursuit import MAX_START_OFFSET_M
from knowledge_sources.reads import FloorAhead
from knowledge_sources.reads.floor_ahead import TOUCH_HOLDS_M
from knowledge_sources.settings import DEFAULT
from perfect_eye import scan_floor
from world_models.actuator import ActuatorModel
from world_models.entries import Contact, Discrepancy, Drift, Leg, MotorCommand, Obstacle, Place
from world_models.entries.task import MilestoneStatus
from world_models.frames import Pose2

ACTUATOR = ActuatorModel()
CREEP_M_PER_S = DEFAULT.action.creep_speed_m_per_s
BLIND = Motor(replace(DEFAULT, action=replace(DEFAULT.action, keeps_to_seen_floor=False)))
"""One that does not ask what of the floor is seen."""
SMALL = 1e-6
FROM, TO = Place(HALL, 1.5, 2.0), Place(HALL, 6.5, 2.0)


def start(pose: Pose2, to: Place = TO, *, leg: bool = True, **fields: object) -> tuple[Bench, Entry[object]]:
    """A board with a verified sketch across the hall, its leg, and the robot at a pose."""
    bench = Bench(plain_robot())
    bench.believe(pose)
    sketch = bench.sketch(FROM, to)
    return bench, bench.leg(sketch, **fields) if leg else sketch


def command_of(effects: tuple[Effect, ...] | None) -> MotorCommand | None:
    commands = made(effects, MotorCommand)
    assert len(commands) <= 1
    return commands[0] if commands else None


@settings(max_examples=80)
@given(st.floats(-3.1, 3.1), st.floats(-3.1, 3.1) | near(MAX_HEADING_ERROR_RAD, ACTUATOR.turn_increment_rad))
def test_it_turns_to_a_milestone_in_equal_increments(heading: float, aside: float) -> None:
    look = to_world(Pose2(0.0, 0.0, heading)).heading_rad + aside
    bench = Bench(plain_robot())
    belief = bench.believe(Pose2(2.0, 2.0, heading))
    milestone = bench.await_milestone(look_heading_rad=look)
    turn = math.remainder(look - to_world(Pose2(0.0, 0.0, heading)).heading_rad, math.tau)
    assume(abs(abs(turn) - MAX_HEADING_ERROR_RAD) > SMALL and abs(abs(turn) - math.pi) > SMALL)
    effects = bench.ask(BLIND, milestone)
    assert (effects is not None) == (abs(turn) > MAX_HEADING_ERROR_RAD)
    if effects is not None:
        (effect,) = effects
        parts = math.ceil(abs(turn) / ACTUATOR.turn_increment_rad)
        assert effect.value.turn_rad == pytest.approx(turn / parts) and effect.value.move_m == 0.0
        assert all_reasons(effects) == {milestone.id, belief.id}


@pytest.mark.parametrize("status", ["turning", "expected", "verified"])
def test_while_a_milestone_is_looked_for_nothing_else_is_driven(status: MilestoneStatus) -> None:
    bench, leg = start(Pose2(2.0, 2.0, 0.0))
    here = to_world(Pose2(0.0, 0.0, 0.0)).heading_rad
    bench.await_milestone(look_heading_rad=here + 0.5, status=status)
    effects = bench.ask(BLIND, leg)
    assert (effects is None) == (status == "expected")
    if status == "turning":
        assert [type(e.value) for e in effects or ()] == [MotorCommand]
    elif status == "verified":
        assert made(effects, Leg)


DOUBTS = [(level, magnitude) for level in Level for magnitude in (None, 1.0, 100.0)]


@pytest.mark.parametrize(("level", "magnitude"), DOUBTS)
@pytest.mark.parametrize("looks", ["none", "before", "after"])
def test_in_doubt_it_turns_only_for_the_look_that_ends_it(level: Level, magnitude: float | None, looks: str) -> None:
    """A difference that its level has measured within its bound (5 px here, 30 px above) is no doubt."""
    bench, leg = start(Pose2(2.0, 2.0, 0.0))
    aside = to_world(Pose2(0.0, 0.0, 0.0)).heading_rad + 0.5
    if looks == "before":
        bench.await_milestone(look_heading_rad=aside)
    bench.doubt(level, magnitude)
    if looks == "after":
        bench.await_milestone(look_heading_rad=aside)
    bound = {Level.ACTION: 5.0, Level.PLAN: 30.0, Level.GOAL: -1.0}[level]
    unmeasured = magnitude is None and level is not Level.ACTION
    is_doubt = unmeasured or (magnitude or 0.0) > bound
    ends = level is Level.PLAN and magnitude is None and looks == "after"
    command = command_of(bench.ask(BLIND, leg))
    assert (command is not None) == (not is_doubt or ends)
    if command is not None:
        assert (command.move_m == 0.0) == (looks != "none")


def test_lost_no_look_ends_the_doubt() -> None:
    bench, leg = start(Pose2(2.0, 2.0, 0.0))
    bench.doubt(Level.PLAN)
    lost = bench.doubt(Level.GOAL)
    bench.await_milestone(look_heading_rad=2.0)
    assert bench.ask(BLIND, leg) is None
    bench.revise(lost, status="corrected")
    assert bench.ask(BLIND, leg) is not None


@settings(max_examples=60)
@given(poses, st.sampled_from((None, 0.7, -1.2)))
def test_a_leg_begins_on_the_planned_line_or_where_the_robot_is(pose: Pose2, heading: float | None) -> None:
    offset = math.dist((pose.x_m, pose.y_m), (FROM.x_m, FROM.y_m))
    assume(abs(offset - MAX_START_OFFSET_M) > SMALL)
    bench, sketch = start(pose, replace(TO, heading_rad=heading), leg=False)
    effects = bench.ask(BLIND, sketch)
    assert effects is not None
    (effect,) = effects
    leg, end = effect.value, to_world(Pose2(TO.x_m, TO.y_m, heading or 0.0))
    begin = to_world(Pose2(FROM.x_m, FROM.y_m, 0.0) if offset <= MAX_START_OFFSET_M else pose)
    assert np.allclose((leg.x0_m, leg.y0_m, leg.x1_m, leg.y1_m), (*begin.position, *end.position))
    assert (leg.sketch, leg.index, leg.tolerance_m, leg.status) == (sketch.id, 0, 0.1, "moving")
    assert leg.heading_rad == (None if heading is None else pytest.approx(end.heading_rad))
    assert all_reasons(effects) == {sketch.id, "Hypothesis-1"}


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("more_m", [-SMALL, SMALL])
def test_so_far_off_the_planned_line_a_new_one_is_drawn(side: float, more_m: float) -> None:
    bench, sketch = start(Pose2(FROM.x_m, FROM.y_m + side * (MAX_START_OFFSET_M + more_m), 0.0), leg=False)
    leg = effect_on(bench.ask(BLIND, sketch), Leg).value
    planned = to_world(Pose2(FROM.x_m, FROM.y_m, 0.0))
    assert (math.dist((leg.x0_m, leg.y0_m), planned.position) < 1e-9) == (more_m < 0.0)


@pytest.mark.parametrize(("verified", "primitive", "begins"), [(True, True, True), (False, True, False),
                                                               (True, False, False)])
def test_only_a_verified_step_that_can_be_driven_becomes_a_leg(verified: bool, primitive: bool, begins: bool) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    sketch = bench.sketch(FROM, TO, verified=verified, primitive=primitive)
    assert (bench.ask(BLIND, sketch) is not None) == begins


@settings(max_examples=100)
@given(poses, st.none() | st.floats(-0.03, 0.03))
def test_an_increment_leads_towards_the_line_ahead(pose: Pose2, bend: float | None) -> None:
    """In the hall's frame the leg is y = 2, from west to east; recomputed with that alone."""
    bench, leg = start(pose)
    drift = None if bend is None else bench.put(Drift(bend, 0.004, 0.0))
    effects = bench.ask(BLIND, leg)
    assert effects is not None
    seen = effect_on(effects, Leg).value
    to_go, left = TO.x_m - pose.x_m, pose.y_m - 2.0
    assert (seen.to_go_m, seen.left_m) == (pytest.approx(to_go, abs=1e-9), pytest.approx(left, abs=1e-9))
    lookahead = LOOKAHEAD_M
    aim_x = TO.x_m if to_go < 0.25 else min(TO.x_m, max(FROM.x_m, pose.x_m + lookahead))
    aim = math.remainder(math.atan2(-left, aim_x - pose.x_m) - pose.heading_rad, math.tau)
    assume(abs(abs(aim) - math.pi) > SMALL and abs(abs(aim) - MAX_HEADING_ERROR_RAD) > SMALL)
    assert seen.aim_rad == pytest.approx(aim, abs=1e-9)
    away = math.hypot(to_go, left)
    has_arrived = away <= 0.8 * 0.1 or (to_go <= 0.0 and abs(left) <= 0.8 * 0.1)
    command = command_of(effects)
    assert (command is None, seen.status, seen.increments) == (
        has_arrived, "arrived" if has_arrived else "moving", 0 if has_arrived else 1)
    if command is None:
        return
    if abs(aim) > MAX_HEADING_ERROR_RAD:
        assert command == MotorCommand(pytest.approx(aim / math.ceil(abs(aim) / ACTUATOR.turn_increment_rad)), 0.0)
    else:
        move = min(ACTUATOR.increment_m, away / ACTUATOR.reach)
        turn = aim - 0.5 * (bend or 0.0) * ACTUATOR.reach * move
        assert command.move_m == pytest.approx(move)
        assert command.turn_rad == (pytest.approx(turn) if abs(turn) > math.radians(0.05) else 0.0)
    named = {"Leg", "Hypothesis-1"} | ({drift.id} if drift is not None else set())
    assert reasons(effect_on(effects, MotorCommand)) == named
    assert reasons(effect_on(effects, Leg)) == {leg.id, "Hypothesis-1"}


@pytest.mark.parametrize("magnitude", [1.0, 4.9])
def test_a_difference_within_its_bound_is_corrected_by_the_next_increment(magnitude: float) -> None:
    bench, leg = start(Pose2(2.0, 2.1, 0.0))
    doubt = bench.doubt(Level.ACTION, magnitude)
    effects = bench.ask(BLIND, leg)
    effect = effect_on(effects, Discrepancy)
    assert effect.entry.id == doubt.id and effect.value == replace(doubt.value, status="corrected")
    assert reasons(effect) == {"Hypothesis-1"}
    assert reasons(effect_on(effects, Leg)) == {leg.id, "Hypothesis-1", "Discrepancy"}


@pytest.mark.parametrize("off_deg", [5.9, 6.1, -6.1])
def test_it_looks_where_it_was_to_look_before_it_drives_on(off_deg: float) -> None:
    heading = to_world(Pose2(0.0, 0.0, 0.0)).heading_rad
    bench, leg = start(Pose2(2.0, 2.0, 0.0), looking_rad=heading + math.radians(off_deg))
    effects = bench.ask(BLIND, leg)
    command, seen = command_of(effects), effect_on(effects, Leg).value
    assert command is not None
    if abs(off_deg) > 6.0:
        assert (command.turn_rad, command.move_m) == (pytest.approx(math.radians(off_deg)), 0.0)
        assert seen.looking_rad is not None
    else:
        assert command.move_m > 0.0 and seen.looking_rad is None


def drive_to_thing(gap_m: float, *, scans: bool = True, suspected: float | None = None) -> tuple[
        Bench, tuple[Effect, ...] | None]:
    """The motor's act where the floor is seen free up to ``gap_m`` before the robot's axis, as far as anything is."""
    pose = Pose2(3.0, 2.0, 0.0)
    bench, leg = start(pose)
    here = to_world(pose)
    if scans:
        wall = [to_world(Pose2(3.0 + gap_m + dx, y, 0.0)).position
                for dx, y in ((0.0, 0.2), (0.4, 0.2), (0.4, 3.8), (0.0, 3.8))]
        scan = scan_floor(find_floor(house(), [HALL]), here, HALL, things=[shapely.Polygon(wall)], near_m=0.05,
                          forward_m=0.0, half_rad=1.4, count=200)
        bench.put(scan, bench.view["Hypothesis-1"])
    if suspected is not None:
        at = to_world(Pose2(3.0 + suspected, 2.0, 0.0))
        corners = tuple((at.x_m + dx, at.y_m + dy) for dx, dy in ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)))
        bench.put(Obstacle("hall/obstacle-1", HALL, corners, 0.05, 0.0, 0.0, 0.2, status="suspected", certainty=0.4))
    return bench, bench.ask(Motor(), leg)


def test_the_robot_drives_as_far_as_the_floor_is_seen_and_creeps_where_it_is_not() -> None:
    _, far = drive_to_thing(3.0)
    whole = command_of(far)
    assert whole is not None and whole.speed_m_per_s is None
    assert whole.move_m == pytest.approx(ACTUATOR.increment_m)
    assert {"FreeFloor-1"} <= reasons(effect_on(far, MotorCommand))
    for gap_m in (0.65, 0.7, 0.8):  # the floor is asked at points 5 cm apart
        _, near = drive_to_thing(gap_m)
        command = command_of(near)
        assert command is not None and (command.speed_m_per_s or 1.0) > 0.4
        free_m = gap_m - 0.35 - 0.03  # up to where the disc, with its margin, would cover what is not seen
        assert free_m - 0.06 < ACTUATOR.reach * command.move_m <= free_m + 0.06
    command = command_of(drive_to_thing(0.38)[1])
    assert command is not None and command.speed_m_per_s == CREEP_M_PER_S


@pytest.mark.parametrize(("confirmed_m", "is_wary"), [((), True), (0.6, True), (3.0, False)])
def test_full_speed_is_for_floor_that_more_than_looks_tells_to_be_free(
    confirmed_m: float | tuple[()], is_wary: bool
) -> None:
    """What may be camouflaged 0.2 m before it is driven over at the speed that its probability bears."""
    bench, _ = drive_to_thing(3.0)
    scan = bench.view["FreeFloor-1"]
    told = tuple(confirmed_m for _ in scan.value.bearings_rad) if isinstance(confirmed_m, float) else confirmed_m
    bench.revise(scan, confirmed_m=told)
    command = command_of(bench.ask(Motor(), bench.view["Leg-1"]))
    wary = CREEP_M_PER_S / math.sqrt(P_CAMOUFLAGED)
    assert command is not None and command.speed_m_per_s == (pytest.approx(wary, abs=0.1) if is_wary else None)


def test_it_does_not_creep_to_where_something_may_stand_but_halts_the_leg() -> None:
    _, none = drive_to_thing(0.5, suspected=3.0)
    assert command_of(none) is not None
    _, halted = drive_to_thing(0.5, suspected=0.46)
    assert command_of(halted) is None
    effect = effect_on(halted, Leg)
    assert (effect.value.status, effect.value.increments) == ("halted", 0)
    assert {"Leg-1", "Hypothesis-1", "Obstacle-1"} <= reasons(effect)


@given(st.floats(MIN_MOVE_M, 0.57), st.sampled_from([0.05, 0.5, 1.0]), st.floats(0.0, 0.2))
def test_free_way_is_driven_before_a_risk_and_none_is_crept_over_behind_it(at: float, p: float, wide: float) -> None:
    """Moves that end, or begin anew, where a risk begins or ends take less time than one at the speed of the worst."""
    at_m = np.arange(round(at, 3), at + wide + SMALL, 0.05)
    clearance, gone_m, takes_s = Clearance(at_m, np.full(len(at_m), p), 2.0), 0.0, 0.0
    while gone_m < 0.58 - SMALL:
        ahead = Clearance(at_m[at_m >= gone_m - SMALL] - gone_m, clearance.p[at_m >= gone_m - SMALL], 2.0)
        move_m, speed = choose_move(ahead, 0.58 - gone_m, ACTUATOR, CREEP_M_PER_S, 0.2)
        gone_m, takes_s = gone_m + move_m, takes_s + move_m / speed + 0.2
    worst = min(ACTUATOR.speed_m_per_s, CREEP_M_PER_S / math.sqrt(p))
    assert takes_s <= 0.58 / worst + 0.2 + SMALL
    assert p < 1.0 or takes_s < 0.58 / 0.3 + (wide + 0.06) / worst + 0.8


@pytest.mark.parametrize("suspected", [None, 0.7, 0.8, 0.9, 1.1, 1.2, 1.5])
@pytest.mark.parametrize("gap_m", [0.4, 0.5, 0.7, 0.8, 3.0])
def test_the_harm_of_a_touch_is_borne_wherever_one_may_happen(gap_m: float, suspected: float | None) -> None:
    """What stands within the move is met at its speed, what stands behind it at what is left after braking."""
    bench, effects = drive_to_thing(gap_m, suspected=suspected)
    ahead = FloorAhead(bench.view, bench.view["Leg-1"].value, bench.view["Hypothesis-1"], DEFAULT)
    clearance, command = ahead.measure_clearance(1.5), command_of(effects)
    assert command is not None
    speed, move_m = command.speed_m_per_s or ACTUATOR.speed_m_per_s, ACTUATOR.reach * command.move_m
    brakes_m = np.where(clearance.at_m < move_m - SMALL, 0.0, np.maximum(clearance.at_m - LATENCY_S * speed, 0.0))
    met = np.maximum(speed**2 - 2.0 * ACTUATOR.brake_m_per_s2 * brakes_m, 0.0)
    assert (clearance.p * met <= CREEP_M_PER_S**2 + SMALL).all() and move_m <= clearance.room_m + SMALL
    assert speed >= CREEP_M_PER_S


@pytest.mark.parametrize("direction_deg", [-100.0, -60.0, 0.0, 60.0])
@pytest.mark.parametrize("turned_rad", [0.0, 0.4])
@pytest.mark.parametrize("gone_m", [0.0, TOUCH_HOLDS_M])
def test_after_a_touch_that_the_model_explains_it_moves_away_from_it_once(
    direction_deg: float, turned_rad: float, gone_m: float
) -> None:
    """The way leads along a wall; the robot touched, and has turned since."""
    pose, bench = Pose2(3.0, 0.36, 0.0), Bench(plain_robot())
    belief, leg = bench.believe(pose), bench.leg(bench.sketch(Place(HALL, 1.5, 0.36), Place(HALL, 6.5, 0.36)))
    contact = bench.put(Contact("bumper", math.radians(direction_deg), 0.15, 1.0), bench.move(0.0, 0.3)[0])
    for turn_rad, move_m in ((turned_rad, 0.0), (-turned_rad, gone_m)):
        bench.revise(bench.view["Hypothesis-1"], motion=bench.move(turn_rad, move_m)[1].id)
    bench.put(scan_floor(find_floor(house(), [HALL]), to_world(pose), HALL, near_m=0.05, forward_m=0.0, half_rad=3.1,
                         count=400), belief)
    effects = bench.ask(Motor(), leg)
    found, is_on = command_of(effects), abs(direction_deg) > 90.0 or gone_m > 0.0
    free_m = FloorAhead(bench.view, leg.value, bench.view["Hypothesis-1"], DEFAULT).measure_clearance(1.0).free_m
    assert found is not None and free_m == (1.0 if is_on else 0.0)
    assert found.is_creeping != is_on and (contact.id in reasons(effect_on(effects, MotorCommand))) != is_on
    if not is_on:
        assert math.cos(found.turn_rad - math.radians(direction_deg)) < -0.1 and found.move_m > 0.1
        assert 0.36 + 0.15 * math.sin(found.turn_rad) > 0.35  # not against the wall


@given(st.floats(-3.0, 3.0), st.floats(0.011, 0.2), st.floats(0.0, 0.05))
def test_it_does_not_turn_for_less_than_what_the_direction_of_its_aim_is_unknown_by(
    turn_rad: float, gap_m: float, sigma_m: float
) -> None:
    leg, here = Leg("PlanSketch-1", 0, 0.0, 0.0, 1.0, 0.0, 0.01), Pose2(1.0 - gap_m, 0.0, -turn_rad)
    sure, unsure = (plan_increment(ACTUATOR, leg, here, sigma, 0.0, 0.5) for sigma in (0.0, sigma_m))
    assert sure is not None and unsure is not None and (sure.move_m > 0.0) == (abs(turn_rad) <= math.radians(3.0))
    most_rad = max(math.radians(3.0), min(math.atan2(sigma_m, gap_m), ACTUATOR.turn_increment_rad))
    assert unsure == sure if abs(turn_rad) > most_rad else unsure.move_m > 0.0
    assert unsure.move_m == 0.0 or unsure.turn_rad == pytest.approx(turn_rad, abs=0.001)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), gap_m=st.floats(0.011, 0.2))
def test_a_leg_is_not_turned_to_for_ever(seed: int, gap_m: float) -> None:
    """Its end is believed now here and now there, as what is followed shifts the belief while it turns."""
    rng, leg, turned_rad = np.random.default_rng(seed), Leg("PlanSketch-1", 0, 0.0, 0.0, 1.0, 0.0, 0.01), 0.0
    for _ in range(400):
        bearing, side = rng.uniform(-math.pi, math.pi, 2)
        here = Pose2(1.0 + gap_m * math.cos(bearing), gap_m * math.sin(bearing), side)
        command = plan_increment(ACTUATOR, leg, here, 0.0, 0.0, 0.5)
        if command is None:
            break
        turned_rad = 0.0 if command.move_m > 0.0 else turned_rad + abs(command.turn_rad)
        leg = count_increment(leg, command)
        looking = count_increment(replace(leg, looking_rad=0.0), command)
        assert command.move_m > 0.0 or looking.turned_rad == 0.0  # turns to look at the floor do not count
        assert leg.turned_rad == pytest.approx(turned_rad)
        assert turned_rad <= math.tau + ACTUATOR.turn_increment_rad


def test_it_keeps_the_laws_of_all_sources() -> None:
    for source in (BLIND, Motor()):
        check_source(source, *start(Pose2(2.0, 2.0, 0.0)), without=("PlanSketch-1",))
