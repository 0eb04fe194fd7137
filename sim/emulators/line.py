"""The line to an emulated base: as a serial port, without real time, and with the faults of a simulated body."""

from __future__ import annotations

import os
import select
import time
import tty
import zlib
from collections.abc import Callable
from contextlib import suppress

from sim.body.simulated_body import SimulatedBody
from sim.emulators.emulator import Emulator
from sim.faults.built_in_faults import LinkLost, Nonsense

Trace = Callable[[str, bytes], None]
"""Called with the traffic: ``<`` for bytes from the host, ``>`` for bytes from the base."""

MAX_STEP_S = 0.25
"""A server that was delayed by more than this skips the rest of the base's time instead of catching up [s]."""


class PseudoTerminal:
    """An emulated base on a pseudo-terminal.

    Attributes:
        name: of the device to open, as /dev/pts/7.
    """

    def __init__(self, emulator: Emulator, trace: Trace | None = None) -> None:
        """Open a pseudo-terminal in raw mode. Both ends stay open here, so that hosts can come and go."""
        self._emulator, self._trace = emulator, trace
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.name = os.ttyname(self._theirs)

    def serve(self, speed: float = 1.0, tick_s: float = 0.01, until: Callable[[], bool] = lambda: False) -> None:
        """Serve in real time, or ``speed`` times as fast, until ``until()`` is true or interrupted."""
        then = time.monotonic()
        while not until():
            select.select([self._ours], [], [], tick_s)
            now = time.monotonic()
            self._emulator.advance(min(now - then, MAX_STEP_S) * speed)
            then = now
            self.exchange()

    def exchange(self) -> None:
        """Pass the host's bytes to the base, and its answers back; what does not fit into the buffer is lost, as on a
        wire.
        """
        with suppress(BlockingIOError):
            while data := os.read(self._ours, 4096):
                self._report("<", data)
                self._emulator.receive(data)
        if answer := self._emulator.take():
            self._report(">", answer)
            with suppress(BlockingIOError):
                os.write(self._ours, answer)

    def close(self) -> None:
        """Close both ends."""
        for end in (self._ours, self._theirs):
            os.close(end)

    def _report(self, direction: str, data: bytes) -> None:
        if self._trace is not None:
            self._trace(direction, data)


MIN_STEP_S = 1e-6
"""Every read takes at least this long, so that time always goes on [s]."""

TICK_S = 0.015
"""Largest step of an emulated base's time [s]."""


class EmulatedLine:
    """A line in memory to an emulated base, without real time: the base's time passes only while the host waits.

    No byte is ever late, so a mission over this line is deterministic and takes no longer than its decisions.
    """

    def __init__(self, emulator: Emulator, clock: Callable[[], float] | None = None) -> None:
        """``clock``: the time [s] where the emulator itself advances it; None: the sum of the waits here."""
        self._emulator, self._answers = emulator, b""
        self._time_s = 0.0
        self._clock = clock

    def write(self, data: bytes) -> None:
        self._emulator.receive(data)
        self._answers += self._emulator.take()

    def read(self, timeout_s: float) -> bytes:
        ends_s = self._time_s + max(timeout_s, MIN_STEP_S)
        while not self._answers and self._time_s < ends_s:
            step_s = max(MIN_STEP_S, min(TICK_S, ends_s - self._time_s))
            self._time_s += step_s
            self._emulator.advance(step_s)
            self._answers = self._emulator.take()
        data, self._answers = self._answers, b""
        return data

    def now(self) -> float:
        return self._time_s if self._clock is None else self._clock()

    def reopen(self) -> None:
        """Nothing to do: it is always open."""

    def close(self) -> None:
        """Nothing to do."""


class FaultyLine:
    """An emulated base behind a line that has the faults ``link_lost`` and ``nonsense`` of a simulated body."""

    def __init__(self, emulator: Emulator, body: SimulatedBody) -> None:
        self._emulator, self._body = emulator, body
        self._noise = 0

    def receive(self, data: bytes) -> None:
        """Bytes from the host, if the line is there."""
        if LinkLost.kind not in self._body.device_faults:
            self._emulator.receive(data)

    def advance(self, duration_s: float) -> None:
        """Let time pass on both sides of the line."""
        self._emulator.advance(duration_s)

    def take(self) -> bytes:
        """Bytes from the base, if the line is there; with ``nonsense``, reproducible noise of the same length."""
        data, faults = self._emulator.take(), self._body.device_faults
        if LinkLost.kind in faults:
            return b""
        if Nonsense.kind in faults:
            self._noise = zlib.crc32(data, self._noise)
            return bytes((b ^ (self._noise >> (i % 24))) & 0xFF for i, b in enumerate(data))
        return data

    @property
    def moving(self) -> bool:
        """Whether the motors run."""
        return self._emulator.moving
