"""A pseudo-terminal with an emulated base behind it: a serial port as far as anybody who opens it can tell."""

from __future__ import annotations

import os
import select
import time
import tty
from collections.abc import Callable

from sim.emulators.emulator import Emulator

Trace = Callable[[str, bytes], None]
"""Told of the traffic: ``<`` for what came from the host, ``>`` for what the base says, and the bytes."""

MOST_S = 0.25
"""A server that was held up for longer lets the base's time stand still instead of catching up."""


class PseudoTerminal:
    """An emulated base on a pseudo-terminal.

    Attributes:
        name: what to open, as /dev/pts/7.
        received, sent: bytes so far, from the host and to it.
    """

    def __init__(self, emulator: Emulator, trace: Trace | None = None) -> None:
        """Open a pseudo-terminal in raw mode; the other end stays open here, so that a host may come and go."""
        self._emulator, self._trace = emulator, trace
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.name = os.ttyname(self._theirs)
        self.received = self.sent = 0

    def serve(self, speed: float = 1.0, tick_s: float = 0.01, until: Callable[[], bool] = lambda: False) -> None:
        """Serve in real time, or ``speed`` times as fast, until told otherwise or interrupted."""
        then = time.monotonic()
        while not until():
            select.select([self._ours], [], [], tick_s)
            now = time.monotonic()
            self._emulator.advance(min(now - then, MOST_S) * speed)
            then = now
            self.exchange()

    def exchange(self, expected: int = 0) -> None:
        """Take what has come, and at least ``expected`` bytes of it; pass on what the base says to that."""
        while True:
            data = self._read(wait=self.received < expected)
            if not data:
                break
            self.received += len(data)
            self._tell("<", data)
            self._emulator.receive(data)
        self._say(self._emulator.take())

    def close(self) -> None:
        """Hang up: the host's end of the line is gone."""
        for end in (self._ours, self._theirs):
            os.close(end)

    def _read(self, wait: bool) -> bytes:
        if wait:
            select.select([self._ours], [], [], 1.0)
        try:
            return os.read(self._ours, 4096)
        except BlockingIOError:
            return b""

    def _say(self, data: bytes) -> None:
        """What does not fit, because nobody reads it, is lost, as on a wire."""
        if data:
            self._tell(">", data)
            try:
                self.sent += os.write(self._ours, data)
            except BlockingIOError:
                return

    def _tell(self, direction: str, data: bytes) -> None:
        if self._trace is not None:
            self._trace(direction, data)
