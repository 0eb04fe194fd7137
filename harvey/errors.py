"""Errors that the command line reports in one line instead of a traceback."""

from __future__ import annotations

import re
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from logs.run_errors import BadInput

__all__ = ["BadInput", "Terminated", "in_one_line", "terminable"]

MOST_LETTERS, MOST_OF_A_WORD = 300, 160


class Terminated(BaseException):
    """SIGTERM came; like KeyboardInterrupt it passes every ``except Exception``, so that files are closed."""


def in_one_line(text: str, most: int = MOST_LETTERS) -> str:
    """A text for a terminal: control characters are spelled out, and what is long is left out of its middle."""
    plain = spell_out(re.sub(r"\s*\n\s*", " ", text[:100 * most]))
    return _without_middle(re.sub(r"\S+", lambda word: _without_middle(word[0], MOST_OF_A_WORD), plain), most)


def spell_out(text: str, but: str = "") -> str:
    """A text whose control characters are spelled out, ``but`` some: it moves no cursor, and turns no line round."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() or letter in but else letter.encode("unicode_escape").decode()
                   for letter in text)


class PlainOutput:
    """Standard output, on which what others wrote in a file is only text."""

    def __init__(self, out: Any) -> None:
        self._out = out

    def write(self, text: str) -> int:
        """Write a text, its control characters spelled out."""
        return int(self._out.write(spell_out(text, "\n\t")))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._out, name)


def _without_middle(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]}...{text[-(most - most // 2 - 3):]}"


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
