"""The line to an emulated base: as a serial port, without real time, and with the faults of a simulated body."""

from __future__ import annotations

import os
import select
import time
import tty
import zlib
from collections.abc import Callable

import serial

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
        received, sent: number of bytes so far, from the host and to it.
    """

    def __init__(self, emulator: Emulator, trace: Trace | None = None) -> None:
        """Open a pseudo-terminal in raw mode. Both ends stay open here, so that hosts can come and go."""
        self._emulator, self._trace = emulator, trace
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.name = os.ttyname(self._theirs)
        self.received = self.sent = 0

    def serve(self, speed: float = 1.0, tick_s: float = 0.01, until: Callable[[], bool] = lambda: False) -> None:
        """Serve in real time, or ``speed`` times as fast, until ``until()`` is true or interrupted."""
        then = time.monotonic()
        while not until():
            select.select([self._ours], [], [], tick_s)
            now = time.monotonic()
            self._emulator.advance(min(now - then, MAX_STEP_S) * speed)
            then = now
            self.exchange()

    def exchange(self, expected: int = 0) -> None:
        """Pass the host's bytes to the base, waiting for ``expected`` in all; send what the base answers."""
        while True:
            data = self._read(wait=self.received < expected)
            if not data:
                break
            self.received += len(data)
            self._report("<", data)
            self._emulator.receive(data)
        self._write(self._emulator.take())

    def close(self) -> None:
        """Close both ends."""
        for end in (self._ours, self._theirs):
            os.close(end)

    def _read(self, wait: bool) -> bytes:
        if wait:
            select.select([self._ours], [], [], 1.0)
        try:
            return os.read(self._ours, 4096)
        except BlockingIOError:
            return b""

    def _write(self, data: bytes) -> None:
        """Bytes that do not fit into the buffer are lost, as on a wire."""
        if data:
            self._report(">", data)
            try:
                self.sent += os.write(self._ours, data)
            except BlockingIOError:
                return

    def _report(self, direction: str, data: bytes) -> None:
        if self._trace is not None:
            self._trace(direction, data)


MIN_STEP_S = 1e-6
"""Every read takes at least this long, so that time always goes on [s]."""

TICK_S = 0.015
"""Largest step of an emulated base's time [s]."""


class PseudoTerminalLink:
    """A line to an emulated base without real time: the base's time passes only while the host waits for bytes.

    The bytes go through a pseudo-terminal that pyserial opens; both ends are held here. No byte is ever late, so a
    mission over this line is deterministic and takes no longer than its decisions.

    Attributes:
        name: of the pseudo-terminal, as /dev/pts/7.
    """

    def __init__(self, emulator: Emulator, clock: Callable[[], float] | None = None) -> None:
        """``clock``: the time [s] where the emulator itself advances it; None: the sum of the waits here."""
        self._emulator, self._terminal = emulator, PseudoTerminal(emulator)
        self.name = self._terminal.name
        self._port = serial.serial_for_url(self.name)
        self._port.timeout = 2.0
        self._time_s = 0.0
        self._clock = clock
        self._written = self._read = 0
        self._is_open = True

    def write(self, data: bytes) -> None:
        self._port.write(data)
        self._written += len(data)
        self._terminal.exchange(self._written)

    def read(self, timeout_s: float) -> bytes:
        ends_s = self._time_s + max(timeout_s, MIN_STEP_S)
        while self._terminal.sent == self._read and self._time_s < ends_s:
            step_s = max(MIN_STEP_S, min(TICK_S, ends_s - self._time_s))
            self._time_s += step_s
            self._emulator.advance(step_s)
            self._terminal.exchange(self._written)
        data: bytes = self._port.read(self._terminal.sent - self._read) if self._terminal.sent > self._read else b""
        self._read += len(data)
        return data

    def now(self) -> float:
        return self._time_s if self._clock is None else self._clock()

    def reopen(self) -> None:
        """Nothing to do: it is always open."""

    def close(self) -> None:
        """Close both ends."""
        if self._is_open:
            self._is_open = False
            self._port.close()
            self._terminal.close()


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
