"""The heart: tells the base that somebody is there, but only while the mission goes on thinking."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

from harvey.hardware.drivers.bases.base import Base, BaseFault

BEAT_S = 0.2
"""How often it beats [s]."""
HANGS_S = 10.0
"""A mission that has not said for so long that it goes on is taken to hang: the heart stops, and so does the base."""


class Heartbeat:
    """A thread that beats as long as it is told often enough that the mission goes on.

    While a motion is under way the driver itself talks to the base, and a beat waits its turn. When the mission hangs,
    the heart tells the base to stop and beats no more, until the mission goes on.
    """

    def __init__(
        self, base: Base, *, beat_s: float = BEAT_S, hangs_s: float = HANGS_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._base, self._beat_s, self._hangs_s, self._clock = base, beat_s, hangs_s, clock
        self._told_s = clock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._live, name="heart", daemon=True)
        self.beats = 0

    def tick(self) -> None:
        """The mission goes on."""
        self._told_s = self._clock()

    @property
    def beating(self) -> bool:
        """Whether the mission is taken to go on."""
        return self._clock() - self._told_s <= self._hangs_s

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
                continue  # the mission hears of it when it next asks something of the base
