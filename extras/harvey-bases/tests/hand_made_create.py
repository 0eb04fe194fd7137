"""A Create 2 for tests of its driver: a report every 20 ms on a clock of milliseconds, and all that it was told."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from harvey_bases.create2 import Create2Base

TICK_MS = 20
M_PER_COUNT = math.pi * 0.072 / 508.8
STREAMED = (35, 7, 41, 42, 43, 44)


class HandMadeCreate:
    """The link and the base behind it; its wheels go exactly as fast as they are told to.

    Attributes:
        said: (time [s], opcode, values) of all that it was told; those of 145 are the speeds (right, left) [mm/s].
        spoil: changes what a report tells; given ``mode``, ``bumps``, ``wanted``, ``left``, ``right`` [m], ``lights``.
        wheels: changes how far (right, left) the wheels go in a tick [m].
    """

    def __init__(self, right_m: float = 0.0, left_m: float = 0.0) -> None:
        self.right_m, self.left_m = right_m, left_m
        self.said: list[tuple[float, int, tuple[int, ...]]] = []
        self.spoil: Callable[[dict[str, Any]], dict[str, Any]] = lambda report: report
        self.wheels: Callable[[float, float], tuple[float, float]] = lambda right, left: (right, left)
        self.is_silent, self.mode, self.has_lights = False, 1, True
        self.wanted = (0, 0)
        self.streamed: tuple[int, ...] = ()
        self.time_ms = 0

    def now(self) -> float:
        return self.time_ms / 1000.0

    def write(self, data: bytes) -> None:
        at = 0
        while at < len(data):
            opcode, length = data[at], {145: 4, 150: 1}.get(data[at], 0)
            if opcode == 148:
                length = 1 + data[at + 1]
            values = data[at + 1:at + 1 + length]
            if opcode:
                self._obey(opcode, values)
            at += 1 + length

    def read(self, timeout_s: float) -> bytes:
        ends_ms = self.time_ms + round(1000.0 * timeout_s)
        data = b""
        while not data and (tick_ms := (self.time_ms // TICK_MS + 1) * TICK_MS) <= ends_ms:
            self.time_ms = tick_ms
            data = self._tick()
        self.time_ms = self.time_ms if data else ends_ms
        return data

    def reopen(self) -> None:
        """Nothing was closed."""

    def close(self) -> None:
        """Nothing is open."""

    def drives(self) -> list[tuple[int, ...]]:
        """The wheel speeds that it was told, each once."""
        told = [values for _, opcode, values in self.said if opcode == 145]
        return [speeds for at, speeds in enumerate(told) if at == 0 or told[at - 1] != speeds]

    def times(self, opcode: int) -> list[float]:
        """When each such command was said [s]."""
        return [when for when, code, _ in self.said if code == opcode]

    def _obey(self, opcode: int, values: bytes) -> None:
        words = tuple(values)
        if opcode == 145:
            words = tuple(int.from_bytes(values[i:i + 2], "big", signed=True) for i in (0, 2))
            self.wanted = (words[0], words[1])
        elif opcode == 148:
            self.streamed = words[1:]
        elif opcode == 131:
            self.mode, self.wanted = 2, (0, 0)
        self.said.append((self.now(), opcode, words))

    def _tick(self) -> bytes:
        right, left = self.wheels(*(0.001 * speed * TICK_MS / 1000.0 for speed in self.wanted))
        self.right_m, self.left_m = self.right_m + right, self.left_m + left
        told = self.spoil({"mode": self.mode, "bumps": 0, "wanted": self.wanted, "right": self.right_m,
                           "left": self.left_m, "lights": (0,) * 6})
        if self.is_silent or not self.streamed:
            return b""
        counts = (round(told["left"] / M_PER_COUNT), round(told["right"] / M_PER_COUNT))
        body = bytes([35, told["mode"], 7, told["bumps"]])
        for number, word in zip((41, 42, 43, 44), (*told["wanted"], *counts), strict=True):
            body += bytes([number]) + (word % 65536).to_bytes(2, "big")
        if 46 in self.streamed and self.has_lights:
            body += b"".join(bytes([46 + at]) + light.to_bytes(2, "big") for at, light in enumerate(told["lights"]))
        frame = bytes([19, len(body)]) + body
        return frame + bytes([-sum(frame) % 256])


def connect(base: HandMadeCreate) -> Create2Base:
    """Its driver, in safe mode, with nothing said yet."""
    driver = Create2Base(base)
    driver.odometry()
    base.said.clear()
    return driver
