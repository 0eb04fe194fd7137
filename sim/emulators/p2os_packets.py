"""P2OS packets on the base's side, written from the tables of the manual."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

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
