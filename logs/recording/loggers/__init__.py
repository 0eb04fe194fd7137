"""One small logger a file: each turns what changed in a cycle into what a person sees of it."""

from __future__ import annotations

from typing import Protocol

from logs.recording.board_mirror import Moment
from logs.recording.stream import RecordingStream


class Logger(Protocol):
    """Draws one thing."""

    def begin(self, stream: RecordingStream) -> None:
        """What holds at all times: shapes, styles."""

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        """What this cycle changed."""
