"""A line to an emulated base on which no real time counts: while the host waits for bytes, the base's time passes.

The bytes go through a pseudo-terminal and whatever opened its other end; but nobody is ever late, so that a mission
over it takes no longer than its decisions, and takes the same ones each time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from sim.emulators.emulator import Emulator
from sim.emulators.pseudo_terminal import PseudoTerminal

LEAST_S = 1e-6
"""Every read takes at least so long, so that time goes on whatever the host does."""


class Port(Protocol):
    """An open serial port, as pyserial's."""

    timeout: float | None

    def write(self, data: bytes, /) -> int | None: ...

    def read(self, size: int, /) -> bytes: ...

    def close(self) -> None: ...


class LockstepLink:
    """A link (as the drivers want one) on which time passes only while its host waits."""

    def __init__(
        self, port: Port, terminal: PseudoTerminal, emulator: Emulator, *, clock: Callable[[], float] | None = None,
        tick_s: float = 0.015,
    ) -> None:
        """A link to the base behind a terminal.

        Args:
            port: the other end of ``terminal``, opened.
            clock: tells the time, which the emulator moves on; None: what was waited here.
        """
        self._port, self._terminal, self._emulator, self._tick_s = port, terminal, emulator, tick_s
        self._port.timeout = 2.0
        self._time_s = 0.0
        self._clock = clock
        self._written = self._read = 0

    def write(self, data: bytes) -> None:
        self._port.write(data)
        self._written += len(data)
        self._terminal.exchange(self._written)

    def read(self, timeout_s: float) -> bytes:
        ends_s = self._time_s + max(timeout_s, LEAST_S)
        while self._terminal.sent == self._read and self._time_s < ends_s:
            step_s = max(LEAST_S, min(self._tick_s, ends_s - self._time_s))
            self._time_s += step_s
            self._emulator.advance(step_s)
            self._terminal.exchange(self._written)
        data = self._port.read(self._terminal.sent - self._read) if self._terminal.sent > self._read else b""
        self._read += len(data)
        return data

    def now(self) -> float:
        return self._time_s if self._clock is None else self._clock()

    def reopen(self) -> None:
        """It never was gone."""

    def close(self) -> None:
        self._port.close()
