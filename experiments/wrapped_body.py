"""A body around another one: experiments override what they observe."""

from __future__ import annotations

from harvey.runner.ports import Body
from world_models.entries.body import BodyFault, Course, Frame, MotionReport, MotorCommand, Ride, RideReport


class WrappedBody:
    """Passes every request on to another body."""

    def __init__(self, body: Body) -> None:
        self._body = body

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        return self._body.execute(command)

    def steer(self, course: Course) -> tuple[MotionReport, Frame] | BodyFault:
        return self._body.steer(course)

    def claim(self) -> MotionReport | BodyFault:
        return self._body.claim()

    def look(self, purpose: str) -> Frame | BodyFault:
        return self._body.look(purpose)

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        return self._body.ride(ride)

    def wait(self, duration_s: float) -> float:
        return self._body.wait(duration_s)

    def stop(self) -> None:
        self._body.stop()
