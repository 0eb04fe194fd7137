"""Packets of P2OS, the Pioneers' operating system, and of its successors AROS and ARCOS.

``FA FB COUNT COMMAND [TYPE ARGUMENT] CHECKSUM``: COUNT is of the bytes behind it; an argument is two bytes, low byte
first, of type 3B, or of type 1B with the amount of a negative number; the checksum is two bytes, high byte first. From
the base come echoes of SYNC and server information packets. Source: ActivMedia's Pioneer 2 / PeopleBot manual
(2001), "Client commands" and "Server information packets", and the Pioneer 3 manual's tables of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

HEADER = b"\xfa\xfb"
MAX_LENGTH = 200
"""The largest COUNT that either side may send."""

SYNC0, SYNC1, SYNC2 = 0, 1, 2
PULSE, OPEN, CLOSE, ENABLE, SETA, SETV, SETO, MOVE = 0, 1, 2, 4, 5, 6, 7, 8
SETRV, VEL, HEAD, DHEAD, ENCODER, RVEL, SETRA, SONAR, STOP, ESTOP = 10, 11, 12, 13, 19, 21, 23, 28, 29, 55


@dataclass(frozen=True, slots=True)
class Status:
    """A standard server information packet, in the base's own units; bumpers as ARIA and Player read them.

    Attributes:
        moving: whether the motors run.
        x, y: 15 bits each, which wrap.
        heading: 4096 to the turn, 16 bits.
        left, right: wheel velocities.
        stalled: whether a motor is.
        enabled: whether the motors may run.
        front, rear: pressed segments of the bumpers, a bit each, from the left.
        sonars: (number, range) of those that have heard since the last packet.
    """

    moving: bool
    x: int
    y: int
    heading: int
    left: int
    right: int
    stalled: bool
    enabled: bool
    front: int = 0
    rear: int = 0
    sonars: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, slots=True)
class Counts:
    """An encoder packet: the counts of both wheels, 32 bits signed."""

    left: int
    right: int


@dataclass(frozen=True, slots=True)
class Echo:
    """The base's answer to SYNC0, SYNC1 or SYNC2; the last one tells who it is.

    Attributes:
        number: 0, 1 or 2.
        names: name, class and subclass, with SYNC2.
    """

    number: int
    names: tuple[str, ...] = ()


def encode(command: int, argument: int | None = None) -> bytes:
    """The packet of a command.

    Raises:
        ValueError: the argument is not within 16 bits.
    """
    if argument is None:
        return _packet(bytes([command]))
    if not -65535 <= argument <= 65535:
        raise ValueError(f"expected an argument of 16 bits, got {argument}")
    return _packet(bytes([command, 0x3B if argument >= 0 else 0x1B]) + abs(argument).to_bytes(2, "little"))


def checksum(content: bytes) -> int:
    """Of the bytes between COUNT and checksum: the sum of their pairs, high byte first; a single last one is xored."""
    total = sum(int(byte) for byte in content[0:len(content) - 1:2]) * 256 + sum(int(byte) for byte in content[1::2])
    return (total & 0xFFFF) ^ content[-1] if len(content) % 2 else total & 0xFFFF


def _packet(content: bytes) -> bytes:
    return HEADER + bytes([len(content) + 2]) + content + checksum(content).to_bytes(2, "big")


class Decoder:
    """Packets out of whatever bytes come; what is none is passed over, byte by byte, and counted.

    Attributes:
        rejected: headers that no packet followed.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.rejected = 0

    def feed(self, data: bytes) -> Iterator[Status | Counts | Echo]:
        """What is complete with these bytes; packets of other kinds are passed over."""
        self._rest += data
        while (content := self._next()) is not None:
            meaning = understood(content)
            if meaning is not None:
                yield meaning

    def clear(self) -> None:
        """Forget a packet that was begun."""
        self._rest = b""

    def _next(self) -> bytes | None:
        """The content of the next packet that is one."""
        while (start := self._rest.find(HEADER)) >= 0:
            rest = self._rest = self._rest[start:]
            if len(rest) < 3:
                return None
            end = 3 + rest[2]
            if 3 <= rest[2] <= MAX_LENGTH:
                if len(rest) < end:
                    return None
                if checksum(rest[3:end - 2]) == int.from_bytes(rest[end - 2:end], "big"):
                    self._rest = rest[end:]
                    return rest[3:end - 2]
            self.rejected += 1
            self._rest = rest[1:]
        self._rest = self._rest[-1:] if self._rest.endswith(HEADER[:1]) else b""
        return None


def understood(content: bytes) -> Status | Counts | Echo | None:
    """What the content of a packet from the base says; None where it is of another kind."""
    kind = content[0]
    if kind in (SYNC0, SYNC1) and len(content) == 1:
        return Echo(kind)
    if kind == SYNC2:
        names = content[1:].split(b"\0")
        return Echo(kind, tuple(name.decode("ascii", "replace") for name in names[:3]))
    if kind in (0x32, 0x33) and len(content) >= 20:
        return _status(content)
    if kind == 0x90 and len(content) >= 9:
        left, right = (int.from_bytes(content[i:i + 4], "little", signed=True) for i in (1, 5))
        return Counts(left, right)
    return None


def _status(content: bytes) -> Status:
    ends = min(20 + 3 * content[19], len(content) - 2)
    x, y, heading, left, right = (content[i] | content[i + 1] << 8 for i in range(1, 11, 2))
    return Status(
        moving=content[0] == 0x33, x=x & 0x7FFF, y=y & 0x7FFF, heading=heading,
        left=left - (left >> 15 << 16), right=right - (right >> 15 << 16),
        stalled=bool((content[12] | content[13]) & 1), enabled=bool(content[16] & 1),
        front=content[13] >> 1, rear=content[12] >> 1,
        sonars=tuple((content[i], content[i + 1] | content[i + 2] << 8) for i in range(20, ends, 3)),
    )
