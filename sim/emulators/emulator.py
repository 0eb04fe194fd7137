"""What every emulated base is to the line that it hangs on."""

from __future__ import annotations

from typing import Protocol


class Emulator(Protocol):
    """The base's side of a protocol: bytes in, bytes out, and time that passes. It does no input or output itself."""

    def receive(self, data: bytes) -> None:
        """Bytes from the line."""
        ...

    def advance(self, duration_s: float) -> None:
        """Time passes: motors run, watchdogs strike, what is due is said."""
        ...

    def take(self) -> bytes:
        """Bytes for the line, each once."""
        ...

    @property
    def moving(self) -> bool:
        """Whether its motors run."""
        ...
