"""The driver of the Denning-style base, over each kind of line to its emulator, and what it does when that fails."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from harvey.hardware.drivers.base_driver import SerialLink
from harvey.hardware.drivers.denning import BAUD, DenningBase
from sim.emulators.denning_emulator import ConstantSpeedMotion, DenningEmulator, InstantMotion
from sim.emulators.emulator import IdealGround
from sim.emulators.line import EmulatedLine, PseudoTerminal
from tests.serial_bench import (
    OF_SENSES,
    ON_EMULATED_LINE,
    ON_LINE_IN_MEMORY,
    Bench,
    check_the_bases_own_watchdog_stops_it_when_the_host_dies,
    check_what_is_reported_is_what_was_done,
    over_emulated_line,
    over_line_in_memory,
)
from world_models.entries import MotionReport, MotorCommand


@pytest.mark.parametrize("check", ON_EMULATED_LINE)
def test_over_a_line_of_missions(check: Callable[[Bench], None]) -> None:
    with over_emulated_line("denning") as bench:
        check(bench)


@pytest.mark.parametrize("check", (*ON_LINE_IN_MEMORY, check_the_bases_own_watchdog_stops_it_when_the_host_dies))
def test_over_a_line_that_breaks(check: Callable[[Bench], None]) -> None:
    check(over_line_in_memory("denning", IdealGround()))


@pytest.mark.parametrize("check", OF_SENSES)
def test_touch_and_ranges(check: Callable[[str], None]) -> None:
    check("denning")


@pytest.mark.parametrize("how", ["doubled", "stale before", "stale after", "late"])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_reported_is_what_was_done(how: str, seed: int) -> None:
    check_what_is_reported_is_what_was_done("denning", how, seed)


def test_its_line_runs_as_its_document_says() -> None:
    assert BAUD == 38400


def test_a_repeated_denning_command_moves_once(monkeypatch: pytest.MonkeyPatch) -> None:
    floor = IdealGround()
    end = DenningEmulator(ConstantSpeedMotion(floor))
    link = EmulatedLine(end)
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
        speed_m_per_s = 0.5

        def execute(self, command: MotorCommand) -> MotionReport:
            return MotionReport(command.turn_rad * (1 + 2**-50), command.move_m / 3.0, 0.1 + 0.2, 1e-17)

        def take_contact(self) -> None:
            return None

        def ranges(self) -> None:
            return None

    base = DenningBase(EmulatedLine(DenningEmulator(InstantMotion(Body()))))
    command = MotorCommand(-0.1, math.pi)
    assert base.execute(command) == Body().execute(command)
    base.close()


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
    class Talker:
        def receive(self, data: bytes) -> None:
            raise AssertionError(data)

        def take(self) -> bytes:
            return bytes(5000)

    terminal = PseudoTerminal(Talker())
    for _ in range(40):
        terminal.exchange()
    terminal.close()
