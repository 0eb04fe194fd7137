"""Errors that a bad line makes in the bytes on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
