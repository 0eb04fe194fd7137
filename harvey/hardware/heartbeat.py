"""Heartbeat: keeps the base's watchdog quiet, but only while the mission's loop goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

from harvey.hardware.drivers.bases.base import Base, BaseFault

BEAT_S = 0.2
"""Period of the beats [s]."""
MAX_SILENCE_S = 10.0
"""A mission whose loop did not tick for so long hangs: the base is told to stop, and no beat is sent [s]."""


class Heartbeat:
    """A thread that sends heartbeats as long as :meth:`tick` is called often enough.

    While a motion is under way the driver itself talks to the base, and a beat waits its turn. When the mission hangs,
    the base is told to stop and gets no more beats, until the mission goes on.
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
