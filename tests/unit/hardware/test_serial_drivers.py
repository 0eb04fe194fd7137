"""The drivers of bases, each over a pseudo-terminal to its emulated base, and what they do when something fails."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import sim.emulators.p2os
from experiments.generated.scenes import box_room
from experiments.robustness.serial.line_noise import Noise
from experiments.robustness.serial.noisy_line import Killed, NoisyLine
from harvey.hardware.drivers.bases.base import Base, BaseFault
from harvey.hardware.drivers.bases.create2 import Create2Base
from harvey.hardware.drivers.bases.denning import DenningBase
from harvey.hardware.drivers.bases.guard import Guard
from harvey.hardware.drivers.bases.link import SerialLink
from harvey.hardware.drivers.bases.p2os import P2osBase
from harvey.hardware.drivers.bases.p2os_wire import encode
from sim.body.building import Building
from sim.body.simulated_body import SimulatedBody
from sim.emulators.create2 import PASSIVE, Create2Emulator
from sim.emulators.denning import DenningEmulator
from sim.emulators.denning_motion import ConstantSpeedMotion, InstantMotion
from sim.emulators.ground import IdealGround, SimulatedGround
from sim.emulators.p2os import P2osEmulator
from sim.emulators.pseudo_terminal import PseudoTerminal
from sim.emulators.pseudo_terminal_link import PseudoTerminalLink
from world_models.camera import Camera, CameraMount
from world_models.entries.body import MotionReport, MotorCommand
from world_models.frames import Pose2

KINDS = ("denning", "p2os", "create2")
NEAR_M, NEAR_RAD = 0.011, math.radians(1.0)


def emulator(kind: str, floor: IdealGround) -> Any:
    if kind == "denning":
        return DenningEmulator(ConstantSpeedMotion(floor))
    return P2osEmulator(floor) if kind == "p2os" else Create2Emulator(floor, count=65_500)


def driver(kind: str, link: Any) -> Base:
    if kind == "denning":
        return DenningBase(link)
    return P2osBase(link) if kind == "p2os" else Create2Base(link)


@dataclass
class Bench:
    """A driver, the base that it drives, and the line between them."""

    kind: str
    floor: IdealGround
    end: Any
    line: Any
    base: Base


@pytest.fixture(params=KINDS)
def wired(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Over a pseudo-terminal."""
    floor = IdealGround()
    end = emulator(request.param, floor)
    line = PseudoTerminalLink(end)
    bench = Bench(request.param, floor, end, line, driver(request.param, line))
    yield bench
    bench.base.close()


@pytest.fixture(params=KINDS)
def quiet(request: pytest.FixtureRequest) -> Bench:
    """Over a line in memory that does nothing to the bytes, but may be broken."""
    floor, rng = IdealGround(), np.random.default_rng(0)
    end = emulator(request.param, floor)
    line = NoisyLine(end, Noise(rng, 0.0), Noise(rng, 0.0), tick_s=0.01)
    return Bench(request.param, floor, end, line, driver(request.param, line))


def faulted(call: Callable[[], object]) -> BaseFault:
    with pytest.raises(BaseFault) as caught:
        call()
    return caught.value


@pytest.mark.parametrize("turn", [0.3, -0.3, 2.8, -2.8, 4.5])
def test_a_turn_and_a_move_come_out_as_asked_and_as_reported(wired: Bench, turn: float) -> None:
    report = wired.base.execute(MotorCommand(turn, 0.61))
    assert wired.floor.turned_rad == pytest.approx(turn, abs=NEAR_RAD)
    assert wired.floor.moved_m == pytest.approx(0.61, abs=NEAR_M)
    assert report.turn_rad == pytest.approx(wired.floor.turned_rad, abs=0.004)
    assert report.move_m == pytest.approx(wired.floor.moved_m, abs=0.002)
    assert report.duration_s > 0.0


def test_odometry_follows_a_way_with_corners_and_counters_that_wrap(wired: Bench) -> None:
    began = wired.base.odometry()
    for _ in range(4):
        wired.base.execute(MotorCommand(math.pi / 2.0 + 0.2, 9.0 if wired.kind == "p2os" else 2.0))
    there, pose = wired.base.odometry(), wired.floor.pose
    away_m, turned_rad = math.hypot(there.x_m - began.x_m, there.y_m - began.y_m), there.heading_rad - began.heading_rad
    assert away_m == pytest.approx(math.hypot(pose.x_m, pose.y_m), abs=0.05)
    assert math.remainder(turned_rad - pose.heading_rad, 2 * math.pi) == pytest.approx(0, abs=0.02)


def test_nothing_asked_is_nothing_done(wired: Bench) -> None:
    report = wired.base.execute(MotorCommand(0.0, 0.0))
    assert (report.turn_rad, report.move_m) == (0.0, 0.0)
    assert wired.floor.moved_m == wired.floor.turned_rad == 0.0


def test_wheels_that_are_held_are_a_fault_and_the_base_stands(wired: Bench) -> None:
    wired.base.heartbeat()
    wired.floor.held = True
    fault = faulted(lambda: wired.base.move(1.0))
    assert fault.kind == "stalled" and fault.stopped and not wired.end.moving
    assert fault.done is not None and fault.done.move_m == pytest.approx(0.0, abs=1e-6)
    wired.floor.held = False
    assert wired.base.move(0.2).move_m == pytest.approx(0.2, abs=NEAR_M)


def test_a_driver_that_was_closed_says_so(wired: Bench) -> None:
    wired.base.close()
    wired.base.close()
    assert faulted(lambda: wired.base.move(0.1)).kind == "disconnected"


@pytest.mark.parametrize(("turn", "move"), [(math.nan, 0.1), (math.inf, 0.1), (0.0, math.inf)])
def test_a_command_that_is_no_motion_is_the_callers_mistake(wired: Bench, turn: float, move: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        wired.base.execute(MotorCommand(turn, move))


def test_a_stop_from_another_thread_breaks_a_motion_off(quiet: Bench) -> None:
    quiet.base.heartbeat()
    real, calls = quiet.line.read, 0
    asked: threading.Event = vars(quiet.base)["_stop_asked"]
    stopper = threading.Thread(target=quiet.base.stop)

    def read(timeout_s: float) -> bytes:
        nonlocal calls
        calls += 1
        if calls == 40:
            stopper.start()
            asked.wait(10.0)
        return real(timeout_s)

    quiet.line.read = read
    fault = faulted(lambda: quiet.base.move(5.0))
    stopper.join()
    assert fault.kind == "stopped" and fault.stopped and not quiet.end.moving
    assert fault.done is not None and fault.done.move_m == pytest.approx(quiet.floor.moved_m, abs=0.02)
    assert 0.0 < quiet.floor.moved_m < 4.9
    assert quiet.base.move(0.1).move_m == pytest.approx(0.1, abs=NEAR_M)


def test_a_cut_cable_is_told_with_what_had_been_done_and_a_new_one_is_taken_up(quiet: Bench) -> None:
    quiet.base.heartbeat()
    quiet.line.break_after(60, 1.0)
    fault = faulted(lambda: quiet.base.move(5.0))
    assert fault.kind == "disconnected" and not fault.stopped
    assert fault.done is not None and 0.0 < fault.done.move_m < 5.0
    assert faulted(quiet.base.heartbeat).kind == "disconnected"
    quiet.line.wait(4.0)
    quiet.base.stop()
    assert not quiet.end.moving
    assert quiet.base.turn(0.5).turn_rad == pytest.approx(0.5, abs=NEAR_RAD)


def test_a_base_that_is_not_there_is_silent(quiet: Bench) -> None:
    quiet.end.receive = lambda data: None
    fault = faulted(lambda: quiet.base.move(1.0))
    assert fault.kind == "silent" and quiet.line.now() < 15.0


def test_a_base_that_answers_nonsense_is_a_fault_that_tells_of_the_noise(quiet: Bench) -> None:
    quiet.end.take = lambda: b"\xfa\xfb\x05what\x13\x10ever*\n#"
    fault = faulted(lambda: quiet.base.move(1.0))
    assert fault.kind == "silent" and "noise" in fault.detail


def test_a_base_that_lost_power_is_taken_up_again(quiet: Bench) -> None:
    quiet.base.move(0.2)
    quiet.end.power_cycle()
    for _ in range(2):
        try:
            assert quiet.base.move(0.3).move_m == pytest.approx(0.3, abs=NEAR_M)
            break
        except BaseFault as fault:
            assert fault.done is None or fault.done.move_m == 0.0
    assert quiet.floor.moved_m == pytest.approx(0.5, abs=2 * NEAR_M)


@pytest.mark.parametrize("kind", ["denning", "p2os"])
def test_the_bases_own_watchdog_stops_it_when_the_host_dies(kind: str) -> None:
    floor = IdealGround()
    end = emulator(kind, floor)
    line = NoisyLine(end, Noise(np.random.default_rng(0), 0.0), Noise(np.random.default_rng(0), 0.0), tick_s=0.01)
    base = driver(kind, line)
    base.heartbeat()
    line.break_after(60, math.inf)
    with pytest.raises(Killed):
        base.move(5.0)
    assert end.moving
    line.wait(end.standing_within_s + 0.01)
    assert not end.moving and end.stops == 1


def test_a_pioneer_takes_its_motion_up_after_the_watchdog_unless_it_is_told_to_stop_first() -> None:
    """Source: the P2OS manual: it "will resume again on receipt of a client packet"."""
    floor = IdealGround()
    base = P2osEmulator(floor)
    for command in (0, 1, 2, 1):
        base.receive(encode(command))
    base.receive(encode(4, 1) + encode(11, 200))
    base.advance(6.0)
    stood_m = floor.moved_m
    base.advance(1.0)
    assert floor.moved_m == stood_m
    base.receive(encode(0))
    base.advance(1.0)
    assert floor.moved_m > stood_m + 0.1
    base.receive(encode(55))
    base.advance(5.0)
    base.receive(encode(0))
    stood_m = floor.moved_m
    base.advance(1.0)
    assert floor.moved_m == stood_m


def test_a_repeated_denning_command_moves_once(monkeypatch: pytest.MonkeyPatch) -> None:
    floor = IdealGround()
    end = DenningEmulator(ConstantSpeedMotion(floor))
    link = PseudoTerminalLink(end)
    said: list[bytes] = []
    real = link.write

    def twice(data: bytes) -> None:
        said.append(data)
        real(data + data)

    monkeypatch.setattr(link, "write", twice)
    base = DenningBase(link)
    base.move(0.3)
    base.move(0.2)
    for old in said:
        real(old)
    link.read(3.0)
    assert floor.moved_m == pytest.approx(0.5) and len(end.executed) == 2
    base.close()


def test_over_a_body_that_acts_at_once_the_denning_reports_are_the_bodys_own() -> None:
    class Body:
        def execute(self, command: MotorCommand) -> MotionReport:
            return MotionReport(command.turn_rad * (1 + 2**-50), command.move_m / 3.0, 0.1 + 0.2, 1e-17)

        def take_contact(self) -> None:
            return None

        def ranges(self) -> None:
            return None

    base = DenningBase(PseudoTerminalLink(DenningEmulator(InstantMotion(Body()))))
    command = MotorCommand(-0.1, math.pi)
    assert base.execute(command) == Body().execute(command)
    base.close()


def test_a_create_that_is_lifted_is_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    floor = IdealGround()
    end = Create2Emulator(floor)
    line = PseudoTerminalLink(end)
    base = Create2Base(line)
    base.heartbeat()
    real = floor.roll

    def roll(turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        if 0.2 < floor.moved_m < 0.21:
            end.mode = PASSIVE
        return real(turn_rad, move_m, duration_s)

    monkeypatch.setattr(floor, "roll", roll)
    fault = faulted(lambda: base.move(1.0))
    assert fault.kind == "refused" and "safe mode" in fault.detail
    assert fault.stopped and not end.moving and floor.moved_m < 0.3
    base.close()


def test_a_pioneer_of_an_unknown_kind_is_refused_until_its_units_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sim.emulators.p2os, "NAMES", b"Somebody\0Pioneer\0p9zz\0")
    line = PseudoTerminalLink(P2osEmulator(IdealGround()))
    fault = faulted(lambda: P2osBase(line).move(0.1))
    assert fault.kind == "refused" and "p9zz" in fault.detail and "mm_per_unit" in fault.detail
    assert P2osBase(line, mm_per_unit=1.0).move(0.1).move_m == pytest.approx(0.1, abs=NEAR_M)
    line.close()


def test_the_guard_stops_a_base_whose_driver_hangs_and_only_then() -> None:
    now, stops = [0.0], []
    guard = Guard(lambda: stops.append(now[0]), lambda: now[0], 0.5)
    guard.check()
    guard.arm()
    now[0] = 0.4
    guard.check()
    assert stops == []
    now[0] = 0.6
    guard.check()
    assert stops == [0.6] and guard.struck == 1
    guard.disarm()
    now[0] = 9.0
    guard.check()
    assert stops == [0.6]


def test_a_serial_link_opens_reads_writes_and_says_what_is_wrong() -> None:
    terminal = PseudoTerminal(DenningEmulator(ConstantSpeedMotion(IdealGround())))
    link = SerialLink(terminal.name, 38400)
    link.write(b"#garbage\n")
    assert link.read(0.0) == b""
    link.reopen()
    link.close()
    link.close()
    terminal.close()
    with pytest.raises(OSError):
        SerialLink("/dev/no-such-port", 38400)
    with pytest.raises(OSError, match="URL"):
        SerialLink("gopher://x", 38400)


def test_a_terminal_that_nobody_reads_does_not_hold_the_base_up() -> None:
    end = Create2Emulator(IdealGround())
    end.receive(bytes([128, 148, 2, 43, 44]))
    terminal = PseudoTerminal(end)
    for _ in range(40):
        end.advance(1.0)
        terminal.exchange()
    assert 0 < terminal.sent < 40 * 8 / 0.015
    terminal.close()


@pytest.mark.parametrize("kind", ["", "dead"])
def test_a_fault_has_one_of_the_known_kinds(kind: Any) -> None:
    with pytest.raises(ValueError, match="kind of fault"):
        BaseFault(kind, "what happened")


def simulated() -> SimulatedBody:
    return SimulatedBody(Building.of_faces(box_room()), Pose2(1.0, 2.0, 0.0), Camera.from_field_of_view(1.1, 64, 64),
                         CameraMount(1.0, 0.1, 0.0), seed=3)


def test_the_simulators_body_is_a_base_too() -> None:
    body: Base = simulated()
    body.turn(0.2)
    report = body.move(0.5)
    there = body.odometry()
    assert math.hypot(there.x_m, there.y_m) == pytest.approx(report.move_m)
    assert there.heading_rad == pytest.approx(0.2, abs=0.001) and there.time_s == report.sim_time_s
    body.heartbeat()
    body.stop()
    body.close()


@pytest.mark.parametrize("kind", ["p2os", "create2"])
def test_over_a_simulated_body_wheels_err_walls_stop_and_the_clock_is_the_bodys(kind: str) -> None:
    body = simulated()
    end = P2osEmulator(SimulatedGround(body)) if kind == "p2os" else Create2Emulator(SimulatedGround(body))
    base = driver(kind, PseudoTerminalLink(end, lambda: body.truth.time_s))
    report = base.execute(MotorCommand(0.3, 2.0))
    gone_m = body.truth.path_m
    assert report.move_m == pytest.approx(2.0, abs=NEAR_M)
    assert 0.9 < gone_m / report.move_m < 0.97, "moves fall short by 4 to 6 percent and some"
    assert report.sim_time_s == pytest.approx(body.truth.time_s, abs=0.2)
    fault = faulted(lambda: base.move(6.0))
    assert fault.kind == "stalled" and body.truth.collisions >= 1 and fault.stopped
    base.close()
