"""An emulated iRobot Create 2, written from the Open Interface Specification: no frames, no checksum, no watchdog.

The host sends an opcode, then the bytes that belong to it. Where the manual says nothing, a byte that is no opcode is
ignored. Clean, Spot, Max and Dock make it drive about by itself. No code of the driver is used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from sim.emulators.emulator import EmulatorKind, Ground
from world_models.frames import Pose2

STREAM_S = 0.015
AXLE_M = 0.235
MM_PER_COUNT = math.pi * 72.0 / 508.8
MAX_SPEED_MM_PER_S = 500
OFF, PASSIVE, SAFE, FULL = range(4)
LENGTHS: Mapping[int, int] = {
    129: 1, 137: 4, 138: 1, 139: 3, 141: 1, 142: 1, 144: 3, 145: 4, 146: 4, 147: 1, 150: 1, 162: 2, 163: 4, 164: 4,
    165: 2, 167: 15, 168: 3,
}
"""Data bytes of an opcode; 140, 148 and 149 give their own number, all others have none."""

SIZES: Mapping[int, int] = {7: 1, 35: 1, 41: 2, 42: 2, 43: 2, 44: 2, **dict.fromkeys(range(46, 52), 2)}
"""Bytes of the sensor packets that it can send."""

LIGHTS = (65, 38, 13, -13, -38, -65)
"""Directions of the light bumper's sensors [degrees], packets 46 to 51; they are on the rim."""

RADIUS_M = 0.17
MAX_SIGNAL, FADING_M = 4095, 0.05
"""The signal of a thing that is touched, and over which distance it falls to a third."""

WANDERING = (300, 150)
"""Wheel speeds (right, left) while it cleans: a circle [mm/s]."""


class Create2Emulator:
    """The robot's side of the Open Interface.

    Attributes:
        on_command: called with the bytes of every command that was executed, if given.
        mode: 0 off, 1 passive, 2 safe, 3 full.
        deaf: whether it was set to another baud rate, so that nothing is understood in either direction.
        first_count: the count of its encoders after it was switched on.
    """

    def __init__(self, ground: Ground, *, count: int = 0, on_command: Callable[[bytes], None] | None = None) -> None:
        """``count``: see ``first_count``."""
        self._ground, self.first_count, self.on_command = ground, count, on_command
        self.stops = 0
        self.power_cycle()

    def power_cycle(self) -> None:
        """Off and on again: it stands, and all state is lost."""
        self.mode, self.deaf = OFF, False
        self._pending, self._out = bytearray(), bytearray()
        self._wanted = (0, 0)
        self._wandering = self._bumped = False
        self._stream: tuple[int, ...] = ()
        self._streaming = False
        self._since_s = 0.0
        self._right = self._left = float(self.first_count)

    @property
    def moving(self) -> bool:
        """Whether the motors run."""
        return self._speeds != (0, 0)

    @property
    def _speeds(self) -> tuple[int, int]:
        if self._wandering:
            return WANDERING
        return self._wanted if self.mode in (SAFE, FULL) else (0, 0)

    def receive(self, data: bytes) -> None:
        """Take bytes from the line."""
        for byte in data if not self.deaf else b"":
            self._pending.append(byte)
            if len(self._pending) > self._length():
                command = bytes(self._pending)
                self._pending.clear()
                self._obey(command[0], command[1:], command)

    def take(self) -> bytes:
        """Return the bytes for the line since the last call."""
        out = b"" if self.deaf else bytes(self._out)
        self._out.clear()
        return out

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        left_s = duration_s
        while left_s > 1e-9:
            tick_s = min(left_s, STREAM_S - self._since_s if self._since_s < STREAM_S - 1e-9 else STREAM_S)
            self._roll(tick_s)
            self._since_s += tick_s
            left_s -= tick_s
            if self._since_s >= STREAM_S - 1e-9:
                self._since_s = 0.0
                if self._streaming:
                    self._send_stream()

    def _length(self) -> int:
        """Data bytes of the pending opcode, as far as it is known how many they are."""
        got, opcode = self._pending, self._pending[0]
        if opcode in (148, 149):
            return 1 + got[1] if len(got) > 1 else 1
        if opcode == 140:
            return 2 + 2 * got[2] if len(got) > 2 else 2
        return LENGTHS.get(opcode, 0)

    def _obey(self, opcode: int, values: bytes, raw: bytes) -> None:
        if self.on_command is not None and opcode in (7, *range(128, 174)):
            self.on_command(raw)
        if opcode == 128:
            self._enter(PASSIVE)
        elif self.mode == OFF:
            return
        elif opcode in (7, 133, 173):
            self._enter(OFF)
            self._streaming = False
        elif opcode in (130, 131):
            self._enter(SAFE)
        elif opcode == 132:
            self._enter(FULL)
        elif opcode in (134, 135, 136, 143):
            self._enter(PASSIVE)
            self._wandering = True
        elif opcode == 129 and values[0] <= 11:
            self.deaf = values[0] != 11
        elif opcode in (137, 145, 146) and self.mode in (SAFE, FULL):
            self._drive(opcode, values)
        elif opcode == 148:
            self._stream = tuple(values[1:]) if all(number in SIZES for number in values[1:]) else ()
            self._streaming = bool(self._stream)
        elif opcode == 150:
            self._streaming = values[0] == 1 and bool(self._stream)

    def _enter(self, mode: int) -> None:
        """Enter a mode. A change of mode stops the wheels, the same mode again does not."""
        if mode != self.mode or self._wandering:
            self._wanted, self._wandering = (0, 0), False
        self.mode = mode

    def _drive(self, opcode: int, values: bytes) -> None:
        first, second = (int.from_bytes(values[i:i + 2], "big", signed=True) for i in (0, 2))
        if opcode == 137:
            first, second = _wheel_speeds(first, second)
        elif opcode == 146:
            first, second = (round(value * MAX_SPEED_MM_PER_S / 255) for value in (first, second))
        self._wanted = (_limit(first), _limit(second))

    def _roll(self, tick_s: float) -> None:
        right, left = self._speeds
        turn, move = (right - left) / 1000.0 / AXLE_M * tick_s, (right + left) / 2000.0 * tick_s
        turned, moved = self._ground.roll(turn, move, tick_s)
        self._bumped = (turn, move) != (0.0, 0.0) and (turned, moved) == (0.0, 0.0)
        self._right += 1000.0 * (moved + turned * AXLE_M / 2.0) / MM_PER_COUNT
        self._left += 1000.0 * (moved - turned * AXLE_M / 2.0) / MM_PER_COUNT

    def _send_stream(self) -> None:
        """Send one frame of the stream; its bytes sum to 0 modulo 256."""
        body = b"".join(bytes([number]) + self._packet(number) for number in self._stream)
        frame = bytes([19, len(body)]) + body
        self._out += frame + bytes([-sum(int(byte) for byte in frame) % 256])

    def _bumps(self) -> int:
        """Which halves of the bumper are pressed: bit 0 the right one, bit 1 the left one."""
        touching_rad = self._ground.touching_rad
        if touching_rad is None:
            return 3
        if abs(touching_rad) > math.pi / 2.0:
            return 0
        middle_rad = math.radians(15.0)
        return (touching_rad < middle_rad) | (touching_rad > -middle_rad) << 1

    def _signal(self, angle_deg: int) -> int:
        """What a sensor of the light bumper sees."""
        away_m = self._ground.echo(Pose2(0.0, 0.0, math.radians(angle_deg)) @ Pose2(RADIUS_M, 0.0, 0.0))
        return 0 if away_m is None else round(MAX_SIGNAL * math.exp(-max(0.0, away_m) / FADING_M))

    def _packet(self, number: int) -> bytes:
        if number >= 46:
            return self._signal(LIGHTS[number - 46]).to_bytes(2, "big")
        value = {
            7: self._bumps() if self._bumped else 0, 35: self.mode, 41: self._wanted[0], 42: self._wanted[1],
            43: math.floor(self._left), 44: math.floor(self._right),
        }[number]
        return (value % (1 << 8 * SIZES[number])).to_bytes(SIZES[number], "big")


def _wheel_speeds(speed: int, radius: int) -> tuple[int, int]:
    """Wheel speeds (right, left) [mm/s] of opcode 137: straight for 32767 and -32768, in place for 1 and -1 [mm]."""
    if radius in (32767, -32768):
        return speed, speed
    if radius in (1, -1):
        return radius * speed, -radius * speed
    if radius == 0:
        return 0, 0
    half = 1000.0 * AXLE_M / 2.0
    return round(speed * (1.0 + half / radius)), round(speed * (1.0 - half / radius))


def _limit(speed: int) -> int:
    return max(-MAX_SPEED_MM_PER_S, min(MAX_SPEED_MM_PER_S, speed))


KIND = EmulatorKind("create2", Create2Emulator)
