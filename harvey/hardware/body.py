"""A body of metal: a base and a camera put together. What goes wrong with either becomes a value for the board."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Protocol

from harvey.hardware.drivers.bases.base import Base, BaseFault
from harvey.hardware.drivers.cameras.video_camera import CameraFault, VideoCamera
from world_models.entries.body import (
    STOP_KEY,
    BodyFault,
    Course,
    Frame,
    MotionReport,
    MotorCommand,
    Odometry,
    Ride,
    RideReport,
)

BASE_WORDS: Mapping[str, str] = {
    "silent": "link lost",
    "disconnected": "link lost",
    "nonsense": "base answers nonsense",
    "stalled": "stalled",
    "watchdog": "stopped by the watchdog",
    "refused": "base refuses",
    "stopped": "stopped",
}
"""What a base's kinds of fault are called on the board."""
CAMERA_WORDS: Mapping[str, str] = {
    "unplugged": "camera unplugged",
    "late": "frame late",
    "dropped": "frame dropped",
    "dark": "picture is black",
    "wrong size": "picture of the wrong size",
}
"""And a camera's."""
FASTEST_M_PER_S, FASTEST_RAD_PER_S = 0.8, 1.6
"""A base that claims to have gone faster than this, since it was last counted, has lost count."""

AGAIN_S, MOST_STOPS = 0.05, 200
"""A stop is said again so often, until it is heeded."""


class Eye(Protocol):
    """A camera."""

    def look(self, purpose: str, /) -> Frame | BodyFault:
        """A picture that was taken after the call, or what was wrong."""
        ...


class Watching:
    """A camera of metal, whose faults are values.

    Fewer pictures a second than are needed make looks slower, and nothing worse, as the robot stands while it looks:
    that is told once, whenever it begins.
    """

    def __init__(self, camera: VideoCamera, clock: Callable[[], float], rate_hz: float = 0.0) -> None:
        """``rate_hz``: pictures a second that are needed."""
        self._camera, self._clock, self._needed_hz = camera, clock, rate_hz
        self._slow = False

    def look(self, purpose: str) -> Frame | BodyFault:
        """A picture, dated by the clock."""
        try:
            frame = self._camera.look(purpose)
        except CameraFault as fault:
            return self._fault(CAMERA_WORDS[fault.kind], fault.detail)
        rate_hz, was_slow = self._camera.health.rate_hz, self._slow
        self._slow = rate_hz is not None and rate_hz < self._needed_hz
        if self._slow and not was_slow:
            come = f"{rate_hz:.1f} pictures a second come, {self._needed_hz:g} are needed"
            return self._fault("frame rate low", f"{come}: every look takes longer")
        return frame

    def _fault(self, what: str, detail: str) -> BodyFault:
        return BodyFault("camera", what, detail, "", self._clock())


class HardwareBody:
    """A robot by its drivers (:class:`harvey.runner.ports.Body`).

    Args:
        clock: the time that claims and faults are dated by [s].
        pause: waits so long [s]; None: on the wall clock, or until the robot is stopped for good.
        carried: somebody who sees to a ride in an elevator; None: nobody does.
    """

    def __init__(
        self, base: Base, eye: Eye, *, clock: Callable[[], float], pause: Callable[[float], object] | None = None,
        carried: Callable[[Ride], RideReport | BodyFault] | None = None,
    ) -> None:
        self._base, self._eye, self._clock = base, eye, clock
        self._stopped, self._heeded = threading.Event(), threading.Event()
        self._pause = pause or self._stopped.wait
        self._carried = carried
        self._why = ""
        self._began_s = 0.0
        self._before: Odometry | None = None
        self._done: MotionReport | None = None

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        """Carry it out, if the base answers before: the link is known to be alive when the wheels begin to turn."""
        self._began_s, self._before, self._done = self._clock(), None, None
        if self._stopped.is_set():
            return self._stop_fault()
        try:
            self._before = self._base.odometry()
            return self._dated(self._base.execute(command))
        except BaseFault as fault:
            self._done = fault.done
            return self._base_fault(fault)

    def steer(self, course: Course) -> tuple[MotionReport, Frame] | BodyFault:
        """These bases are told how far to go before they set off, and by nobody on the way."""
        detail = "it cannot be steered on the move: drive it with motion.continuous=off"
        return BodyFault("base", "base refuses", detail, "", self._clock(), 0.0, 0.0)

    def claim(self) -> MotionReport | BodyFault:
        """What the wheels count since before the last command, once the base says that it stands."""
        if self._stopped.is_set():
            return self._stop_fault()
        try:
            self._base.stop()
            return self._counted(self._base.odometry())
        except BaseFault as fault:
            return self._base_fault(fault)

    def look(self, purpose: str) -> Frame | BodyFault:
        """A picture."""
        return self._stop_fault() if self._stopped.is_set() else self._eye.look(purpose)

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        """Stand in the car while somebody sees to the ride."""
        if self._stopped.is_set():
            return self._stop_fault()
        if self._carried is None:
            return BodyFault("elevator", "no ride", "nobody is told to press the button", "", self._clock())
        return self._carried(ride)

    def wait(self, duration_s: float) -> float:
        """Stand still for a while."""
        self._pause(duration_s)
        return self._clock()

    def stop(self) -> None:
        """Stand still at once; where the base does not confirm it, its watchdog has to."""
        self._heeded.set()
        self._told_to_stop()

    def stop_for_good(self, why: str) -> None:
        """Somebody wants the robot to stand: at once, from another thread; nothing is carried out any more.

        It is said again until the mission has heeded it: a command may have been on its way when it was said first.
        """
        self._why = self._why or why
        self._stopped.set()
        for _ in range(MOST_STOPS):
            self._told_to_stop()
            if self._heeded.wait(AGAIN_S):
                return

    def _told_to_stop(self) -> None:
        try:
            self._base.stop()
        except BaseFault:
            return

    def _dated(self, report: MotionReport) -> MotionReport:
        """By our clock: a base has its own, or none."""
        return replace(report, sim_time_s=self._clock())

    def _counted(self, now: Odometry) -> MotionReport:
        before = self._before
        if before is None:
            return MotionReport(0.0, 0.0, 0.0, self._clock())
        turn = math.remainder(now.heading_rad - before.heading_rad, math.tau)
        took_s = self._clock() - self._began_s
        dx, dy = now.x_m - before.x_m, now.y_m - before.y_m
        gone = dx * math.cos(now.heading_rad) + dy * math.sin(now.heading_rad)
        if abs(turn) > FASTEST_RAD_PER_S * took_s or math.hypot(dx, dy) > FASTEST_M_PER_S * took_s:
            return self._dated(self._done or MotionReport(0.0, 0.0, 0.0, 0.0))
        return MotionReport(turn, gone, took_s, self._clock())

    def _base_fault(self, fault: BaseFault) -> BodyFault:
        if self._stopped.is_set():
            return self._stop_fault()
        done = fault.done
        stands = "; it stands" if fault.stopped else ""
        return BodyFault(
            "base", BASE_WORDS[fault.kind], f"{fault.detail}{stands}", "", self._clock(),
            None if done is None else done.turn_rad, None if done is None else done.move_m,
        )

    def _stop_fault(self) -> BodyFault:
        self._heeded.set()
        return BodyFault("user", STOP_KEY, self._why, "", self._clock())
