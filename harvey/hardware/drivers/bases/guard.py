"""A watchdog for bases that have none: it stops the base when the program gives no sign of life any more.

It lives in our process and speaks over our line. It helps when the driving thread hangs; where the whole process dies
or the cable is cut, nothing of ours can stop a base without a watchdog of its own.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable


class Guard:
    """Says stop when it is armed and no sign of life came for a while.

    Attributes:
        struck: how often it did.
    """

    def __init__(self, stop: Callable[[], None], now: Callable[[], float], watchdog_s: float) -> None:
        """``stop`` says it to the base and may raise OSError; it is called from the thread of :meth:`start`."""
        self._stop, self._now, self._watchdog_s = stop, now, watchdog_s
        self._alive_s = math.inf
        self._over = threading.Event()
        self.struck = 0

    def arm(self) -> None:
        """The wheels turn from now on; also the sign of life."""
        self._alive_s = self._now()

    def disarm(self) -> None:
        """The wheels stand."""
        self._alive_s = math.inf

    def check(self) -> None:
        """Strike, if it is time to."""
        if self._now() - self._alive_s > self._watchdog_s:
            self.struck += 1
            try:
                self._stop()
            except OSError:
                return  # the line is gone; the program meets the same fault

    def start(self) -> None:
        """Check from a thread of its own, until :meth:`close`."""
        threading.Thread(target=self._watch, name="guard of the base", daemon=True).start()

    def close(self) -> None:
        """Watch no more."""
        self._over.set()

    def _watch(self) -> None:
        while not self._over.wait(self._watchdog_s / 4.0):
            self.check()
