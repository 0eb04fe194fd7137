"""What a serial line needs of an emulated base."""

from __future__ import annotations

from typing import Protocol


class Emulator(Protocol):
    """The base's side of a protocol: bytes in, bytes out, and time that passes. It does no input or output itself."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the line."""
        ...

    def advance(self, duration_s: float) -> None:
        """Let time pass: motors run, watchdogs act, what is due is sent."""
        ...

    def take(self) -> bytes:
        """Return the bytes for the line since the last call."""
        ...

    @property
    def moving(self) -> bool:
        """Whether the motors run."""
        ...
