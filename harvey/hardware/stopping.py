"""What stops a robot: its watchdog where the mission hangs, and a key, Ctrl-C, SIGTERM or SIGHUP at once.

Any of space, enter, q and Escape on the terminal is a stop key.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType, TracebackType

from harvey.hardware.drivers.base_driver import Base, BaseFault

BEAT_S = 0.2
"""Period of the beats [s]."""
MAX_SILENCE_S = 10.0
"""A mission whose loop did not tick for so long hangs: the base is stopped, and no beat is sent [s]."""


class Heartbeat:
    """A thread that sends heartbeats as long as :meth:`tick` is called often enough.

    While a motion is under way the driver itself talks to the base, and a beat waits its turn. When the mission hangs,
    the base is stopped and gets no more beats, until the mission goes on.
    """

    def __init__(
        self, base: Base, *, beat_s: float = BEAT_S, max_silence_s: float = MAX_SILENCE_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._base, self._beat_s, self._max_silence_s, self._clock = base, beat_s, max_silence_s, clock
        self._ticked_s = clock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._live, name="heartbeat", daemon=True)
        self.beats = 0

    def tick(self) -> None:
        """The mission goes on."""
        self._ticked_s = self._clock()

    @property
    def beating(self) -> bool:
        """Whether the last tick is recent enough."""
        return self._clock() - self._ticked_s <= self._max_silence_s

    def __enter__(self) -> Heartbeat:
        self.tick()
        self._thread.start()
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(5.0)

    def _live(self) -> None:
        stopped = False
        while not self._over.wait(self._beat_s):
            try:
                if self.beating:
                    self._base.heartbeat()
                    self.beats, stopped = self.beats + 1, False
                elif not stopped:
                    self._base.stop()
                    stopped = True
            except BaseFault:
                continue  # the mission meets the same fault at its next request


KEYS: Mapping[str, str] = {" ": "space", "\n": "enter", "\r": "enter", "q": "q", "\x1b": "escape", "\x03": "Ctrl-C"}
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stop_key(
    stop: Callable[[str], None], terminal: int | None = None, go_on: Callable[[], None] = lambda: None
) -> Iterator[None]:
    """Calls ``stop`` with the reason, from a thread of its own, at a key or a signal; ``go_on`` at the key g.

    The terminal gives single keys meanwhile, and is restored afterwards. A signal that comes a second time has its
    usual effect. Only the main thread can receive signals.

    Args:
        terminal: file descriptor of the terminal; None for standard input.
    """
    fd = terminal if terminal is not None else _standard_input()
    wake_out, wake_in = os.pipe()
    listener = threading.Thread(target=_listen, args=(fd, wake_out, stop, go_on), name="stop key", daemon=True)
    with _single_keys(fd), _signals(wake_in):
        listener.start()
        try:
            yield
        finally:
            os.write(wake_in, b"\0")
            listener.join(2.0)
    for end in (wake_out, wake_in):
        os.close(end)


def _listen(fd: int | None, wake: int, stop: Callable[[str], None], go_on: Callable[[], None]) -> None:
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
            elif data == b"g":
                go_on()
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
