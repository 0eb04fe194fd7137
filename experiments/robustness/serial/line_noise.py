"""What a bad line does to the bytes on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

KINDS = ("flipped", "dropped", "duplicated", "repeated late", "delayed", "truncated", "spliced", "inserted")
"""flipped: one to three bits. dropped: one to three bytes. duplicated: the whole, at once again. repeated late: the
whole again, a while later. delayed: it and all behind it. truncated: the rest is lost. spliced: a piece of something
older is put in. inserted: random bytes are."""

LATE_S = 0.3
"""The longest delay, and the longest time after which something comes once more."""


@dataclass(frozen=True, slots=True)
class Garbled:
    """What becomes of something said.

    Attributes:
        data: what comes out.
        delay_s: how much later than usual, with all behind it.
        again_s: when it comes out once more; 0.0: never.
        kind: of what was done to it, "" for nothing.
    """

    data: bytes
    delay_s: float = 0.0
    again_s: float = 0.0
    kind: str = ""


class Noise:
    """Does one thing of :data:`KINDS` to what is said, with a given probability.

    Attributes:
        done: how often, by kind.
    """

    def __init__(self, rng: np.random.Generator, probability: float, kinds: Sequence[str] = KINDS) -> None:
        self._rng, self.probability, self._kinds = rng, probability, tuple(kinds)
        self._older: list[bytes] = []
        self.done: dict[str, int] = dict.fromkeys(kinds, 0)

    def garbled(self, data: bytes) -> Garbled:
        """What becomes of it."""
        if not data or self._rng.random() >= self.probability:
            self._keep(data)
            return Garbled(data)
        kind = self._kinds[int(self._rng.integers(len(self._kinds)))]
        self.done[kind] += 1
        result = self._after(kind, data)
        self._keep(data)
        return result

    def _keep(self, data: bytes) -> None:
        self._older = [*self._older[-15:], data]

    def _after(self, kind: str, data: bytes) -> Garbled:
        rng, at = self._rng, int(self._rng.integers(len(data)))
        if kind == "flipped":
            bits = bytearray(data)
            for _ in range(int(rng.integers(1, 4))):
                bits[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
            return Garbled(bytes(bits), kind=kind)
        if kind == "dropped":
            return Garbled(data[:at] + data[at + int(rng.integers(1, 4)):], kind=kind)
        if kind == "duplicated":
            return Garbled(data + data, kind=kind)
        if kind == "repeated late":
            return Garbled(data, again_s=float(rng.uniform(0.02, LATE_S)), kind=kind)
        if kind == "delayed":
            return Garbled(data, delay_s=float(rng.uniform(0.02, LATE_S)), kind=kind)
        if kind == "truncated":
            return Garbled(data[:at], kind=kind)
        piece = rng.bytes(int(rng.integers(1, 24))) if kind == "inserted" else self._piece()
        return Garbled(data[:at] + piece + data[at:], kind=kind)

    def _piece(self) -> bytes:
        if not self._older:
            return b""
        older = self._older[int(self._rng.integers(len(self._older)))]
        first, last = sorted(int(i) for i in self._rng.integers(0, len(older) + 1, 2))
        return older[first:last]
