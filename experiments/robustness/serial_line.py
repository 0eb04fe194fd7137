"""A serial line in memory with its own clock, which makes errors in the bytes and breaks; and findings over it."""

from __future__ import annotations

import heapq
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sim.emulators.emulator import Emulator

PROTOCOLS = ("denning", "p2os", "create2")


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds of a protocol.

    Attributes:
        done_m, done_rad: largest shortfall of a motion that is reported done.
        beyond_m, beyond_rad: largest excess of a motion over its command, while the base can be reached.
        operations: reads and writes within which a line breaks.
    """

    done_m: float
    done_rad: float
    beyond_m: float
    beyond_rad: float
    operations: int


BOUNDS: Mapping[str, Bounds] = {
    "denning": Bounds(1e-9, 1e-9, 1e-9, 1e-9, 60),
    "p2os": Bounds(0.02, math.radians(2.0), 0.35, math.radians(45.0), 100),
    "create2": Bounds(0.02, math.radians(10.0), 0.35, math.radians(120.0), 400),
}
"""Denning: rounding only. P2OS and Create 2: the distance until the driver notices and stops the base."""


@dataclass
class Findings:
    """Findings of trials.

    Attributes:
        violations: descriptions of violated bounds.
        beyond_m, beyond_rad: largest excess of a motion over its command, while the base could be reached.
        strays: motions with an excess of more than 2 cm or 2 degrees, while the base could be reached.
        overtaken: reports of a motion given after a late command had moved the base on.
        restarted: times that noise restarted a base that stood when its driver last heard from it.
        forged: commands that the base accepted but nobody sent.
        stops, late: how often it had to stop within the watchdog time, and how often it did not.
        unreachable: times that a base without watchdog ran on: line cut, host dead, or another baud rate.
        ran_on_m: largest distance that it ran on.
        resumed, ended: trials in which a command was executed once the line was good again, of all.
        deafened: times that noise set another baud rate, so that the base had to be power-cycled.
        deaths, blackouts, cuts: of the host, of the base, of the line.
        states: (last message of the host, whether the base moved) when the line broke.
    """

    frames: int = 0
    asked: int = 0
    done: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    noise: Counter[str] = field(default_factory=Counter)
    violations: list[str] = field(default_factory=list)
    beyond_m: float = 0.0
    beyond_rad: float = 0.0
    strays: int = 0
    overtaken: int = 0
    restarted: int = 0
    forged: int = 0
    stops: int = 0
    late: int = 0
    unreachable: int = 0
    ran_on_m: float = 0.0
    deafened: int = 0
    deaths: int = 0
    blackouts: int = 0
    cuts: int = 0
    resumed: int = 0
    ended: int = 0
    longest_s: float = 0.0
    states: set[tuple[str, bool]] = field(default_factory=set)


KINDS = ("flipped", "dropped", "duplicated", "repeated late", "delayed", "truncated", "spliced", "inserted")
"""flipped: one to three bits. dropped: one to three bytes. duplicated: the message twice. repeated late: the message
again, later. delayed: the message and all behind it. truncated: the rest is lost. spliced: a piece of an older message
is inserted. inserted: random bytes are inserted."""

LATE_S = 0.3
"""Longest delay, also of a repeated message."""


@dataclass(frozen=True, slots=True)
class Received:
    """A message after the line.

    Attributes:
        data: bytes received.
        delay_s: extra delay, also of all behind it.
        again_s: time after which it is received again; 0.0: never.
        kind: of the error, "" for none.
    """

    data: bytes
    delay_s: float = 0.0
    again_s: float = 0.0
    kind: str = ""


class Noise:
    """Makes one error of :data:`KINDS` in a message, with a given probability.

    Attributes:
        done: number of errors by kind.
    """

    def __init__(self, rng: np.random.Generator, probability: float, kinds: Sequence[str] = KINDS) -> None:
        self._rng, self.probability, self._kinds = rng, probability, tuple(kinds)
        self._older: list[bytes] = []
        self.done: dict[str, int] = dict.fromkeys(kinds, 0)

    def garble(self, data: bytes) -> Received:
        """Pass a message through the line."""
        if not data or self._rng.random() >= self.probability:
            self._keep(data)
            return Received(data)
        kind = self._kinds[int(self._rng.integers(len(self._kinds)))]
        self.done[kind] += 1
        result = self._after(kind, data)
        self._keep(data)
        return result

    def _keep(self, data: bytes) -> None:
        self._older = [*self._older[-15:], data]

    def _after(self, kind: str, data: bytes) -> Received:
        rng, at = self._rng, int(self._rng.integers(len(data)))
        if kind == "flipped":
            bits = bytearray(data)
            for _ in range(int(rng.integers(1, 4))):
                bits[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
            return Received(bytes(bits), kind=kind)
        if kind == "dropped":
            return Received(data[:at] + data[at + int(rng.integers(1, 4)):], kind=kind)
        if kind == "duplicated":
            return Received(data + data, kind=kind)
        if kind == "repeated late":
            return Received(data, again_s=float(rng.uniform(0.02, LATE_S)), kind=kind)
        if kind == "delayed":
            return Received(data, delay_s=float(rng.uniform(0.02, LATE_S)), kind=kind)
        if kind == "truncated":
            return Received(data[:at], kind=kind)
        piece = rng.bytes(int(rng.integers(1, 24))) if kind == "inserted" else self._piece()
        return Received(data[:at] + piece + data[at:], kind=kind)

    def _piece(self) -> bytes:
        if not self._older:
            return b""
        older = self._older[int(self._rng.integers(len(self._older)))]
        first, last = sorted(int(i) for i in self._rng.integers(0, len(older) + 1, 2))
        return older[first:last]


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
