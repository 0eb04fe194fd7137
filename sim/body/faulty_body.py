"""The simulated body as it is reached through its devices: their faults answer in its place.

It stands between the agent and the simulated robot, as cables and drivers do, and reports faults in the words of the
real drivers.
"""

from __future__ import annotations

from dataclasses import replace

from sim.body.simulated_body import SimulatedBody
from sim.faults.fault import DeviceFault
from world_models.entries import (
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


class FaultyBody:
    """A simulated robot, as far as its base and its camera work."""

    def __init__(self, body: SimulatedBody) -> None:
        self._body = body
        self._done: MotionReport | None = None

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        """As the body does. With a fault of the base nothing moves; one on the way breaks the motion off."""
        fault = self._find_fault("base")
        if fault is not None:
            self._done = MotionReport(0.0, 0.0, 0.0, self._body.truth.time_s)
            return self._answer(fault, self._done)
        self._done = self._body.execute(command)
        fault = self._find_fault("base")
        if fault is not None:
            return self._answer(fault, self._done if fault.odometry_arrives else None)
        return replace(self._done, sim_time_s=self._body.truth.time_s)

    def steer(self, course: Course) -> tuple[MotionReport, CameraPicture] | BodyFault:
        """As the body does; with a fault of the base or the camera it stops."""
        fault = self._find_fault("base") or self._find_fault("camera")
        if fault is None:
            answer = self._body.steer(course)
            if isinstance(answer, BodyFault):
                self._done = MotionReport(answer.turn_rad or 0.0, answer.move_m or 0.0, 0.0, answer.when_s)
            return answer
        began_s = self._body.truth.time_s
        self._done = self._body.halt(fault.stops_motion_after_s or 0.0)
        return replace(self._answer(fault, self._done if fault.odometry_arrives else None), when_s=began_s)

    def claim(self) -> MotionReport | BodyFault:
        """What the encoders report of the last command, once the base can be read again."""
        fault = self._find_fault("base")
        if self._done is None:
            raise ValueError("expected a command before a claim of what was done of it, got none")
        return replace(self._done, sim_time_s=self._body.truth.time_s) if fault is None else self._answer(fault)

    def take_contact(self) -> Contact | None:
        """What the bumper felt, as soon as the base can be read."""
        return self._body.take_contact() if self._find_fault("base") is None else None

    def ranges(self) -> Ranges | None:
        """As the body does; none while the base cannot be read."""
        return self._body.ranges() if self._find_fault("base") is None else None

    def look(self, purpose: str) -> CameraPicture | BodyFault:
        """A picture; with a fault of the camera none is taken."""
        fault = self._find_fault("camera")
        return self._body.look(purpose) if fault is None else self._answer(fault)

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        """As the body does: pressing the button needs no device of the robot."""
        return self._body.ride(ride)

    def wait(self, duration_s: float) -> float:
        """Let simulated time pass."""
        return self._body.wait(duration_s)

    def stop(self) -> None:
        """Nothing to do: the simulated robot stands whenever nothing is commanded."""

    def _find_fault(self, part: str) -> DeviceFault | None:
        return next((fault for fault in self._body.device_faults.values() if fault.part == part), None)

    def _answer(self, fault: DeviceFault, done: MotionReport | None = None) -> BodyFault:
        """What is answered while a device fails, with what the encoders reported, if they can be read."""
        turn, move = (None, None) if done is None else (done.turn_rad, done.move_m)
        return BodyFault(fault.part, fault.what, fault.detail, "", self._body.truth.time_s, turn, move)
