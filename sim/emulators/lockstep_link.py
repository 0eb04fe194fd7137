"""A line to an emulated base without real time: the base's time passes only while the host waits for bytes.

The bytes go through a pseudo-terminal. No byte is ever late, so a mission over this line is deterministic and takes no
longer than its decisions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from sim.emulators.emulator import Emulator
from sim.emulators.pseudo_terminal import PseudoTerminal

MIN_STEP_S = 1e-6
"""Every read takes at least this long, so that time always goes on [s]."""


class Port(Protocol):
    """An open serial port, as pyserial's."""

    timeout: float | None

    def write(self, data: bytes, /) -> int | None: ...

    def read(self, size: int, /) -> bytes: ...

    def close(self) -> None: ...


class LockstepLink:
    """A link, as the drivers use it, on which time passes only while the host waits."""

    def __init__(
        self, port: Port, terminal: PseudoTerminal, emulator: Emulator, *, clock: Callable[[], float] | None = None,
        tick_s: float = 0.015,
    ) -> None:
        """A link to the base behind a terminal.

        Args:
            port: the other end of ``terminal``, opened.
            clock: the time [s] where the emulator itself advances it; None: the sum of the waits here.
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
        ends_s = self._time_s + max(timeout_s, MIN_STEP_S)
        while self._terminal.sent == self._read and self._time_s < ends_s:
            step_s = max(MIN_STEP_S, min(self._tick_s, ends_s - self._time_s))
            self._time_s += step_s
            self._emulator.advance(step_s)
            self._terminal.exchange(self._written)
        data = self._port.read(self._terminal.sent - self._read) if self._terminal.sent > self._read else b""
        self._read += len(data)
        return data

    def now(self) -> float:
        return self._time_s if self._clock is None else self._clock()

    def reopen(self) -> None:
        """Nothing to do: it is always open."""

    def close(self) -> None:
        self._port.close()
