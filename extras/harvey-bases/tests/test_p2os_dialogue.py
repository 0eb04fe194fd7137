"""What the driver of a Pioneer says, when, and on which statuses it decides: both sides of each of its bounds."""

from __future__ import annotations

import math
from itertools import pairwise, repeat
from typing import Any

import pytest
from hand_made_pioneer import NAMES, HandMadePioneer, connect, from_now_on
from hypothesis import given, settings
from hypothesis import strategies as st

from harvey.hardware.drivers.base_driver import BaseFault
from harvey_bases.p2os import P2osBase
from world_models.entries import AROUND_SIGMA_RAD, MotionReport, MotorCommand
from world_models.entries.obstacle import AHEAD_SIGMA_RAD

PULSE, OPEN, CLOSE, ENABLE, SETV, MOVE, SETRV, HEAD, SONAR, ESTOP = 0, 1, 2, 4, 6, 8, 10, 12, 28, 55
UNIT_RAD = math.tau / 4096


def faulted(driver: P2osBase, command: MotorCommand | None) -> BaseFault:
    """How a command fails, or without one the question where it is."""
    with pytest.raises(BaseFault) as caught:
        driver.odometry() if command is None else driver.execute(command)
    return caught.value


def assert_said_every(interval_s: float, times: list[float]) -> None:
    """At such intervals, or as much later as the driver looks up (0.05 s)."""
    assert len(times) >= 3 and all(interval_s - 1e-9 <= b - a <= interval_s + 0.051 for a, b in pairwise(times))


def test_the_greeting_says_stop_before_each_sync_and_opens() -> None:
    base = HandMadePioneer()
    P2osBase(base).odometry()
    assert [number for _, number, _ in base.said] == [ESTOP, 0, ESTOP, 1, ESTOP, 2, OPEN, ESTOP, PULSE]


def test_a_base_that_talks_already_is_asked_who_it_is_once() -> None:
    base = HandMadePioneer()
    base.is_open = True
    driver = P2osBase(base)
    driver.odometry()
    assert base.told(CLOSE).count(0) >= 1 and [n for _, n, _ in base.said].count(OPEN) >= 1
    base.said.clear()
    driver.odometry()
    assert [number for _, number, _ in base.said] == [PULSE]


@pytest.mark.parametrize(("idle_s", "greets"), [(29.0, False), (31.0, True)])
def test_a_line_that_was_not_used_for_long_is_greeted_anew(idle_s: float, greets: bool) -> None:
    base = HandMadePioneer()
    driver = connect(base)
    base.time_ms += round(1000 * idle_s)
    driver.odometry()
    assert [number for _, number, _ in base.said] == ([ESTOP, PULSE] if greets else []) + [PULSE]


def test_nobody_there_is_told_after_eight_seconds_of_greetings() -> None:
    base = HandMadePioneer()
    base.is_silent = True
    fault = faulted(P2osBase(base), None)
    assert (fault.kind, fault.detail, fault.stopped) == ("silent", "no answer to SYNC", False)
    assert base.now() == pytest.approx(8.0, abs=0.01) and len(base.told(PULSE)) == len(base.told(ESTOP)) == 32
    assert all(b - a == pytest.approx(0.25, abs=0.002) for a, b in pairwise(base.times(ESTOP)))


@pytest.mark.parametrize(
    ("subclass", "mm", "known"),
    [
        ("p3dx-sh", None, True),
        ("powerbot-sh", None, True),
        ("p3dx", None, True),
        ("p2dx", None, False),
        ("p2dx", 0.9, True),
    ],
)
def test_which_units_are_known(subclass: str, mm: float | None, known: bool) -> None:
    driver = P2osBase(HandMadePioneer(names=("R", "Pioneer", subclass)), mm_per_unit=mm)
    if known:
        driver.odometry()
        return
    fault = faulted(driver, None)
    assert fault.kind == "refused" and fault.stopped and repr(subclass) in fault.detail


@settings(deadline=None, max_examples=40)
@given(st.floats(-math.pi, math.pi), st.integers(0, 300), st.none() | st.floats(0.05, 1.0), st.floats(0.0, 359.0))
def test_a_command_is_said_in_the_bases_own_words(
    turn_rad: float, move_mm: int, speed: float | None, begun_deg: float
) -> None:
    """Settings, a heading in whole degrees of the base's own compass (HEAD), and a length in millimetres (MOVE)."""
    base = HandMadePioneer(heading=begun_deg)
    driver = connect(base, speed_m_per_s=0.4, turn_speed_rad_per_s=math.radians(33.0))
    report = driver.execute(MotorCommand(turn_rad, move_mm / 1000.0, speed))
    assert base.told(SETV)[0] == round(1000 * min(0.4, speed or 0.4)) and base.told(SETRV) == [33]
    assert base.told(SONAR) == [0] and set(base.told(ENABLE)) == {1}
    begun = round(begun_deg / 360.0 * 4096) % 4096 * UNIT_RAD
    headings = list(dict.fromkeys(base.told(HEAD)))
    if abs(turn_rad) > 2.0:
        halves = [math.degrees(begun + turn_rad / 2.0) % 360.0, math.degrees(begun + turn_rad) % 360.0]
        assert len(headings) == 2
        assert all(abs(math.remainder(a - b, 360.0)) <= 1.01 for a, b in zip(headings, halves, strict=True))
    elif abs(turn_rad) > math.radians(1.0):
        assert headings == [round(math.degrees(begun + turn_rad)) % 360]
    assert all(0 <= heading < 360 for heading in headings)
    assert base.told(MOVE) == [move_mm] * (move_mm > 0)
    assert report.move_m == pytest.approx(move_mm / 1000.0, abs=0.002)
    assert report.turn_rad == pytest.approx(turn_rad, abs=math.radians(1.2))
    assert report.turn_rad == pytest.approx(math.radians(base.heading_deg - begun_deg), abs=2.0 * UNIT_RAD)
    assert report.sim_time_s == base.now()
    assert 0.0 <= report.duration_s < base.now() and (report.duration_s > 0.0) == bool(
        base.told(MOVE) + base.told(HEAD)
    )


@pytest.mark.parametrize(
    ("turn_deg", "heads"), [(0.4, 0), (-0.4, 0), (0.6, 1), (-0.6, 1), (114.0, 1), (115.0, 2), (-179.0, 2)]
)
def test_small_turns_are_none_and_large_ones_go_in_parts(turn_deg: float, heads: int) -> None:
    base = HandMadePioneer()
    connect(base).turn(math.radians(turn_deg))
    assert len(set(base.told(HEAD))) == heads


@pytest.mark.parametrize(
    ("move_m", "parts"), [(0.0, []), (3.99, [3990]), (4.0, [4000]), (5.0, [2500, 2500]), (8.0, [4000, 4000])]
)
def test_long_moves_go_in_parts(move_m: float, parts: list[int]) -> None:
    base = HandMadePioneer()
    assert connect(base).move(move_m).move_m == pytest.approx(move_m, abs=1e-6)
    assert base.told(MOVE) == parts


def test_a_base_that_moves_hears_from_us_in_time() -> None:
    base = HandMadePioneer()
    connect(base).execute(MotorCommand(1.5, 1.5))
    for number in (HEAD, PULSE):
        assert_said_every(0.4, base.times(number))


def test_a_turn_ends_when_it_was_seen_to_stand_there_twice() -> None:
    base = HandMadePioneer()
    report = connect(base).turn(math.radians(30.0))
    assert report.duration_s == pytest.approx(0.2 + 0.1 * (3 + 2 - 1), abs=0.15)  # enabled, three ticks of 10 degrees


@pytest.mark.parametrize(("misses_deg", "is_there"), [(0.7, True), (-0.7, True), (1.1, False), (-1.1, False)])
def test_a_heading_is_reached_within_a_degree(misses_deg: float, is_there: bool) -> None:
    base = HandMadePioneer()
    base.misses_deg = misses_deg
    driver = connect(base, turn_speed_rad_per_s=0.5)
    if is_there:
        assert driver.turn(math.radians(50.0)).turn_rad == pytest.approx(math.radians(50.0 - misses_deg), abs=UNIT_RAD)
        return
    began_s = base.now()
    fault = faulted(driver, MotorCommand(math.radians(50.0), 0.0))
    assert (fault.kind, fault.detail, fault.stopped) == ("stalled", "the turn came to nothing", True)
    assert base.now() - began_s == pytest.approx(2.0 * math.radians(50.0) / 0.5 + 4.0, abs=0.8)
    assert base.told(ESTOP) and fault.done is not None


@pytest.mark.parametrize(("short_mm", "moves"), [(0, [600]), (9, [600]), (11, [600, 11])])
def test_a_move_that_falls_short_is_asked_for_again_by_what_is_left(short_mm: int, moves: list[int]) -> None:
    base = HandMadePioneer()
    base.shortens = lambda asked: asked - short_mm if asked == 600 else asked
    assert connect(base).move(0.6).move_m == pytest.approx(0.6 - short_mm / 1000.0 * (len(moves) == 1), abs=1e-6)
    assert base.told(MOVE) == moves


def test_a_move_goes_on_as_long_as_it_gets_on() -> None:
    base = HandMadePioneer()
    base.shortens = lambda asked: asked // 2
    connect(base).move(0.8)
    assert base.told(MOVE) == [800, 400, 200, 100, 50, 25, 13]


@pytest.mark.parametrize(("gets_mm", "ends"), [(6, True), (4, False)])
def test_five_tries_that_come_to_nothing_are_a_stall(gets_mm: int, ends: bool) -> None:
    """Five millimetres are something."""
    base = HandMadePioneer()
    base.shortens = lambda asked: min(asked, gets_mm)
    driver = connect(base)
    if ends:
        assert driver.move(0.05).move_m == pytest.approx(0.04, abs=0.0021)
        assert base.told(MOVE) == [50, 44, 38, 32, 26, 20, 14]
        return
    fault = faulted(driver, MotorCommand(0.0, 0.05))
    assert (fault.kind, fault.detail) == ("stalled", "the move came to nothing")
    assert base.told(MOVE) == [50, 46, 42, 38, 34] and fault.done is not None
    assert fault.done.move_m == pytest.approx(0.02, abs=1e-6)


def test_a_move_that_takes_too_long_is_given_up() -> None:
    """Twice the time that it takes, and six seconds."""
    base = HandMadePioneer()
    base.spoil = lambda status: status | {"moving": bool(base.told(MOVE)) and not base.told(ESTOP)[2:]}
    base.shortens = lambda asked: 100
    driver = connect(base, speed_m_per_s=0.25)
    began_s = base.now()
    fault = faulted(driver, MotorCommand(0.0, 0.5))
    assert fault.kind in ("stalled", "nonsense") and base.now() - began_s == pytest.approx(
        2.0 * 0.5 / 0.25 + 6.0, abs=4.6
    )


@pytest.mark.parametrize(
    ("command", "field", "amount", "detail"),
    [
        (MotorCommand(1.0, 0.0), "x", 39, None),
        (MotorCommand(1.0, 0.0), "x", -39, None),
        (MotorCommand(1.0, 0.0), "x", 41, "it moved while it was to turn"),
        (MotorCommand(1.0, 0.0), "y", -41, "it moved while it was to turn"),
        (MotorCommand(0.0, 1.0), "heading", 66, None),
        (MotorCommand(0.0, 1.0), "heading", -66, None),
        (MotorCommand(0.0, 1.0), "heading", 71, "it turned while it was to move"),
        (MotorCommand(0.0, 1.0), "heading", -71, "it turned while it was to move"),
        (MotorCommand(0.0, 0.1), "x", 38, None),
        (MotorCommand(0.0, 0.1), "x", 42, "it moved beyond what it was told to"),
        (MotorCommand(0.0, 0.1), "x", -138, None),
        (MotorCommand(0.0, 0.1), "x", -142, "it moved beyond what it was told to"),
        (MotorCommand(1.0, 0.0), "heading", 66, None),
        (MotorCommand(1.0, 0.0), "heading", 74, "it turned beyond what it was told to"),
        (MotorCommand(-1.0, 0.0), "heading", -66, None),
        (MotorCommand(-1.0, 0.0), "heading", -74, "it turned beyond what it was told to"),
    ],
)
def test_a_motion_that_strays_is_none_of_ours(
    command: MotorCommand, field: str, amount: int, detail: str | None
) -> None:
    """Counted 40 mm or 6 degrees (68 units) off, near the end of a turn or of a move, for one status."""
    base = HandMadePioneer(x=1000.0, y=1000.0)
    driver = connect(base)
    number = MOVE if command.move_m else HEAD
    seen = 0

    def tell(status: dict[str, Any]) -> dict[str, Any]:
        nonlocal seen
        seen += bool(base.told(number)) and not status["moving"]
        return status | ({field: (status[field] + amount) % 4096} if seen == 1 and base.told(number) else {})

    base.spoil = tell
    if detail is None:
        driver.execute(command)
        return
    fault = faulted(driver, command)
    assert (fault.kind, fault.detail, fault.stopped) == ("nonsense", detail, True)


@pytest.mark.parametrize(
    ("flags", "statuses", "by"),
    [
        ({"stalled": True}, 4, None),
        ({"stalled": True}, 5, "stall"),
        ({"front": 1}, 4, None),
        ({"front": 1}, 5, "bumper"),
        ({"rear": 16}, 4, None),
        ({"rear": 16}, 5, "bumper"),
    ],
)
@pytest.mark.parametrize("command", [MotorCommand(1.5, 0.0), MotorCommand(0.0, 1.0)])
def test_what_holds_it_for_five_statuses_is_a_stall(
    flags: dict[str, Any], statuses: int, by: str | None, command: MotorCommand
) -> None:
    base = HandMadePioneer()
    driver = connect(base)
    held = iter(range(statuses))
    number = MOVE if command.move_m else HEAD
    base.spoil = lambda status: status | flags if base.told(number) and next(held, None) is not None else status
    if by is None:
        driver.execute(command)
        assert driver.take_contact() is None
        return
    fault, contact = faulted(driver, command), driver.take_contact()
    assert fault.kind == "stalled" and contact is not None and contact.by == by
    what = "move" if command.move_m else "turn"
    assert fault.detail == f"the {what} came to nothing" + (": a motor is held" if by == "stall" else "")
    assert by == "bumper" or contact.sigma_rad == (AHEAD_SIGMA_RAD if command.move_m else AROUND_SIGMA_RAD)


@pytest.mark.parametrize("sign", [{"moving": True}, {"left": 1}, {"right": -1}])
def test_it_is_told_to_stop_until_it_was_seen_to_stand_twice(sign: dict[str, Any]) -> None:
    base = HandMadePioneer()
    driver = connect(base)
    base.spoil = from_now_on([{}, sign, {}, sign])
    driver.stop()
    assert base.now() - base.times(ESTOP)[0] == pytest.approx(
        0.6, abs=0.001
    )  # stands, not, stands, not, stands, stands
    assert_said_every(0.1, base.times(ESTOP))


def test_a_base_that_cannot_be_stopped_is_told_of_after_four_seconds() -> None:
    base = HandMadePioneer()
    driver = connect(base)
    base.spoil = from_now_on(repeat({"moving": True}))
    began_s = base.now()
    with pytest.raises(BaseFault, match="told to stop, it goes on") as caught:
        driver.stop()
    assert caught.value.kind == "nonsense" and not caught.value.stopped
    assert base.now() - began_s == pytest.approx(4.0, abs=0.11)
    assert_said_every(0.1, base.times(ESTOP))


def test_a_base_that_moves_unasked_is_stopped() -> None:
    base = HandMadePioneer()
    driver = connect(base)
    base.spoil = from_now_on([{"moving": True}])
    fault = faulted(driver, None)
    assert (fault.kind, fault.stopped) == ("nonsense", True) and base.told(ESTOP)


def test_motors_that_stay_off_are_a_refusal_after_two_seconds() -> None:
    base = HandMadePioneer()
    driver = connect(base)
    base.spoil = from_now_on(repeat({"enabled": False}))
    began_s = base.now()
    fault = faulted(driver, MotorCommand(0.0, 1.0))
    assert fault.kind == "refused" and fault.stopped and not base.told(MOVE)
    assert base.now() - began_s == pytest.approx(2.2, abs=0.15)
    assert_said_every(0.1, base.times(ENABLE))


@pytest.mark.parametrize(("silence_s", "fails"), [(0.5, False), (0.9, True)])
def test_silence_in_a_motion_ends_it_with_three_stops(silence_s: float, fails: bool) -> None:
    """Patience is 0.7 s."""
    base = HandMadePioneer()
    driver = connect(base)

    def tell(status: dict[str, Any]) -> dict[str, Any]:
        begun = base.times(MOVE)
        base.is_silent = bool(begun) and 0.3 < base.now() - begun[0] <= 0.3 + silence_s
        return status

    base.spoil = tell
    if not fails:
        assert driver.move(1.0).move_m == pytest.approx(1.0, abs=1e-6)
        return
    before = len(base.told(ESTOP))
    fault = faulted(driver, MotorCommand(0.0, 1.0))
    assert (fault.kind, fault.detail, fault.stopped) == ("silent", "nothing heard for 0.7 s", False)
    stops = base.times(ESTOP)[before:]
    assert stops[-3:] == [base.now()] * 3 and base.now() - base.times(MOVE)[0] == pytest.approx(0.3 + 0.75, abs=0.06)
    base.time_ms += 1000
    base.is_silent = False
    base.said.clear()
    driver.odometry()
    assert base.said[0][1:] == (ESTOP, 0)


@pytest.mark.parametrize(("per_status", "heard"), [(2, 16), (1, 14)])
def test_each_sonar_is_heard_once_or_time_is_up(per_status: int, heard: int) -> None:
    """Ten statuses a second for a second and a half."""
    base = HandMadePioneer()
    driver = connect(base)
    told = 0

    def tell(status: dict[str, Any]) -> dict[str, Any]:
        nonlocal told
        first, told = told, told + per_status
        return status | {"sonars": tuple((number % 16, 1000 + number) for number in range(first, told))}

    base.spoil = tell
    ranges = driver.ranges()
    assert ranges is not None and len(ranges.distances_m) in (heard, heard + (per_status == 1))
    assert base.told(SONAR)[0] == 1 and ranges.when_s == base.now()
    driver.move(0.1)
    assert base.told(SONAR)[-1] == 1


def test_nothing_done_is_reported_as_nothing() -> None:
    base = HandMadePioneer(names=NAMES)
    report = connect(base).execute(MotorCommand(0.0, 0.0))
    assert isinstance(report, MotionReport) and (report.turn_rad, report.move_m) == (0.0, 0.0)
    assert base.told(HEAD) == base.told(MOVE) == []
