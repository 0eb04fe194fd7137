"""An emulated Pioneer, written from the tables of the P2OS manual, with its watchdog. No code of the driver is used."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sim.emulators.emulator import EmulatorKind, Ground
from world_models.frames import Pose2

STRING = 0x2B
NEGATIVE = 0x1B


@dataclass(frozen=True, slots=True)
class Request:
    """A client command.

    Attributes:
        number: of the command.
        argument: 0 where there is none.
        raw: the bytes of command, type and argument.
    """

    number: int
    argument: int
    raw: bytes


def build_packet(content: bytes) -> bytes:
    """A packet with header, length and checksum."""
    return b"\xfa\xfb" + struct.pack("B", len(content) + 2) + content + struct.pack(">H", compute_checksum(content))


def compute_checksum(content: bytes) -> int:
    """The packet checksum: a sum of 16-bit words, and a last odd byte by exclusive or."""
    total, left = 0, len(content)
    at = 0
    while left > 1:
        total = (total + (content[at] << 8 | content[at + 1])) & 0xFFFF
        at, left = at + 2, left - 2
    if left:
        total ^= content[at]
    return total


class PacketReader:
    """The base's receiver: finds commands in a stream of bytes, and resynchronizes after a bad packet."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self.rejected = 0

    def feed(self, data: bytes) -> list[Request]:
        """The commands that these bytes complete."""
        requests = []
        for byte in data:
            self._bytes.append(byte)
            if not self._may_become_packet():
                self.rejected += len(self._bytes) > 2
                self._bytes[:] = b"\xfa" if byte == 0xFA else b""
            elif len(self._bytes) > 3 and len(self._bytes) == 3 + self._bytes[2]:
                content = bytes(self._bytes[3:-2])
                if compute_checksum(content) == self._bytes[-2] << 8 | self._bytes[-1]:
                    requests.append(_parse_request(content))
                else:
                    self.rejected += 1
                self._bytes.clear()
        return requests

    def _may_become_packet(self) -> bool:
        """Whether the bytes so far can begin a packet: header, then a length within bounds."""
        got = self._bytes
        return b"\xfa\xfb".startswith(bytes(got[:2])) and (len(got) < 3 or 3 <= got[2] <= 249)


def _parse_request(content: bytes) -> Request:
    if len(content) < 4 or content[1] == STRING:
        return Request(content[0], 0, content)
    amount: int = struct.unpack_from("<H", content, 2)[0]
    if content[1] != NEGATIVE and amount > 32767:
        amount -= 65536
    return Request(content[0], -amount if content[1] == NEGATIVE else amount, content)


def build_status(
    *, moving: bool, x: int, y: int, heading: int, left: int, right: int, stalled: bool, enabled: bool,
    front: int = 0, rear: int = 0, sonars: Sequence[tuple[int, int]] = (),
) -> bytes:
    """A standard server information packet: battery full, nothing on the ports.

    Args:
        front, rear: pressed segments of the bumpers, a bit each.
        sonars: (number, range) of those that have heard since the last packet.
    """
    return build_packet(struct.pack(
        "<BHHhhhBBBhHBB",
        0x33 if moving else 0x32, x & 0x7FFF, y & 0x7FFF, heading, left, right, 130,
        int(stalled) | rear << 1, int(stalled) | front << 1, 0, int(enabled), 0, len(sonars),
    ) + b"".join(struct.pack("<BH", *sonar) for sonar in sonars) + bytes(4))


def build_encoder_counts(left: int, right: int) -> bytes:
    """An encoder packet."""
    return build_packet(struct.pack("<Bii", 0x90, left, right))


WATCHDOG_S = 2.0
STATUS_S = 0.1
TICK_S = 0.015
AXLE_M = 0.33
COUNTS_PER_M = 132_000
NAMES = b"Harvey_0001\0Pioneer\0p3dx-sh\0"


SONARS = (
    (69, 136, 90), (114, 119, 50), (148, 78, 30), (166, 27, 10), (166, -27, -10), (148, -78, -30), (114, -119, -50),
    (69, -136, -90), (-157, -136, -90), (-203, -119, -130), (-237, -78, -150), (-255, -27, -170), (-255, 27, 170),
    (-237, 78, 150), (-203, 119, 130), (-157, 136, 90))
"""Where each sonar is [mm] and faces [degrees], in the robot's frame."""

NO_ECHO_MM = 5000
HEARD_PER_STATUS = 4
"""Sonars that fire between two status packets."""

FRONT_BUMPERS = (52, 19, 0, -19, -52)
"""Directions of the segments [degrees]; those of the rear are opposite."""


class Axis:
    """The controller of one axis, translation [m] or rotation [rad]: to a velocity, or by a distance.

    Attributes:
        rate: present velocity.
        max_rate, max_acceleration: limits.
    """

    def __init__(self, max_rate: float, max_acceleration: float) -> None:
        self.rate, self.max_rate, self.max_acceleration = 0.0, max_rate, max_acceleration
        self._wanted_rate = 0.0
        self._to_go: float | None = None

    def go_at(self, rate: float) -> None:
        """Accelerate to a velocity."""
        self._wanted_rate, self._to_go = max(-self.max_rate, min(self.max_rate, rate)), None

    def go_by(self, way: float) -> None:
        """Go by a distance, and stop there."""
        self._to_go = way

    def stop_at_once(self) -> None:
        """Stop without braking."""
        self.rate = 0.0
        self.go_at(0.0)

    @property
    def at_rest(self) -> bool:
        return self.rate == 0.0 and self._wanted_rate == 0.0 and self._to_go is None

    def step(self, duration_s: float, *, muted: bool) -> float:
        """The distance that it goes in this time; muted, it brakes."""
        change = self.max_acceleration * duration_s
        wanted = self._braking_rate() if self._to_go is not None else self._wanted_rate
        self.rate += max(-change, min(change, (0.0 if muted else wanted) - self.rate))
        way = self.rate * duration_s
        if self._to_go is not None and not muted and abs(self._to_go) <= max(abs(way), 1e-4):
            way, self.rate, self._to_go, self._wanted_rate = self._to_go, 0.0, None, 0.0
        return way

    def confirm(self, way: float) -> None:
        """Take what the wheels really did of the last step."""
        if self._to_go is not None:
            self._to_go -= way

    def _braking_rate(self) -> float:
        to_go = self._to_go or 0.0
        return math.copysign(min(self.max_rate, math.sqrt(2.0 * self.max_acceleration * abs(to_go)) + 0.002), to_go)


class P2osEmulator:
    """The base's side of P2OS.

    Attributes:
        on_command: called with every command that was accepted, if given.
        stops: how often the watchdog stopped it.
    """

    def __init__(self, ground: Ground, *, on_command: Callable[[Request], None] | None = None) -> None:
        self._ground, self.on_command = ground, on_command
        self.stops = 0
        self._reset()

    def _reset(self) -> None:
        self._reader, self._out = PacketReader(), bytearray()
        self._synced, self._open, self._enabled, self._muted = 0, False, False, False
        self._travel, self._turning = Axis(0.4, 0.3), Axis(math.radians(50.0), math.radians(100.0))
        self._x = self._y = self._heading = 0.0
        self._left = self._right = 0.0
        self._stalled = self._encoders = False
        self._quiet_s = self._since_status_s = 0.0
        self._sonars_on, self._next_sonar = False, 0

    def power_cycle(self) -> None:
        """Off and on again: it stands, and all state is lost."""
        self._reset()

    @property
    def rejected(self) -> int:
        """Number of packets that were not understood."""
        return self._reader.rejected

    @property
    def moving(self) -> bool:
        """Whether the motors run."""
        return self._travel.rate != 0.0 or self._turning.rate != 0.0

    @property
    def standing_within_s(self) -> float:
        """Longest time from the last accepted packet until it stands [s]: watchdog, then braking."""
        return WATCHDOG_S + self._travel.max_rate / self._travel.max_acceleration + 2 * TICK_S

    def receive(self, data: bytes) -> None:
        """Take bytes from the line."""
        for request in self._reader.feed(data):
            if self.on_command is not None:
                self.on_command(request)
            self._quiet_s, self._muted = 0.0, False
            if self._open:
                self._obey(request.number, request.argument)
            else:
                self._greet(request.number)

    def take(self) -> bytes:
        """Return the bytes for the line since the last call."""
        out = bytes(self._out)
        self._out.clear()
        return out

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        left_s = duration_s
        while left_s > 1e-9:
            tick_s = min(TICK_S, left_s)
            self._tick(tick_s)
            left_s -= tick_s

    def _tick(self, tick_s: float) -> None:
        self._quiet_s += tick_s
        if self._open and not self._muted and self._quiet_s > WATCHDOG_S:
            self._muted = True
            self.stops += self.moving
        self._roll(tick_s)
        self._since_status_s += tick_s
        if self._open and self._since_status_s >= STATUS_S - 1e-9:
            self._since_status_s = 0.0
            self._send_status()

    def _roll(self, tick_s: float) -> None:
        muted = self._muted or not self._enabled
        turn, move = self._turning.step(tick_s, muted=muted), self._travel.step(tick_s, muted=muted)
        turned, moved = self._ground.roll(turn, move, tick_s)
        self._stalled = (turn, move) != (0.0, 0.0) and (turned, moved) == (0.0, 0.0)
        self._turning.confirm(turned)
        self._travel.confirm(moved)
        self._heading += turned
        self._x += moved * math.cos(self._heading)
        self._y += moved * math.sin(self._heading)
        self._left += moved - turned * AXLE_M / 2.0
        self._right += moved + turned * AXLE_M / 2.0

    def _greet(self, number: int) -> None:
        """Connect: SYNC0, SYNC1, SYNC2 in this order, then OPEN."""
        if number == 1 and self._synced == 3:
            self._open, self._since_status_s = True, 0.0
        elif number <= min(2, self._synced):
            self._synced = number + 1
            self._out += build_packet(bytes([number]) + (NAMES if number == 2 else b""))

    def _obey(self, number: int, argument: int) -> None:
        travel, turning = self._travel, self._turning
        match number:
            case 2:  # CLOSE
                self._reset()
            case 4:  # ENABLE
                self._enabled = argument == 1
            case 5:  # SETA
                travel.max_acceleration = max(0.05, abs(argument) / 1000.0)
            case 6:  # SETV
                travel.max_rate = max(0.0, min(1.2, argument / 1000.0))
            case 7:  # SETO
                self._x = self._y = self._heading = 0.0
            case 8:  # MOVE
                travel.go_by(argument / 1000.0)
            case 10:  # SETRV
                turning.max_rate = max(0.0, min(math.radians(300.0), math.radians(argument)))
            case 11:  # VEL
                travel.go_at(argument / 1000.0)
            case 12:  # HEAD
                turning.go_by(math.remainder(math.radians(argument) - self._heading, 2.0 * math.pi))
            case 13:  # DHEAD
                turning.go_by(math.radians(argument))
            case 19:  # ENCODER
                self._encoders = argument > 0
            case 21:  # RVEL
                turning.go_at(math.radians(argument))
            case 23:  # SETRA
                turning.max_acceleration = max(0.1, abs(math.radians(argument)))
            case 28:  # SONAR
                self._sonars_on = bool(argument & 1)
            case 29:  # STOP
                travel.go_at(0.0)
                turning.go_at(0.0)
            case 55:  # ESTOP
                travel.stop_at_once()
                turning.stop_at_once()

    def _pressed(self, middle_rad: float) -> int:
        """The pressed segment of the bumper in this direction, as a bit."""
        touching_rad = self._ground.touching_rad
        if touching_rad is None:
            return 0
        angles = (middle_rad + math.radians(angle) for angle in FRONT_BUMPERS)
        off = [abs(math.remainder(touching_rad - angle, math.tau)) for angle in angles]
        nearest = off.index(min(off))
        return 1 << nearest if off[nearest] <= math.radians(20.0) else 0

    def _heard(self) -> list[tuple[int, int]]:
        """What the next sonars hear, in turn."""
        if not self._sonars_on:
            return []
        numbers = [(self._next_sonar + at) % len(SONARS) for at in range(HEARD_PER_STATUS)]
        self._next_sonar = (numbers[-1] + 1) % len(SONARS)
        return [(number, self._range_mm(*SONARS[number])) for number in numbers]

    def _range_mm(self, x_mm: int, y_mm: int, angle_deg: int) -> int:
        away_m = self._ground.echo(Pose2(x_mm / 1000.0, y_mm / 1000.0, math.radians(angle_deg)))
        return NO_ECHO_MM if away_m is None else min(NO_ECHO_MM, round(1000.0 * away_m))

    def _send_status(self) -> None:
        left, right = (self._travel.rate + side * self._turning.rate * AXLE_M / 2.0 for side in (-1, 1))
        units = round(self._heading / (2.0 * math.pi) * 4096) % 4096
        self._out += build_status(
            moving=not (self._travel.at_rest and self._turning.at_rest),
            x=round(1000 * self._x), y=round(1000 * self._y), heading=units,
            left=round(1000 * left), right=round(1000 * right), stalled=self._stalled, enabled=self._enabled,
            front=self._pressed(0.0), rear=self._pressed(math.pi), sonars=self._heard(),
        )
        if self._encoders:
            wrap = (round(COUNTS_PER_M * side) for side in (self._left, self._right))
            self._out += build_encoder_counts(*((value + (1 << 31)) % (1 << 32) - (1 << 31) for value in wrap))


KIND = EmulatorKind("p2os", P2osEmulator)
