"""The line to a base: bytes out, bytes in, and the clock that both ends live by."""

from __future__ import annotations

import time
from typing import Protocol

import serial


class Link(Protocol):
    """A byte pipe that may garble, lose and break. Every method raises OSError where the line is gone."""

    def write(self, data: bytes) -> None:
        """Send."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """What has come, at once if there is any; else whatever comes first within the time, or b""."""
        ...

    def now(self) -> float:
        """The time [s] on the clock that timeouts are counted by. Never raises."""
        ...

    def reopen(self) -> None:
        """Try the line again after it was gone; what had come before is forgotten."""
        ...

    def close(self) -> None:
        """Let the line go. Never raises."""
        ...


class SerialLink:
    """A line of pyserial: a device, a pseudo-terminal, or any URL that ``serial.serial_for_url`` knows."""

    def __init__(self, url: str, baud: int) -> None:
        """Open it. Raises OSError."""
        self._url, self._baud = url, baud
        self._port = self._open()

    def write(self, data: bytes) -> None:
        self._port.write(data)

    def read(self, timeout_s: float) -> bytes:
        self._port.timeout = max(0.0, timeout_s)
        first: bytes = self._port.read(1)
        return first + self._port.read(self._port.in_waiting) if first else b""

    def now(self) -> float:
        return time.monotonic()

    def reopen(self) -> None:
        self.close()
        self._port = self._open()

    def close(self) -> None:
        try:
            self._port.close()
        except OSError:
            return

    def _open(self) -> serial.SerialBase:
        """The write timeout keeps a dead line from holding us."""
        try:
            return serial.serial_for_url(self._url, baudrate=self._baud, timeout=0.1, write_timeout=0.5)
        except ValueError as error:
            raise OSError(f"{self._url}: expected a serial port or a URL that pyserial knows, got: {error}") from None
