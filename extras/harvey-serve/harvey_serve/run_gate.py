"""Gate: before each request to the body it waits while the run is paused, and refuses once it is stopped."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Literal

from harvey.runner.ports import Body
from world_models.entries import (
    STOP_KEY,
    BodyFault,
    CameraPicture,
    Contact,
    Course,
    MotionReport,
    MotorCommand,
    Ranges,
    Ride,
    RideReport,
)

Order = Literal["pause", "resume", "stop"]
WHY = "stopped from the page"
TICK_S = 0.2
"""While the run is paused, its heartbeat is called at this period [s]."""


def do_nothing(_why: str = "") -> None:
    """For who needs no call."""


class Gate:
    """What people may do to a run; any thread may call it, and no call waits.

    Args:
        speed: how many times as fast as the body's own time the run may go; 0 for as fast as it computes.

    Attributes:
        on_stop: called with the reason, from the thread of who stops it; a body that moves by itself is told so.
    """

    def __init__(self, speed: float = 0.0) -> None:
        self.speed = speed
        self.on_stop: Callable[[str], None] = do_nothing
        self._open, self._stopped = threading.Event(), threading.Event()
        self._open.set()

    @property
    def state(self) -> str:
        """Running, paused or stopping."""
        return "stopping" if self._stopped.is_set() else "running" if self._open.is_set() else "paused"

    def order(self, order: Order) -> None:
        """Pause, resume, or stop for good; a run that is stopped does not go on."""
        if order == "pause":
            self._open.clear()
            return
        if order == "stop":
            self._stopped.set()
            self.on_stop(WHY)
        self._open.set()

    def hold(self, tick: Callable[[], None]) -> bool:
        """Wait while it is paused, on the run's thread; whether it may go on then. ``tick`` is called meanwhile."""
        while not self._open.wait(TICK_S):
            tick()
        return not self._stopped.is_set()

    def rest(self, duration_s: float) -> None:
        """Wait on the run's thread; a stop ends it."""
        self._stopped.wait(max(0.0, duration_s))


class GatedBody:
    """A body behind a gate. It asks nothing else of the body and changes no answer: the decisions stay the same.

    A stop reaches the board as the stop key of a robot does (:data:`~world_models.entries.body.STOP_KEY`).

    Args:
        tick: called while the run is paused, so that it does not seem to hang.
    """

    def __init__(self, body: Body, gate: Gate, tick: Callable[[], None] = do_nothing) -> None:
        self._body, self._gate, self._tick = body, gate, tick
        self._asked_s, self._body_s = time.monotonic(), 0.0

    def execute(self, command: MotorCommand, /) -> MotionReport | BodyFault:
        if not self._gate.hold(self._tick):
            return self._refuse()
        found = self._body.execute(command)
        self._pace(found.when_s if isinstance(found, BodyFault) else found.sim_time_s)
        return found

    def steer(self, course: Course, /) -> tuple[MotionReport, CameraPicture] | BodyFault:
        if not self._gate.hold(self._tick):
            return self._refuse()
        found = self._body.steer(course)
        self._pace(found.when_s if isinstance(found, BodyFault) else found[1].sim_time_s)
        return found

    def look(self, purpose: str, /) -> CameraPicture | BodyFault:
        if not self._gate.hold(self._tick):
            return self._refuse()
        found = self._body.look(purpose)
        self._pace(found.when_s if isinstance(found, BodyFault) else found.sim_time_s)
        return found

    def ride(self, ride: Ride, /) -> RideReport | BodyFault:
        return self._body.ride(ride) if self._gate.hold(self._tick) else self._refuse()

    def wait(self, duration_s: float, /) -> float:
        self._gate.hold(self._tick)
        now_s = self._body.wait(duration_s)
        self._pace(now_s)
        return now_s

    def claim(self) -> MotionReport | BodyFault:
        return self._body.claim()

    def take_contact(self) -> Contact | None:
        return self._body.take_contact()

    def ranges(self) -> Ranges | None:
        return self._body.ranges()

    def stop(self) -> None:
        self._body.stop()

    def _refuse(self) -> BodyFault:
        """The robot stands, and says who wanted it to."""
        now_s = self._body.wait(0.0)
        self._body.stop()
        return BodyFault("user", STOP_KEY, WHY, "", now_s)

    def _pace(self, body_s: float) -> None:
        """Let as much time pass here as passed for the body since it answered last [s]."""
        if self._gate.speed > 0.0:
            took_s = time.monotonic() - self._asked_s
            self._gate.rest((body_s - self._body_s) / self._gate.speed - took_s)
        self._asked_s, self._body_s = time.monotonic(), body_s
