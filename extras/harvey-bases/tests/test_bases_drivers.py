"""The drivers of the Pioneer and of the Create 2, over each kind of line to their emulators."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from box_rooms import box_room
from harvey.hardware.bases import base_kinds
from harvey.simulation.serial_body import emulator_kinds
from harvey_bases import p2os_emulator
from harvey_bases.create2 import Create2Base, Watchdog
from harvey_bases.create2_emulator import PASSIVE, Create2Emulator
from harvey_bases.p2os import P2osBase, encode
from harvey_bases.p2os_emulator import P2osEmulator
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.emulators.emulator import IdealGround
from sim.emulators.line import EmulatedLine
from tests.serial_bench import (
    NEAR_M,
    OF_SENSES,
    ON_EMULATED_LINE,
    ON_LINE_IN_MEMORY,
    Bench,
    check_the_bases_own_watchdog_stops_it_when_the_host_dies,
    check_what_is_reported_is_what_was_done,
    faulted,
    over_emulated_line,
    over_line_in_memory,
)
from world_models.camera import Camera, CameraMount
from world_models.entries import MotorCommand
from world_models.frames import Pose2

KINDS = ("p2os", "create2")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("check", ON_EMULATED_LINE)
def test_over_a_line_of_missions(check: Callable[[Bench], None], kind: str) -> None:
    with over_emulated_line(kind) as bench:
        check(bench)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("check", ON_LINE_IN_MEMORY)
def test_over_a_line_that_breaks(check: Callable[[Bench], None], kind: str) -> None:
    check(over_line_in_memory(kind, IdealGround()))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("check", OF_SENSES)
def test_touch_and_ranges(check: Callable[[str], None], kind: str) -> None:
    check(kind)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("how", ["doubled", "one of the beginning"])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_reported_is_what_was_done(kind: str, how: str, seed: int) -> None:
    check_what_is_reported_is_what_was_done(kind, how, seed)


def test_the_pioneers_own_watchdog_stops_it_when_the_host_dies() -> None:
    check_the_bases_own_watchdog_stops_it_when_the_host_dies(over_line_in_memory("p2os", IdealGround()))


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


def test_a_create_that_is_lifted_is_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    floor = IdealGround()
    end = Create2Emulator(floor)
    line = EmulatedLine(end)
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
    monkeypatch.setattr(p2os_emulator, "NAMES", b"Somebody\0Pioneer\0p9zz\0")
    line = EmulatedLine(P2osEmulator(IdealGround()))
    fault = faulted(lambda: P2osBase(line).move(0.1))
    assert fault.kind == "refused" and "p9zz" in fault.detail and "mm_per_unit" in fault.detail
    assert P2osBase(line, mm_per_unit=1.0).move(0.1).move_m == pytest.approx(0.1, abs=NEAR_M)
    line.close()


def test_the_guard_stops_a_base_whose_driver_hangs_and_only_then() -> None:
    now, stops = [0.0], []
    guard = Watchdog(lambda: stops.append(now[0]), lambda: now[0], 0.5)
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


def simulated() -> SimulatedBody:
    room, lens = SimulatedBuilding.of_faces(box_room()), Camera.from_field_of_view(1.1, 64, 64)
    return SimulatedBody(room, Pose2(1.0, 2.0, 0.0), lens,
                         CameraMount(1.0, 0.1, 0.0), seed=3)


@pytest.mark.parametrize("kind", KINDS)
def test_over_a_simulated_body_wheels_err_walls_stop_and_the_clock_is_the_bodys(kind: str) -> None:
    body = simulated()
    end = emulator_kinds()[kind].on_ground(body)
    base = base_kinds()[kind].connect_to_emulator(EmulatedLine(end, lambda: body.time_s))
    report = base.execute(MotorCommand(0.3, 2.0))
    gone_m = body.truth.path_m
    assert report.move_m == pytest.approx(2.0, abs=NEAR_M)
    assert 0.9 < gone_m / report.move_m < 0.97, "moves fall short by 4 to 6 percent and some"
    assert report.sim_time_s == pytest.approx(body.truth.time_s, abs=0.2)
    fault = faulted(lambda: base.move(6.0))
    assert fault.kind == "stalled" and body.truth.collisions >= 1 and fault.stopped
    base.close()
