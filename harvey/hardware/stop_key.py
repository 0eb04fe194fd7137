"""The stop key: any of space, enter, q or Escape on the terminal, Ctrl-C, SIGTERM and SIGHUP stop the robot at once."""

from __future__ import annotations

import os
import select
import signal
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType

KEYS: Mapping[str, str] = {" ": "space", "\n": "enter", "\r": "enter", "q": "q", "\x1b": "escape", "\x03": "Ctrl-C"}
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stop_key(stop: Callable[[str], None], terminal: int | None = None) -> Iterator[None]:
    """Calls ``stop`` with the reason, from a thread of its own, at a key or a signal.

    The terminal gives single keys meanwhile, and is restored afterwards. A signal that comes a second time has its
    usual effect. Only the main thread can receive signals.

    Args:
        terminal: file descriptor of the terminal; None for standard input.
    """
    fd = terminal if terminal is not None else _standard_input()
    wake_out, wake_in = os.pipe()
    listener = threading.Thread(target=_listen, args=(fd, wake_out, stop), name="stop key", daemon=True)
    with _single_keys(fd), _signals(wake_in):
        listener.start()
        try:
            yield
        finally:
            os.write(wake_in, b"\0")
            listener.join(2.0)
    for end in (wake_out, wake_in):
        os.close(end)


def _listen(fd: int | None, wake: int, stop: Callable[[str], None]) -> None:
    """Until a zero byte comes down the pipe; a signal sends its number."""
    ends = [wake] if fd is None else [wake, fd]
    while True:
        ready, _, _ = select.select(ends, [], [])
        if wake in ready:
            number = os.read(wake, 1)[0]
            if number == 0:
                return
            stop(f"stopped by {'Ctrl-C' if number == signal.SIGINT else signal.Signals(number).name}")
        if fd is not None and fd in ready:
            data = os.read(fd, 1)
            if not data:
                ends.remove(fd)
            elif (key := KEYS.get(data.decode("latin-1"))) is not None:
                stop(f"stopped by the {key} key")


@contextmanager
def _signals(wake: int) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {int(number): signal.getsignal(number) for number in SIGNALS}

    def forward(number: int, _frame: FrameType | None) -> None:
        os.write(wake, bytes([number]))
        signal.signal(number, before[number])

    for number in before:
        signal.signal(number, forward)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _single_keys(fd: int | None) -> Iterator[None]:
    """Keys come at once and are not shown; Ctrl-C still is a signal."""
    if fd is None:
        yield
        return
    before = termios.tcgetattr(fd)
    tty.setcbreak(fd)
    try:
        yield
    finally:
        termios.tcsetattr(fd, termios.TCSADRAIN, before)


def _standard_input() -> int | None:
    """Its descriptor, where it is a terminal."""
    try:
        return sys.stdin.fileno() if sys.stdin is not None and sys.stdin.isatty() else None
    except (OSError, ValueError):
        return None
