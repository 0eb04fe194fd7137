"""Bytes of the iRobot Create 2 Open Interface: opcodes out, a stream of sensor packets back.

Commands carry no checksum and no frame: an opcode says how many bytes follow it. So we put zeros, which are no opcode,
before each command, to complete whatever a lost byte left open; and only use speeds of which no byte is an opcode, so
that nothing we say can be taken for a command that we did not give. The stream has a checksum of eight bits.
Source: iRobot Create 2 Open Interface Specification (2018): Drive Direct 145, Stream 148, packets 7, 35, 41-44.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

START, SAFE, DRIVE_DIRECT, STREAM, STREAM_RESUME = 128, 131, 145, 148, 150
PAD = bytes(4)
OPCODES = frozenset({7, *range(128, 174)})

BUMPS_AND_DROPS, MODE, RIGHT_WANTED, LEFT_WANTED, LEFT_COUNT, RIGHT_COUNT = 7, 35, 41, 42, 43, 44
PACKETS = (MODE, BUMPS_AND_DROPS, RIGHT_WANTED, LEFT_WANTED, LEFT_COUNT, RIGHT_COUNT)
"""What we ask the stream to hold, in this order."""

LIGHTS = (46, 47, 48, 49, 50, 51)
"""Packets of the light bumper, from the left; the stream holds them behind the others where they are wanted."""

MAX_SIGNAL = 4095
SAFE_MODE = 2
HEADER = 19
LENGTH = 16
LENGTH_WITH_LIGHTS = LENGTH + 3 * len(LIGHTS)
"""Of what stands between the length byte and the checksum, for these packets."""


@dataclass(frozen=True, slots=True)
class Report:
    """One frame of the stream.

    Attributes:
        mode: 0 off, 1 passive, 2 safe, 3 full.
        bumps: bit 0 right bumper, 1 left bumper, 2 right wheel dropped, 3 left wheel dropped.
        right_wanted, left_wanted: velocities [mm/s] as the base understood them.
        left_count, right_count: 16 bits that wrap.
        lights: signals of the light bumper, 0 to 4095, from the left; empty where they are not streamed.
    """

    mode: int
    bumps: int
    right_wanted: int
    left_wanted: int
    left_count: int
    right_count: int
    lights: tuple[int, ...] = ()


def drive(right_mm_per_s: int, left_mm_per_s: int) -> bytes:
    """Drive Direct.

    Raises:
        ValueError: a speed is beyond 500 mm/s, or a byte of it could be taken for an opcode.
    """
    for speed in (right_mm_per_s, left_mm_per_s):
        if not is_permitted(speed):
            raise ValueError(f"expected a speed within 500 mm/s without a byte that is an opcode, got {speed}")
    speeds = b"".join(speed.to_bytes(2, "big", signed=True) for speed in (right_mm_per_s, left_mm_per_s))
    return PAD + bytes([DRIVE_DIRECT]) + speeds


def is_permitted(speed: int) -> bool:
    """Whether a speed [mm/s] may be sent."""
    return abs(speed) <= 500 and OPCODES.isdisjoint(speed.to_bytes(2, "big", signed=True))


def wake(*, with_lights: bool = False) -> bytes:
    """Start, and stream to us what we want to know."""
    return PAD + bytes([START]) + stream(with_lights=with_lights)


def stream(*, with_lights: bool = False) -> bytes:
    """Ask for the stream."""
    packets = PACKETS + LIGHTS if with_lights else PACKETS
    return PAD + bytes([STREAM, len(packets), *packets]) + bytes([STREAM_RESUME, 1])


def safe() -> bytes:
    """Safe mode: it obeys, but stops by itself at a cliff, a dropped wheel or a charger."""
    return PAD + bytes([SAFE])


class Decoder:
    """Reports out of whatever bytes come; what is none is passed over, byte by byte, and counted.

    Attributes:
        rejected: headers that no report followed.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.rejected = 0

    def feed(self, data: bytes) -> Iterator[Report]:
        """The reports that are complete with these bytes."""
        self._rest += data
        while (start := self._rest.find(HEADER)) >= 0:
            self._rest = self._rest[start:]
            size = 3 + (LENGTH_WITH_LIGHTS if self._rest[1:2] == bytes([LENGTH_WITH_LIGHTS]) else LENGTH)
            if len(self._rest) < size and _may_become(self._rest):
                return
            report = decode(self._rest[:size])
            self._rest = self._rest[1 if report is None else size:]
            if report is None:
                self.rejected += 1
            else:
                yield report
        self._rest = b""

    def clear(self) -> None:
        """Forget a report that was begun."""
        self._rest = b""


def decode(frame: bytes) -> Report | None:
    """The report of one whole frame; None where it is none, or was garbled."""
    sizes = (LENGTH + 3, LENGTH_WITH_LIGHTS + 3)
    if len(frame) not in sizes or frame[1] != len(frame) - 3 or not _may_become(frame):
        return None
    if sum(int(byte) for byte in frame) % 256 != 0:
        return None
    lights = tuple(int.from_bytes(frame[i:i + 2], "big") for i in range(LENGTH + 3, len(frame) - 1, 3))
    if any(signal > MAX_SIGNAL for signal in lights):
        return None
    words = [int.from_bytes(frame[i:i + 2], "big", signed=True) for i in (7, 10, 13, 16)]
    mode, bumps = frame[3], frame[5]
    if mode > 3:
        return None
    return Report(mode, bumps, words[0], words[1], words[2] & 0xFFFF, words[3] & 0xFFFF, lights)


def _may_become(frame: bytes) -> bool:
    """Whether header, length and packet numbers are where they belong, as far as they have come."""
    fixed = {0: HEADER, 2: MODE, 4: BUMPS_AND_DROPS, 6: RIGHT_WANTED, 9: LEFT_WANTED, 12: LEFT_COUNT, 15: RIGHT_COUNT}
    if len(frame) > 1 and frame[1] == LENGTH_WITH_LIGHTS:
        fixed |= {LENGTH + 2 + 3 * at: number for at, number in enumerate(LIGHTS)}
    elif len(frame) > 1 and frame[1] != LENGTH:
        return False
    return all(frame[at] == value for at, value in fixed.items() if at < len(frame))
