"""One small logger a file: each turns what changed in a cycle into what a person sees of it."""

from __future__ import annotations

from typing import Protocol

from logs.mirror import Moment
from logs.tape import Tape


class Logger(Protocol):
    """Draws one thing."""

    def begin(self, tape: Tape) -> None:
        """What holds at all times: shapes, styles."""

    def log(self, tape: Tape, moment: Moment) -> None:
        """What this cycle changed."""
