"""Messages through a pipe of bytes, each with its length and the key of its topic before it: no network, no real time.
"""

from __future__ import annotations

import struct
import zlib
from collections import deque
from typing import Any

from harvey.hardware.drivers.base_driver import BytePipe
from harvey_ros2.messages.messages import MessageTypes
from harvey_ros2.messages.middleware import Heard

HEAD = struct.Struct("<2sBHI")
"""The letters R2, the length of the key, the length of the message, a checksum of both."""
MOST = 4096
"""The longest message [bytes]: no picture goes this way."""


class PipeMessages:
    """A :class:`harvey_ros2.robot.node.RobotMessages` over a pipe."""

    def __init__(self, link: BytePipe, types: MessageTypes) -> None:
        self._link, self.types = link, types
        self._rest = b""
        self._waiting: deque[tuple[str, Heard]] = deque()

    def send(self, key: str, message: Any) -> None:
        """Send a message."""
        body = key.encode() + self.types.encode(message)
        self._link.write(HEAD.pack(b"R2", len(key), len(body) - len(key), zlib.crc32(body)) + body)

    def receive(self, timeout_s: float) -> tuple[str, Heard] | None:
        """The oldest message that was not read yet."""
        ends_s = self.now() + timeout_s
        while not self._waiting:
            left_s = ends_s - self.now()
            if left_s < 0.0:
                return None
            self._feed(self._link.read(left_s))
            if left_s == 0.0:
                break
        return self._waiting.popleft() if self._waiting else None

    def is_ours(self, _key: str, _heard: Heard) -> bool:
        """There is nobody else."""
        return True

    def now(self) -> float:
        return self._link.now()

    def time_there(self) -> float:
        return self._link.now()

    def picture_age_s(self) -> float | None:
        """Pictures come differently."""
        return None

    def reopen(self) -> None:
        """Try the line again."""
        self._link.reopen()
        self._rest = b""

    def close(self) -> None:
        """Let the line go."""
        self._link.close()

    def _feed(self, data: bytes) -> None:
        """Take bytes; what is no message is passed over, byte by byte."""
        self._rest += data
        while (start := self._rest.find(b"R2")) >= 0:
            self._rest = self._rest[start:]
            if len(self._rest) < HEAD.size:
                return
            _, key_length, length, check = HEAD.unpack_from(self._rest)
            body = self._rest[HEAD.size:HEAD.size + key_length + length]
            if length <= MOST and len(body) < key_length + length:
                return
            if length > MOST or zlib.crc32(body) != check:
                self._rest = self._rest[1:]
                continue
            self._waiting.append((body[:key_length].decode("ascii", "replace"),
                                  Heard(body[key_length:], "", self.now())))
            self._rest = self._rest[HEAD.size + len(body):]
        self._rest = self._rest[-1:]
