"""A Pioneer for tests of its driver: ten statuses a second on a clock of whole milliseconds, and all that it was told.

It turns 10 degrees and moves 50 mm between two statuses, exactly; a test may spoil what it tells or what it does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from harvey_bases.p2os import P2osBase
from harvey_bases.p2os_emulator import PacketReader, build_packet, build_status

TICK_MS = 100
SYNC0, OPEN, CLOSE, ENABLE, MOVE, HEAD, ESTOP = 0, 1, 2, 4, 8, 12, 55
NAMES = ("HandMade", "Pioneer", "p3dx-sh")


class HandMadePioneer:
    """The link and the base behind it.

    Attributes:
        said: (time [s], command, argument) of all that it was told.
        spoil: changes what a status tells; given the status as a dict.
        is_silent: it tells nothing any more.
        shortens: how far [mm] it goes of what MOVE asks for.
        mm_per_unit: what its odometry counts in.
        misses_deg: it ends its turns so far from the heading that it was told.
    """

    def __init__(
        self, names: tuple[str, ...] = NAMES, x: float = 100.0, y: float = 200.0, heading: float = 0.0
    ) -> None:
        self.names, self.x, self.y, self.heading_deg = names, x, y, heading
        self.said: list[tuple[float, int, int]] = []
        self.spoil: Callable[[dict[str, Any]], dict[str, Any]] = lambda status: status
        self.shortens: Callable[[int], int] = lambda asked: asked
        self.misses_deg, self.mm_per_unit = 0.0, 1.0
        self.is_silent = self.is_open = self.enabled = False
        self.time_ms = 0
        self._goal_deg: float | None = None
        self._left_mm = 0
        self._reader, self._out = PacketReader(), b""

    def now(self) -> float:
        return self.time_ms / 1000.0

    def write(self, data: bytes) -> None:
        for request in self._reader.feed(data):
            self.said.append((self.now(), request.number, request.argument))
            self._obey(request.number, request.argument)

    def read(self, timeout_s: float) -> bytes:
        ends_ms = self.time_ms + round(1000.0 * timeout_s)
        while not self._out and (tick_ms := (self.time_ms // TICK_MS + 1) * TICK_MS) <= ends_ms:
            self.time_ms = tick_ms
            if self.is_open:
                self._tick()
            if self.is_silent:
                self._out = b""
        self.time_ms = self.time_ms if self._out else ends_ms
        out, self._out = self._out, b""
        return out

    def reopen(self) -> None:
        """Nothing was closed."""

    def close(self) -> None:
        """Nothing is open."""

    def told(self, number: int) -> list[int]:
        """The arguments of each such command, in turn."""
        return [argument for _, command, argument in self.said if command == number]

    def times(self, number: int) -> list[float]:
        """When each such command was said [s]."""
        return [when for when, command, _ in self.said if command == number]

    def _obey(self, number: int, argument: int) -> None:
        if not self.is_open:
            if number <= 2 and not self.is_silent:
                names = "\0".join(self.names).encode() + b"\0" if number == 2 else b""
                self._out += build_packet(bytes([number]) + names)
                self.is_open = number == 2
        elif number == CLOSE:
            self.is_open = False
        elif number == ENABLE:
            self.enabled = bool(argument)
        elif number == MOVE:
            self._left_mm = self.shortens(argument)
        elif number == HEAD:
            self._goal_deg = argument - self.misses_deg
        elif number == ESTOP:
            self._goal_deg, self._left_mm = None, 0

    def _tick(self) -> None:
        turns = moves = 0.0
        if self._goal_deg is not None:
            off = (self._goal_deg - self.heading_deg + 180.0) % 360.0 - 180.0
            turns = max(-10.0, min(10.0, off))
        if self._left_mm:
            moves = max(-50, min(50, self._left_mm))
            self._left_mm -= round(moves)
        self.heading_deg += turns
        self.x += moves * math.cos(math.radians(self.heading_deg))
        self.y += moves * math.sin(math.radians(self.heading_deg))
        status = {
            "moving": abs(turns) > 1e-9 or moves != 0.0,
            "x": round(self.x / self.mm_per_unit) % 32768,
            "y": round(self.y / self.mm_per_unit) % 32768,
            "heading": round(self.heading_deg / 360.0 * 4096.0) % 4096,
            "left": 0,
            "right": 0,
            "stalled": False,
            "enabled": self.enabled,
            "front": 0,
            "rear": 0,
            "sonars": (),
        }
        self._out += build_status(**self.spoil(status))


def connect(base: HandMadePioneer, **settings: float) -> P2osBase:
    """Its driver, after the greeting, with nothing said yet."""
    driver = P2osBase(base, **settings)
    driver.odometry()
    base.said.clear()
    return driver


def from_now_on(spoiled: Iterable[dict[str, Any]]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Each status changed as the next of these says; unchanged when they are used up."""
    changes = iter(spoiled)
    return lambda status: status | next(changes, {})
