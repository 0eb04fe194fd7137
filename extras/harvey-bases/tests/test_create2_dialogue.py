"""A Create 2's odometry, what its driver says to it, and on which reports it decides: both sides of each bound."""

from __future__ import annotations

import cmath
import math
from itertools import pairwise
from typing import Any

import pytest
from hand_made_create import M_PER_COUNT, STREAMED, HandMadeCreate, connect
from hypothesis import given, settings
from hypothesis import strategies as st

from harvey.hardware.drivers.base_driver import BaseFault
from harvey_bases.create2 import Create2Base
from world_models.entries import AROUND_SIGMA_RAD, MotorCommand
from world_models.entries.obstacle import AHEAD_SIGMA_RAD

AXLE_M, TICK_S = 0.235, 0.02
TURN, MOVE = MotorCommand(1.5, 0.0), MotorCommand(0.0, 0.5)


def faulted(driver: Create2Base, command: MotorCommand | None) -> BaseFault:
    """How a command fails, or without one the question where it is."""
    with pytest.raises(BaseFault) as caught:
        driver.odometry() if command is None else driver.execute(command)
    return caught.value


@settings(deadline=None, max_examples=40)
@given(st.floats(-15.0, 15.0), st.floats(-15.0, 15.0),
       st.lists(st.tuples(st.integers(-90, 90), st.integers(-90, 90)), min_size=1, max_size=25))
def test_the_way_is_the_sum_of_what_the_wheels_count(
    right_m: float, left_m: float, steps: list[tuple[int, int]]
) -> None:
    """Both ahead by their mean along the heading, then a turn by their difference over the axle; over the wraps too."""
    base = HandMadeCreate(right_m, left_m)
    driver = connect(base)
    at, heading = 0j, 0.0
    counted = [round(right_m / M_PER_COUNT), round(left_m / M_PER_COUNT)]
    for step in steps:
        counted = [counted[0] + step[0], counted[1] + step[1]]
        base.right_m, base.left_m = (count * M_PER_COUNT for count in counted)
        right, left = (count * M_PER_COUNT for count in step)
        at += (right + left) / 2.0 * cmath.exp(1j * heading)
        heading += (right - left) / AXLE_M
        there = driver.odometry()
        assert complex(there.x_m, there.y_m) == pytest.approx(at, abs=1e-9)
        assert math.remainder(there.heading_rad - heading, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert there.time_s == base.now()


@pytest.mark.parametrize(("jump_m", "reports", "counted"), [
    (0.041, 1, True), (-0.041, 1, True), (0.043, 2, True), (0.053, 2, True), (0.055, 3, True), (-0.99, 3, True),
    (0.99, 3, True), (1.01, 3, False), (-1.01, 3, False), (5.0, 3, False),
])
@pytest.mark.parametrize("side", ["right_m", "left_m"])
def test_a_jump_is_doubted_until_there_was_time_for_it_or_it_is_told_three_times(
    jump_m: float, reports: int, counted: bool, side: str
) -> None:
    """0.03 m and 0.6 m/s for each wheel; a jump of a metre is a base that counts again."""
    base = HandMadeCreate()
    driver = connect(base)
    setattr(base, side, jump_m)
    base.time_ms = base.time_ms // 20 * 20
    began_s = base.now()
    there = driver.odometry()
    assert base.now() - began_s == pytest.approx(reports * TICK_S)
    assert there.x_m == pytest.approx(jump_m / 2.0 if counted else 0.0, abs=1e-3)
    turned = jump_m / AXLE_M * (1.0 if side == "right_m" else -1.0) if counted else 0.0
    assert math.remainder(there.heading_rad - turned, math.tau) == pytest.approx(0.0, abs=5e-3)


@settings(deadline=None, max_examples=20)
@given(st.floats(-3.0, 3.0), st.floats(0.0, 0.6), st.none() | st.floats(0.03, 0.4))
def test_a_command_is_said_as_wheel_speeds_fast_and_at_last_slowly(
    turn_rad: float, move_m: float, speed: float | None
) -> None:
    base = HandMadeCreate()
    driver = connect(base)
    report = driver.execute(MotorCommand(turn_rad, move_m, speed))
    assert report.turn_rad == pytest.approx(turn_rad, abs=0.012) and report.move_m == pytest.approx(move_m, abs=0.005)
    assert report.turn_rad == pytest.approx((base.right_m - base.left_m) / AXLE_M, abs=0.004)
    assert report.sim_time_s == base.now() and report.duration_s <= base.now()
    drives = [speeds for speeds in base.drives() if speeds != (0, 0)]
    way, sign = abs(turn_rad) * AXLE_M / 2.0, 1 if turn_rad >= 0.0 else -1
    turning = [(sign * s, -sign * s) for s in (79, 29)]
    expected = turning[way <= 0.03:] if way >= M_PER_COUNT else []
    fast = max(s for s in range(1, 201) if s <= (1000.0 * speed if speed else 200) and not {s, 256 - s} & FORBIDDEN)
    moving = list(dict.fromkeys([(fast, fast), (min(fast, 57),) * 2]))
    expected += moving[move_m <= 0.03 and len(moving) > 1:] if move_m >= M_PER_COUNT else []
    assert drives == expected


FORBIDDEN = {7, *range(128, 174)}


@pytest.mark.parametrize("command", [TURN, MOVE])
def test_the_last_three_centimetres_are_slow(command: MotorCommand) -> None:
    base = HandMadeCreate()
    driver = connect(base)
    seen: list[tuple[float, int]] = []
    base.wheels = lambda right, left: (bool(seen.append((base.right_m, base.wanted[0]))) or right, left)
    driver.execute(command)
    goal_m = command.move_m or command.turn_rad * AXLE_M / 2.0
    first_slow_m = next(m for m, speed in seen if speed in (57, 29))
    assert goal_m - first_slow_m == pytest.approx(0.028, abs=0.0021)
    assert base.right_m == pytest.approx(goal_m, abs=0.0015)


def test_it_is_woken_made_safe_and_seen_to_stand_before_it_is_believed() -> None:
    base = HandMadeCreate()
    Create2Base(base).odometry()
    assert {opcode for _, opcode, _ in base.said} == {128, 131, 145, 148, 150}
    assert all(values in (STREAMED, (6, *STREAMED)) for _, opcode, values in base.said if opcode == 148)
    assert base.drives() == [(0, 0)] and base.now() < 0.6
    times = base.times(131)
    assert all(0.03 - 1e-9 <= b - a <= 0.051 for a, b in pairwise(times))


def test_to_a_base_that_stands_nothing_more_is_said() -> None:
    base = HandMadeCreate()
    driver = connect(base)
    began_s = base.now()
    driver.stop()
    assert base.now() - began_s == pytest.approx(3.0 * TICK_S, abs=0.011)
    assert len(base.times(145)) == 1 and len(base.times(131)) == 1


def test_a_base_that_cannot_be_safe_stands_after_a_while() -> None:
    base = HandMadeCreate()
    driver = connect(base)
    base.spoil = lambda report: report | {"mode": 1}
    began_s = base.now()
    driver.stop()
    assert base.now() - began_s == pytest.approx(0.62, abs=0.03)


@pytest.mark.parametrize(("spoilt", "kind", "detail"), [
    ({"wanted": (1, 0)}, "nonsense", "told to stop, it goes on"), ({"wanted": (0, -1)}, "nonsense", "it goes on"),
    (None, "silent", "no stream"),
])
def test_a_base_that_cannot_be_stopped_is_told_of_after_two_and_a_half_seconds(
    spoilt: dict[str, Any] | None, kind: str, detail: str
) -> None:
    base = HandMadeCreate()
    driver = connect(base)
    base.spoil = lambda report: report | (spoilt or {})
    base.is_silent = spoilt is None
    began_s = base.now()
    with pytest.raises(BaseFault, match=detail) as caught:
        driver.stop()
    assert caught.value.kind == kind and base.now() - began_s == pytest.approx(2.5, abs=0.04)
    if spoilt is not None:
        assert len(base.times(145)) >= 40
    else:  # after stops that nobody answered it is asked to tell, and then woken, which makes it stand too
        assert len(base.times(145)) >= 4 and len(base.times(148)) >= 60
        assert base.times(148)[0] - began_s == pytest.approx(0.23, abs=0.04)
        assert base.times(128)[0] - began_s == pytest.approx(0.53, abs=0.04)


def test_wheels_that_creep_do_not_stand() -> None:
    base = HandMadeCreate()
    driver = connect(base)
    base.wheels = lambda right, left: (right + M_PER_COUNT, left)
    with pytest.raises(BaseFault, match="told to stop, it goes on"):
        driver.stop()


@pytest.mark.parametrize(("spoilt", "kind", "detail", "sigma_rad"), [
    ({"mode": 1}, "refused", "it left the safe mode (mode 1)", None),
    ({"mode": 3, "bumps": 4}, "refused", "it left the safe mode (mode 3): a wheel hangs in the air", None),
    ({"mode": 1, "bumps": 8}, "refused", "it left the safe mode (mode 1): a wheel hangs in the air", None),
    ({"mode": 1, "bumps": 2}, "refused", "it left the safe mode (mode 1)", None),
    ({"bumps": 1}, "stalled", "its bumper is pressed", math.radians(90.0) / math.sqrt(12.0)),
    ({"bumps": 3}, "stalled", "its bumper is pressed", math.radians(30.0) / math.sqrt(12.0)),
    ({"bumps": 12}, None, "", None), ({}, None, "", None),
])
@pytest.mark.parametrize("command", [TURN, MOVE])
def test_what_a_single_report_ends(
    spoilt: dict[str, Any], kind: str | None, detail: str, sigma_rad: float | None, command: MotorCommand
) -> None:
    base = HandMadeCreate()
    driver = connect(base)
    left = iter(range(6))
    base.spoil = lambda report: report | spoilt if any(base.wanted) and next(left, None) == 5 else report
    if kind is None:
        driver.execute(command)
        return
    fault, contact = faulted(driver, command), driver.take_contact()
    assert (fault.kind, fault.detail, fault.stopped) == (kind, detail, True) and base.wanted == (0, 0)
    assert (contact is None) == (sigma_rad is None)
    assert contact is None or contact.sigma_rad == pytest.approx(sigma_rad)


@pytest.mark.parametrize(("held_s", "ends"), [(0.76, False), (0.86, True)])
@pytest.mark.parametrize("command", [TURN, MOVE])
def test_wheels_that_do_not_get_on_for_so_long_are_held(held_s: float, ends: bool, command: MotorCommand) -> None:
    base = HandMadeCreate()
    driver = connect(base)
    left = iter(range(round(held_s / TICK_S) + 5))

    def wheels(right: float, left_m: float) -> tuple[float, float]:
        at = next(left, None) if right or left_m else None
        return (0.0, 0.0) if at is not None and at >= 5 else (right, left_m)

    base.wheels = wheels
    if not ends:
        driver.execute(command)
        return
    fault, contact = faulted(driver, command), driver.take_contact()
    assert (fault.kind, fault.detail) == ("stalled", "its wheels are held") and contact is not None
    assert contact.sigma_rad == (AHEAD_SIGMA_RAD if command.move_m else AROUND_SIGMA_RAD)
    assert contact.when_s == pytest.approx(base.now(), abs=0.2)


@pytest.mark.parametrize(("command", "right_m", "left_m", "astray"), [
    (MOVE, -0.055, -0.055, True), (MOVE, -0.045, -0.045, False), (MOVE, 0.019, -0.019, False),
    (MOVE, 0.021, -0.021, True), (MOVE, -0.021, 0.021, True), (TURN, 0.019, 0.019, False), (TURN, 0.021, 0.021, True),
    (TURN, -0.021, -0.021, True), (TURN, -0.055, 0.055, True), (TURN, -0.045, 0.045, False),
])
def test_wheels_that_go_as_they_were_not_told_to_are_stopped(
    command: MotorCommand, right_m: float, left_m: float, astray: bool
) -> None:
    """From the start of the motion on: 50 mm back, or 20 mm apart in a move and together in a turn."""
    base = HandMadeCreate()
    driver = connect(base)
    jolts = iter((1.0, -1.0)) if not astray else iter((1.0,))

    def wheels(right: float, left: float) -> tuple[float, float]:
        if not (right or left):
            return right, left
        jolt = next(jolts, 0.0)
        return (jolt * right_m, jolt * left_m) if jolt else (right, left)

    base.wheels = wheels
    if not astray:
        driver.execute(command)
        return
    fault = faulted(driver, command)
    assert (fault.kind, fault.detail) == ("nonsense", "its wheels did not go as they were told to")


@pytest.mark.parametrize(("wrong_s", "ends"), [(0.26, False), (0.36, True)])
def test_speeds_that_it_does_not_take_over_are_said_again_until_it_is_enough(wrong_s: float, ends: bool) -> None:
    base = HandMadeCreate()
    driver = connect(base)
    left = iter(range(round(wrong_s / TICK_S)))
    base.spoil = lambda report: (
        report | {"wanted": (1, 2)} if any(base.wanted) and next(left, None) is not None else report)
    if not ends:
        driver.execute(MOVE)
    else:
        fault = faulted(driver, MOVE)
        assert fault.detail == "it does not take over the wheel speeds that it is told" and fault.kind == "nonsense"
    begun = [when for when, opcode, values in base.said if opcode == 145 and values == (200, 200)]
    repeats = [b - a for a, b in pairwise(begun)]
    assert len(repeats) in (6, 7, 8, 9) and all(0.03 < gap < 0.05 for gap in repeats)


@pytest.mark.parametrize(("silence_s", "ends"), [(0.30, False), (0.42, True)])
def test_silence_in_a_motion_ends_it(silence_s: float, ends: bool) -> None:
    base = HandMadeCreate()
    driver = connect(base)

    def wheels(right: float, left: float) -> tuple[float, float]:
        begun = [when for when, opcode, values in base.said if opcode == 145 and any(values)]
        base.is_silent = bool(begun) and 0.3 < base.now() - begun[0] <= 0.3 + silence_s
        return right, left

    base.wheels = wheels
    if not ends:
        assert driver.execute(MotorCommand(0.0, 0.4)).move_m == pytest.approx(0.4, abs=0.005)
        return
    fault = faulted(driver, MOVE)
    assert (fault.kind, fault.detail, fault.stopped) == ("silent", "nothing heard for 0.35 s", True)


@pytest.mark.parametrize("wanted", [(1, 0), (0, -1)])
def test_a_base_that_moves_unasked_is_stopped(wanted: tuple[int, int]) -> None:
    base = HandMadeCreate()
    driver = connect(base)
    base.time_ms += 100
    left = iter(range(1))
    base.spoil = lambda report: report | ({"wanted": wanted} if next(left, None) is not None else {})
    fault = faulted(driver, None)
    assert (fault.kind, fault.stopped) == ("nonsense", True) and "nobody had asked" in fault.detail
    assert base.drives() == [(0, 0)]


def test_a_base_that_left_the_safe_mode_is_made_safe_again() -> None:
    base = HandMadeCreate()
    driver = connect(base)
    base.mode = 1
    driver.odometry()
    assert base.mode == 2


def test_the_light_bumper_is_streamed_once_it_is_asked_for() -> None:
    base = HandMadeCreate()
    driver = connect(base)
    base.spoil = lambda report: report | {"lights": (4095, 20, 19, 0, 1000, 100)}
    ranges = driver.ranges()
    assert ranges is not None and ranges.distances_m[0] == pytest.approx(0.17)
    assert [distance is None for distance in ranges.distances_m] == [False, False, True, True, False, False]
    assert base.streamed == (*STREAMED, *range(46, 52)) and base.now() < 0.5
    base.said.clear()
    assert driver.ranges() is not None and not base.times(148)
    driver.move(0.1)


def test_a_base_without_a_light_bumper_measures_nothing() -> None:
    base = HandMadeCreate()
    driver = connect(base)
    base.has_lights = False
    began_s = base.now()
    assert driver.ranges() is None and base.now() - began_s == pytest.approx(0.7, abs=0.03)
    gaps = [b - a for a, b in pairwise(base.times(148))]
    assert len(gaps) > 5 and all(0.03 < gap < 0.05 for gap in gaps)


def test_a_motion_that_takes_too_long_is_given_up() -> None:
    """Twice what the slow speed takes, and two seconds."""
    base = HandMadeCreate()
    driver = connect(base)
    base.wheels = lambda right, left: (0.01 * right, 0.01 * left)
    began_s = base.now()
    fault = faulted(driver, MotorCommand(0.0, 0.2))
    assert fault.kind == "stalled" and fault.done is not None
    if fault.detail == "not done in time":
        assert base.now() - began_s == pytest.approx(2.0 * 0.2 / 0.057 + 2.0, abs=0.4)
