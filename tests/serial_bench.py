"""What any base must keep, over its driver and its emulator, whoever wrote them: each check takes a bench or a kind."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Decision
from experiments.robustness.serial_chaos import NOISES, Trial
from experiments.robustness.serial_line import Findings, Killed, Noise, NoisyLine
from harvey.hardware.bases import base_kinds
from harvey.hardware.drivers.base_driver import Base, BaseFault
from harvey.runner.result import MissionResult
from harvey.simulation.serial_body import emulator_kinds
from harvey.simulation.simulated_run import run_mission
from sim.body.simulated_body import SimulatedBody
from sim.emulators.emulator import IdealGround
from sim.emulators.line import EmulatedLine
from sim.faults.fault_registry import find_fault_class
from sim.stage import Stage
from world_models.entries import AROUND_SIGMA_RAD, BodyFault, MotorCommand, Recovery
from world_models.entries.obstacle import AHEAD_SIGMA_RAD

NEAR_M, NEAR_RAD = 0.011, math.radians(1.0)
MUDDLED_M, MUDDLED_RAD = 0.015, math.radians(1.2)
COMMANDS = (MotorCommand(0.4, 0.5), MotorCommand(0.0, 0.2), MotorCommand(-0.7, 0.0), MotorCommand(0.2, 0.7))


@dataclass
class Bench:
    """A driver, the base that it drives, and the line between them."""

    kind: str
    floor: IdealGround
    end: Any
    line: Any
    base: Base


def put_on_noisy_line(end: Any, noise: float = 0.0, seed: int = 0) -> NoisyLine:
    """A line in memory, with so many errors a message."""
    rng = np.random.default_rng(seed)
    return NoisyLine(end, Noise(rng, noise), Noise(rng, noise), tick_s=0.01)


def over_line_in_memory(kind: str, floor: IdealGround, noise: float = 0.0, seed: int = 0) -> Bench:
    """Over a line in memory, which may be noisy and may be broken."""
    end = emulator_kinds()[kind].on_ground(floor)
    line = put_on_noisy_line(end, noise, seed)
    return Bench(kind, floor, end, line, base_kinds()[kind].connect_to_emulator(line))


@contextmanager
def over_emulated_line(kind: str) -> Iterator[Bench]:
    """Over a mission's line; a base that counts its wheels' turns begins shortly before its counters wrap."""
    floor = IdealGround()
    end: Any = emulator_kinds()[kind].on_ground(floor)
    if hasattr(end, "first_count"):
        end.first_count = 65_500
        end.power_cycle()
    line = EmulatedLine(end)
    bench = Bench(kind, floor, end, line, base_kinds()[kind].connect_to_emulator(line))
    try:
        yield bench
    finally:
        bench.base.close()


def faulted(call: Callable[[], object]) -> BaseFault:
    with pytest.raises(BaseFault) as caught:
        call()
    return caught.value


def check_a_turn_and_a_move_come_out_as_asked_and_as_reported(bench: Bench, turn: float) -> None:
    report = bench.base.execute(MotorCommand(turn, 0.61))
    assert bench.floor.turned_rad == pytest.approx(turn, abs=NEAR_RAD)
    assert bench.floor.moved_m == pytest.approx(0.61, abs=NEAR_M)
    assert report.turn_rad == pytest.approx(bench.floor.turned_rad, abs=0.004)
    assert report.move_m == pytest.approx(bench.floor.moved_m, abs=0.002)
    assert report.duration_s > 0.0


def check_odometry_follows_a_way_with_corners_and_counters_that_wrap(bench: Bench) -> None:
    began = bench.base.odometry()
    for _ in range(4):
        bench.base.execute(MotorCommand(math.pi / 2.0 + 0.2, 9.0 if bench.kind == "p2os" else 2.0))
    there, pose = bench.base.odometry(), bench.floor.pose
    away_m, turned_rad = math.hypot(there.x_m - began.x_m, there.y_m - began.y_m), there.heading_rad - began.heading_rad
    assert away_m == pytest.approx(math.hypot(pose.x_m, pose.y_m), abs=0.05)
    assert math.remainder(turned_rad - pose.heading_rad, 2 * math.pi) == pytest.approx(0, abs=0.02)


def check_nothing_asked_is_nothing_done(bench: Bench) -> None:
    report = bench.base.execute(MotorCommand(0.0, 0.0))
    assert (report.turn_rad, report.move_m) == (0.0, 0.0)
    assert bench.floor.moved_m == bench.floor.turned_rad == 0.0


def check_wheels_that_are_held_are_a_fault_and_the_base_stands(bench: Bench) -> None:
    bench.base.heartbeat()
    bench.floor.held = True
    fault = faulted(lambda: bench.base.move(1.0))
    assert fault.kind == "stalled" and fault.stopped and not bench.end.moving
    assert fault.done is not None and fault.done.move_m == pytest.approx(0.0, abs=1e-6)
    bench.floor.held = False
    assert bench.base.move(0.2).move_m == pytest.approx(0.2, abs=NEAR_M)


def check_a_driver_that_was_closed_says_so(bench: Bench) -> None:
    bench.base.close()
    bench.base.close()
    assert faulted(lambda: bench.base.move(0.1)).kind == "disconnected"


def check_a_command_that_is_no_motion_is_the_callers_mistake(bench: Bench) -> None:
    for turn, move in ((math.nan, 0.1), (math.inf, 0.1), (0.0, math.inf)):
        with pytest.raises(ValueError, match="finite"):
            bench.base.execute(MotorCommand(turn, move))


ON_EMULATED_LINE: tuple[Callable[[Bench], None], ...] = (
    *(partial(check_a_turn_and_a_move_come_out_as_asked_and_as_reported, turn=turn)
      for turn in (0.3, -0.3, 2.8, -2.8, 4.5)),
    check_odometry_follows_a_way_with_corners_and_counters_that_wrap,
    check_nothing_asked_is_nothing_done,
    check_wheels_that_are_held_are_a_fault_and_the_base_stands,
    check_a_driver_that_was_closed_says_so,
    check_a_command_that_is_no_motion_is_the_callers_mistake,
)


def check_a_stop_from_another_thread_breaks_a_motion_off(bench: Bench) -> None:
    bench.base.heartbeat()
    real, calls = bench.line.read, 0
    asked: threading.Event = vars(bench.base)["_stop_asked"]
    stopper = threading.Thread(target=bench.base.stop)

    def read(timeout_s: float) -> bytes:
        nonlocal calls
        calls += 1
        if calls == 40:
            stopper.start()
            asked.wait(10.0)
        return real(timeout_s)

    bench.line.read = read
    fault = faulted(lambda: bench.base.move(5.0))
    stopper.join()
    assert fault.kind == "stopped" and fault.stopped and not bench.end.moving
    assert fault.done is not None and fault.done.move_m == pytest.approx(bench.floor.moved_m, abs=0.02)
    assert 0.0 < bench.floor.moved_m < 4.9
    assert bench.base.move(0.1).move_m == pytest.approx(0.1, abs=NEAR_M)


def check_a_cut_cable_is_told_with_what_had_been_done_and_a_new_one_is_taken_up(bench: Bench) -> None:
    bench.base.heartbeat()
    bench.line.break_after(60, 1.0)
    fault = faulted(lambda: bench.base.move(5.0))
    assert fault.kind == "disconnected" and not fault.stopped
    assert fault.done is not None and 0.0 < fault.done.move_m < 5.0
    assert faulted(bench.base.heartbeat).kind == "disconnected"
    bench.line.wait(4.0)
    bench.base.stop()
    assert not bench.end.moving
    assert bench.base.turn(0.5).turn_rad == pytest.approx(0.5, abs=NEAR_RAD)


def check_a_base_that_is_not_there_is_silent(bench: Bench) -> None:
    bench.end.receive = lambda data: None
    fault = faulted(lambda: bench.base.move(1.0))
    assert fault.kind == "silent" and bench.line.now() < 15.0


def check_a_base_that_answers_nonsense_is_a_fault_that_tells_of_the_noise(bench: Bench) -> None:
    bench.end.take = lambda: b"\xfa\xfb\x05what\x13\x10ever*\n#"
    fault = faulted(lambda: bench.base.move(1.0))
    assert fault.kind == "silent" and "noise" in fault.detail


def check_a_base_that_lost_power_is_taken_up_again(bench: Bench) -> None:
    bench.base.move(0.2)
    bench.end.power_cycle()
    for _ in range(2):
        try:
            assert bench.base.move(0.3).move_m == pytest.approx(0.3, abs=NEAR_M)
            break
        except BaseFault as fault:
            assert fault.done is None or fault.done.move_m == 0.0
    assert bench.floor.moved_m == pytest.approx(0.5, abs=2 * NEAR_M)


ON_LINE_IN_MEMORY: tuple[Callable[[Bench], None], ...] = (
    check_a_stop_from_another_thread_breaks_a_motion_off,
    check_a_cut_cable_is_told_with_what_had_been_done_and_a_new_one_is_taken_up,
    check_a_base_that_is_not_there_is_silent,
    check_a_base_that_answers_nonsense_is_a_fault_that_tells_of_the_noise,
    check_a_base_that_lost_power_is_taken_up_again,
)


def check_the_bases_own_watchdog_stops_it_when_the_host_dies(bench: Bench) -> None:
    bench.base.heartbeat()
    bench.line.break_after(60, math.inf)
    with pytest.raises(Killed):
        bench.base.move(5.0)
    assert bench.end.moving
    bench.line.wait(bench.end.standing_within_s + 0.01)
    assert not bench.end.moving and bench.end.stops == 1


class MuddledLine:
    """A good line that also delivers what it delivered before, or delivers it later than what came after."""

    def __init__(self, line: NoisyLine, how: str, seed: int) -> None:
        self._line, self._how, self._rng = line, how, np.random.default_rng(seed)
        self._heard: list[bytes] = []
        self._held = b""
        self.muddled, self._since, self.is_good = 0, 0, True
        self.write, self.now, self.reopen, self.close = line.write, line.now, line.reopen, line.close

    def read(self, timeout_s: float) -> bytes:
        data = self._line.read(timeout_s)
        if not data:
            return data
        self._heard.append(data)
        if self.is_good:
            return data
        if self._how == "doubled":
            self.muddled += 1
            return data + data
        if self._how == "one of the beginning":  # further away than a wheel can go, once in a while
            self._since += 1
            if self._since < 12:
                return data
            self._since, self.muddled = int(self._rng.integers(4)), self.muddled + 1
            return self._heard[self._rng.integers(3)] + data
        if self._rng.random() > 0.3:
            return data
        self.muddled += 1
        if self._how == "late":
            self._held, out = data, self._held
            return out
        old = self._heard[int(self._rng.integers(len(self._heard)))]
        return old + data if self._how == "stale before" else data + old


def check_what_is_reported_is_what_was_done(kind: str, how: str, seed: int) -> None:
    """Each command is carried out once, and its report is the ground's."""
    floor = IdealGround()
    line = MuddledLine(put_on_noisy_line(emulator_kinds()[kind].on_ground(floor)), how, seed)
    base = base_kinds()[kind].connect_to_emulator(line)
    base.odometry()
    if how == "one of the beginning":
        base.execute(MotorCommand(0.0, 1.0))
    line.is_good = False
    for command in COMMANDS:
        turned_rad, moved_m = floor.turned_rad, floor.moved_m
        report = base.execute(command)
        assert report.turn_rad == pytest.approx(floor.turned_rad - turned_rad, abs=MUDDLED_RAD)
        assert report.move_m == pytest.approx(floor.moved_m - moved_m, abs=MUDDLED_M)
        assert report.turn_rad == pytest.approx(command.turn_rad, abs=2.0 * MUDDLED_RAD)
        assert report.move_m == pytest.approx(command.move_m, abs=2.0 * MUDDLED_M)
    there, pose = base.odometry(), floor.pose
    assert math.hypot(there.x_m, there.y_m) == pytest.approx(math.hypot(pose.x_m, pose.y_m), abs=0.05)
    assert line.muddled >= 3


@settings(deadline=None, max_examples=30)
@given(st.floats(-0.9, 0.9))
def check_a_bumper_tells_which_side_was_touched(kind: str, direction_rad: float) -> None:
    floor = IdealGround()
    base = over_line_in_memory(kind, floor).base
    floor.held, floor.touching_rad = True, direction_rad
    with pytest.raises(BaseFault) as caught:
        base.move(0.5)
    contact = base.take_contact()
    assert caught.value.kind == "stalled" and contact is not None and contact.by == "bumper"
    assert abs(contact.direction_rad - direction_rad) <= math.sqrt(3.0) * contact.sigma_rad + 1e-9
    assert base.take_contact() is None


@settings(deadline=None, max_examples=12)
@given(st.booleans())
def check_held_wheels_tell_no_direction(kind: str, turning: bool) -> None:
    floor = IdealGround()
    base = over_line_in_memory(kind, floor).base
    floor.held = True
    with pytest.raises(BaseFault):
        base.execute(MotorCommand(1.0 if turning else 0.0, 0.5))
    contact = base.take_contact()
    assert contact is not None
    if kind != "create2":  # its bumper is said to be pressed where nothing says what holds it
        assert (contact.by, contact.sigma_rad) == ("stall", AROUND_SIGMA_RAD if turning else AHEAD_SIGMA_RAD)


@settings(deadline=None, max_examples=20)
@given(st.none() | st.floats(0.45, 3.0))
def check_each_ring_hears_a_wall_all_round_and_the_base_drives_on(kind: str, wall_m: float | None) -> None:
    floor = IdealGround()
    floor.wall_m = wall_m
    base = over_line_in_memory(kind, floor).base
    for _ in range(2):
        ranges = base.ranges()
        assert ranges is not None and len(ranges.distances_m) == {"denning": 24, "p2os": 16, "create2": 6}[kind]
        if wall_m is None or kind == "create2":
            assert not ranges.echoes
        else:
            assert len(ranges.echoes) == len(ranges.distances_m)
            most_m = max(distance for _, distance in ranges.echoes)
            assert most_m == pytest.approx(wall_m, abs=0.05 if kind == "p2os" else 0.001)
        assert base.move(0.1).move_m == pytest.approx(0.1, abs=0.011)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from((0.05, 0.2)))
def check_on_a_bad_line_ranges_are_right_or_missing(kind: str, seed: int, noise: float) -> None:
    """Denning's are exact or none; those with a weak checksum may be wrong once in a while, but nothing else fails."""
    floor = IdealGround()
    floor.wall_m = 1.5
    base = over_line_in_memory(kind, floor, noise, seed).base
    for _ in range(6):
        try:
            ranges = base.ranges()
        except BaseFault:
            continue
        if kind == "denning" and ranges is not None:
            assert ranges.distances_m == (1.5,) * 24


OF_SENSES: tuple[Callable[[str], None], ...] = (
    check_a_bumper_tells_which_side_was_touched,
    check_held_wheels_tell_no_direction,
    check_each_ring_hears_a_wall_all_round_and_the_base_drives_on,
    check_on_a_bad_line_ranges_are_right_or_missing,
)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), noise=st.sampled_from(NOISES), breaks=st.sampled_from((0.0, 0.5, 1.0)))
def check_motions_over_a_bad_line_are_those_that_were_asked_for(
    protocol: str, seed: int, noise: float, breaks: float
) -> None:
    found = Findings()
    Trial(protocol, np.random.default_rng(seed), found, noise).run(3, breaks)
    assert found.violations == []
    assert found.late == 0
    assert found.resumed == found.ended == 1


def check_over_a_good_line_every_motion_is_done(protocol: str) -> None:
    found = Findings()
    Trial(protocol, np.random.default_rng(7), found, 0.0).run(5, 0.0)
    assert found.done == found.asked == 6
    assert not found.faults and not found.strays


def drive_over(stage: Stage, body: str) -> tuple[MissionResult, list[Decision], list[Any]]:
    """A mission whose body is behind a line: its result, its decisions, and the values of all that they made or saw."""
    decisions = list[Decision]()
    result = run_mission(stage, 3, body=body, sinks=[decisions.append])
    return result, decisions, [c.entry.value for d in decisions for c in (*d.observed, *d.made)]


def check_a_failing_line_is_waited_for(
    stage: Stage, body: str, fault_kind: str, lasts_s: float, stands_after_s: float | None
) -> None:
    """It is told; nobody moves meanwhile, and from ``stands_after_s`` on the robot truly stands; it gets there."""
    bodies, made = list[SimulatedBody](), Stage.body
    fault = find_fault_class(fault_kind)(after_m=0.7, duration_s=lasts_s)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stage, "body", lambda self, seed: bodies.append(made(self, seed)) or bodies[-1])
        result, _, told = drive_over(replace(stage, scenario=replace(stage.scenario, faults=(fault,))), body)
    assert result.outcome == "reached" and result.final_error_m < 0.0254, result.reason
    faults = [v for v in told if isinstance(v, BodyFault)]
    assert faults[0].part == "base" and faults[0].what in {"link lost", "base answers nonsense"}
    assert faults[-1].status == "over"
    assert any(isinstance(v, Recovery) and v.status == "over" for v in told)
    at_fault = False
    for value in told:
        at_fault = value.is_open if isinstance(value, BodyFault) else at_fault
        assert not (at_fault and isinstance(value, MotorCommand))
    if stands_after_s is not None:
        began_s = next(t.time_s for t in bodies[0].track if t.path_m >= 0.7)
        still = [t.world_from_robot for t in bodies[0].track
                 if began_s + stands_after_s < t.time_s < began_s + lasts_s]
        assert still and all(pose == still[0] for pose in still)
