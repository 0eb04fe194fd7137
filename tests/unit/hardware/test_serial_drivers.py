"""The driver of the Denning-style base, over each kind of line to its emulator, and what it does when that fails."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from harvey.hardware.drivers.base_driver import SerialLink
from harvey.hardware.drivers.denning import BAUD
from sim.emulators.denning_emulator import ConstantSpeedMotion, DenningEmulator
from sim.emulators.emulator import IdealGround
from sim.emulators.line import PseudoTerminal
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
