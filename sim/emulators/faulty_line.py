"""A line that fails when the simulated body says so: nothing comes through, or nothing but noise."""

from __future__ import annotations

import zlib

from sim.body.simulated_body import SimulatedBody
from sim.emulators.emulator import Emulator


class FaultyLine:
    """An emulated base behind a line with the ailments ``link_lost`` and ``nonsense`` of a simulated body."""

    def __init__(self, emulator: Emulator, body: SimulatedBody) -> None:
        self._emulator, self._body = emulator, body
        self._noise = 0

    def receive(self, data: bytes) -> None:
        """What the host says, if the line is there."""
        if "link_lost" not in self._body.ailing:
            self._emulator.receive(data)

    def advance(self, duration_s: float) -> None:
        """Time passes on both sides of the line."""
        self._emulator.advance(duration_s)

    def take(self) -> bytes:
        """What the base says, if the line is there; noise of the same length, always the same, if it is noisy."""
        said, ailing = self._emulator.take(), self._body.ailing
        if "link_lost" in ailing:
            return b""
        if "nonsense" in ailing:
            self._noise = zlib.crc32(said, self._noise)
            return bytes((b ^ (self._noise >> (i % 24))) & 0xFF for i, b in enumerate(said))
        return said

    @property
    def moving(self) -> bool:
        """Whether the base's motors run."""
        return self._emulator.moving
