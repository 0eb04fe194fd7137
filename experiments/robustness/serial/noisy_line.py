"""A line in memory with its own clock, which makes errors in the bytes, and breaks."""

from __future__ import annotations

import heapq
import math

from experiments.robustness.serial.line_noise import Noise
from sim.emulators.emulator import Emulator

LATENCY_S = 0.003
MIN_READ_S = 1e-6
"""Shortest duration of a read, so that time goes on whatever the host does."""


class Killed(BaseException):
    """The host process dies here."""


class NoisyLine:
    """A link between a host's driver and an emulated base.

    Attributes:
        frames: number of messages of both sides.
        said, ever_said: the host's last message, and all of its messages.
        cuts: (last message of the host, whether the base was moving) for each time that the line broke.
    """

    def __init__(self, emulator: Emulator, to_base: Noise, to_host: Noise, *, tick_s: float) -> None:
        """``tick_s``: largest step of the emulator's time."""
        self._emulator, self._tick_s = emulator, tick_s
        self._noise = {"base": to_base, "host": to_host}
        self._free_s = {"base": 0.0, "host": 0.0}
        self._flying: dict[str, list[tuple[float, int, bytes]]] = {"base": [], "host": []}
        self._time_s, self._down_s = 0.0, -math.inf
        self._left = self._pause_s = math.inf
        self._number = self.frames = 0
        self.said = b""
        self.ever_said: set[bytes] = set()
        self.cuts: list[tuple[bytes, bool]] = []

    def break_after(self, operations: int, for_s: float) -> None:
        """Break after a number of reads and writes of the host, for a time; if infinite, the host dies there."""
        self._left, self._pause_s = operations, for_s

    def write(self, data: bytes) -> None:
        self._operation()
        self.said = data
        self.ever_said.add(data)
        self._say("base", data)

    def read(self, timeout_s: float) -> bytes:
        self._operation()
        ends_s = self._time_s + max(timeout_s, MIN_READ_S)
        while not (data := self._due("host")) and self._time_s < ends_s:
            self._step(ends_s)
        return data

    def now(self) -> float:
        return self._time_s

    def reopen(self) -> None:
        if self._time_s < self._down_s:
            raise OSError("no such device")

    def close(self) -> None:
        """Do nothing: nothing is open."""

    def wait(self, duration_s: float) -> None:
        """Let time pass while the host does nothing."""
        ends_s = self._time_s + duration_s
        while self._time_s < ends_s:
            self._step(ends_s)
            if self._time_s < self._down_s:
                self._flying["host"].clear()

    @property
    def is_down(self) -> bool:
        """Whether the line is broken now."""
        return self._time_s < self._down_s

    @property
    def settled_s(self) -> float:
        """Time at which the host's last message will have arrived."""
        return max([self._time_s, *(arrives_s for arrives_s, _, _ in self._flying["base"])])

    def quieten(self) -> None:
        """Make the line good from now on."""
        self._left, self._down_s = math.inf, -math.inf
        for noise in self._noise.values():
            noise.probability = 0.0

    def _operation(self) -> None:
        self._left -= 1
        if self._left <= 0:
            self._left = math.inf
            self.cuts.append((self.said, self._emulator.moving))
            for flying in self._flying.values():
                flying.clear()
            if math.isinf(self._pause_s):
                raise Killed
            self._down_s = self._time_s + self._pause_s
        if self._time_s < self._down_s:
            raise OSError("the device is gone")

    def _step(self, ends_s: float) -> None:
        """Advance to the next event, at most to ``ends_s``."""
        coming = [f[0][0] for f in self._flying.values() if f and f[0][0] > self._time_s]
        then_s = min([max(ends_s, self._time_s + MIN_READ_S), self._time_s + self._tick_s, *coming])
        if then_s > self._time_s:
            self._emulator.advance(then_s - self._time_s)
            self._time_s = then_s
        self._answer()
        if data := self._due("base"):
            self._emulator.receive(data)
            self._answer()

    def _answer(self) -> None:
        said = self._emulator.take()
        if said and self._time_s >= self._down_s:
            self._say("host", said)

    def _say(self, to: str, data: bytes) -> None:
        """Send a message; messages keep their order, except repeated ones."""
        self.frames += 1
        result = self._noise[to].garble(data)
        arrives_s = max(self._free_s[to], self._time_s + LATENCY_S) + result.delay_s
        self._free_s[to] = arrives_s
        self._push(to, arrives_s, result.data)
        if result.again_s:
            self._push(to, arrives_s + result.again_s, data)

    def _push(self, to: str, arrives_s: float, data: bytes) -> None:
        self._number += 1
        heapq.heappush(self._flying[to], (arrives_s, self._number, data))

    def _due(self, to: str) -> bytes:
        """Take the bytes that have arrived by now."""
        flying, data = self._flying[to], b""
        while flying and flying[0][0] <= self._time_s:
            data += heapq.heappop(flying)[2]
        return data
