"""An emulated base on a pseudo-terminal: a host opens it as a serial port."""

from __future__ import annotations

import os
import select
import time
import tty
from collections.abc import Callable

from sim.emulators.emulator import Emulator

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
