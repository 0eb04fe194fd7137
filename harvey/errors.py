"""Errors that the command line reports in one line instead of a traceback."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from logs.run_errors import BadInput

__all__ = ["BadInput", "Terminated", "terminable"]


class Terminated(BaseException):
    """SIGTERM came; like KeyboardInterrupt it passes every ``except Exception``, so that files are closed."""


@contextmanager
def terminable() -> Iterator[None]:
    """Turns SIGTERM into :class:`Terminated` for a while; only the main thread may set signals."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _terminate(_number: int, _frame: FrameType | None) -> None:
    raise Terminated
