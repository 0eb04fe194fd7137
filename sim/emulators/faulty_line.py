"""A serial line with the faults of a simulated body: nothing comes through, or only noise."""

from __future__ import annotations

import zlib

from sim.body.simulated_body import SimulatedBody
from sim.emulators.emulator import Emulator
from sim.faults.base_faults import LinkLost, Nonsense


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
