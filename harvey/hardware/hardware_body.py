"""The body of a real robot: a base and a camera. A fault of either becomes a value for the board."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Protocol

from harvey.hardware.drivers.base_driver import Base, BaseFault
from harvey.hardware.drivers.capture import CameraFault
from harvey.hardware.drivers.video_camera import VideoCamera
from world_models.entries import (
    STOP_KEY,
    BodyFault,
    CameraPicture,
    Contact,
    Course,
    MotionReport,
    MotorCommand,
    Odometry,
    Ranges,
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
"""A base's kinds of fault, as the board names them."""
CAMERA_WORDS: Mapping[str, str] = {
    "unplugged": "camera unplugged",
    "late": "frame late",
    "dropped": "frame dropped",
    "dark": "picture is black",
    "wrong size": "picture of the wrong size",
}
"""A camera's kinds of fault, as the board names them."""
MAX_SPEED_M_PER_S, MAX_SPEED_RAD_PER_S = 0.8, 1.6
"""A base that claims to have gone faster than this, since it was last counted, has lost count."""

STOP_PERIOD_S, MAX_STOPS = 0.05, 200
"""A stop is sent again at this period, and at most so often, until it is heeded."""


class CameraPort(Protocol):
    """A camera."""

    def look(self, purpose: str, /) -> CameraPicture | BodyFault:
        """A picture that was taken after the call, or what was wrong."""
        ...


class WatchedCamera:
    """A camera whose faults are values.

    A frame rate below what the mission needs is reported once, when it begins: the robot stands while it looks, so
    looks only take longer.
    """

    def __init__(self, camera: VideoCamera, clock: Callable[[], float], rate_hz: float = 0.0) -> None:
        """``rate_hz``: pictures a second that are needed."""
        self._camera, self._clock, self._needed_hz = camera, clock, rate_hz
        self._slow = False

    def look(self, purpose: str) -> CameraPicture | BodyFault:
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
    """A real robot by its drivers: a :class:`harvey.runner.ports.Body`.

    Args:
        clock: the time of reports and faults [s].
        pause: waits so long [s]; None: by the wall clock, or until the robot is stopped for good.
        carried: carries out a ride in an elevator; None: there is no ride.
        ranges: whether the base's range sensors are read.
    """

    def __init__(
        self, base: Base, eye: CameraPort, *, clock: Callable[[], float],
        pause: Callable[[float], object] | None = None,
        carried: Callable[[Ride], RideReport | BodyFault] | None = None, ranges: bool = False,
    ) -> None:
        self._base, self._eye, self._clock = base, eye, clock
        self._stopped, self._heeded = threading.Event(), threading.Event()
        self._pause = pause or self._stopped.wait
        self._carried, self._has_ranges = carried, ranges
        self._why = ""
        self._began_s = 0.0
        self._before: Odometry | None = None
        self._done: MotionReport | None = None

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        """Carry out a command, if the base answers before: the link is alive when the wheels begin to turn."""
        self._began_s, self._before, self._done = self._clock(), None, None
        if self._stopped.is_set():
            return self._to_stop_fault()
        try:
            self._before = self._base.odometry()
            return self._with_own_time(self._base.execute(command))
        except BaseFault as fault:
            self._done = fault.done
            return self._to_base_fault(fault)

    def steer(self, course: Course) -> tuple[MotionReport, CameraPicture] | BodyFault:
        """A fault: these bases take the whole motion as one command."""
        detail = "it cannot be steered on the move: drive it with motion.continuous=off"
        return BodyFault("base", "base refuses", detail, "", self._clock(), 0.0, 0.0)

    def claim(self) -> MotionReport | BodyFault:
        """What the wheels counted since the last command began, once the base has stopped."""
        if self._stopped.is_set():
            return self._to_stop_fault()
        try:
            self._base.stop()
            return self._measure_motion(self._base.odometry())
        except BaseFault as fault:
            return self._to_base_fault(fault)

    def take_contact(self) -> Contact | None:
        """What the base felt to touch, by our clock."""
        contact = self._base.take_contact()
        return None if contact is None else replace(contact, when_s=self._clock())

    def ranges(self) -> Ranges | None:
        """What the base's range sensors measure, where they are wanted; none where it does not answer: the next motion
        finds out why.
        """
        if not self._has_ranges or self._stopped.is_set():
            return None
        try:
            found = self._base.ranges()
        except BaseFault:
            return None
        return None if found is None else replace(found, when_s=self._clock())

    def look(self, purpose: str) -> CameraPicture | BodyFault:
        """A picture."""
        return self._to_stop_fault() if self._stopped.is_set() else self._eye.look(purpose)

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        """Wait in the car until the ride is over."""
        if self._stopped.is_set():
            return self._to_stop_fault()
        if self._carried is None:
            return BodyFault("elevator", "no ride", "nobody is told to press the button", "", self._clock())
        return self._carried(ride)

    def wait(self, duration_s: float) -> float:
        """Stand still for a while."""
        self._pause(duration_s)
        return self._clock()

    def stop(self) -> None:
        """Stop at once; where the base does not confirm it, its watchdog stops it."""
        self._heeded.set()
        self._send_stop()

    def stop_for_good(self, why: str) -> None:
        """Stop at once, from another thread; nothing is carried out any more.

        The stop is sent again until the mission has heeded it: a command may have been on its way at the first.
        """
        self._why = self._why or why
        self._stopped.set()
        for _ in range(MAX_STOPS):
            self._send_stop()
            if self._heeded.wait(STOP_PERIOD_S):
                return

    def _send_stop(self) -> None:
        try:
            self._base.stop()
        except BaseFault:
            return

    def _with_own_time(self, report: MotionReport) -> MotionReport:
        """The report by our clock: a base has its own, or none."""
        return replace(report, sim_time_s=self._clock())

    def _measure_motion(self, now: Odometry) -> MotionReport:
        before = self._before
        if before is None:
            return MotionReport(0.0, 0.0, 0.0, self._clock())
        turn = math.remainder(now.heading_rad - before.heading_rad, math.tau)
        took_s = self._clock() - self._began_s
        dx, dy = now.x_m - before.x_m, now.y_m - before.y_m
        gone = dx * math.cos(now.heading_rad) + dy * math.sin(now.heading_rad)
        if abs(turn) > MAX_SPEED_RAD_PER_S * took_s or math.hypot(dx, dy) > MAX_SPEED_M_PER_S * took_s:
            return self._with_own_time(self._done or MotionReport(0.0, 0.0, 0.0, 0.0))
        return MotionReport(turn, gone, took_s, self._clock())

    def _to_base_fault(self, fault: BaseFault) -> BodyFault:
        if self._stopped.is_set():
            return self._to_stop_fault()
        done = fault.done
        stands = "; it stands" if fault.stopped else ""
        return BodyFault(
            "base", BASE_WORDS[fault.kind], f"{fault.detail}{stands}", "", self._clock(),
            None if done is None else done.turn_rad, None if done is None else done.move_m,
        )

    def _to_stop_fault(self) -> BodyFault:
        self._heeded.set()
        return BodyFault("user", STOP_KEY, self._why, "", self._clock())
