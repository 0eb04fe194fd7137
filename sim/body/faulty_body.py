"""A body of which something is not well: the line to the base, the base itself, or the camera.

It stands between the agent and the simulated robot, as cables and drivers do, and tells what is wrong with it in the
words of the real drivers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from sim.body.simulated_body import WATCHDOG_S, SimulatedBody
from world_models.entries.body import BodyFault, Course, Frame, MotionReport, MotorCommand, Ride, RideReport

AILMENTS: Mapping[str, tuple[str, str, str]] = {
    "link_lost": ("base", "link lost", "no answer on the line"),
    "nonsense": ("base", "base answers nonsense", "what arrives is not the protocol"),
    "stall": ("base", "stalled", "the wheels do not turn as they were told to"),
    "camera_unplugged": ("camera", "camera unplugged", "no such device"),
    "late_frames": ("camera", "frame late", "the newest picture was taken before the robot stood"),
    "dropped_frames": ("camera", "frame dropped", "no whole picture arrived"),
}
"""Kinds of ailment: which part has it, what it is called, and in words."""


class FaultyBody:
    """A simulated robot as far as its line and its camera let it be reached."""

    def __init__(self, body: SimulatedBody) -> None:
        self._body = body
        self._done: MotionReport | None = None

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        """As the body does; where the line fails on the way its watchdog stops the base, and nobody hears how far."""
        fault = self._fault_of("base")
        if fault is not None:
            self._done = MotionReport(0.0, 0.0, 0.0, fault.when_s)
            return replace(fault, turn_rad=0.0, move_m=0.0)
        self._done = self._body.execute(command)
        found = self.claim()
        if isinstance(found, BodyFault) and found.what == "stalled":  # the line is there, so it is heard how far
            return replace(found, turn_rad=self._done.turn_rad, move_m=self._done.move_m)
        return found

    def steer(self, course: Course) -> tuple[MotionReport, Frame] | BodyFault:
        """As the body does; where the line or the camera fails on the way, it comes to a stand."""
        fault = self._fault_of("base") or self._fault_of("camera")
        if fault is None:
            found = self._body.steer(course)
            if isinstance(found, BodyFault):
                self._done = MotionReport(found.turn_rad or 0.0, found.move_m or 0.0, 0.0, found.when_s)
            return found
        self._done = self._body.halt(WATCHDOG_S if fault.part == "base" and fault.what != "stalled" else 0.0)
        heard = fault.part == "camera" or fault.what == "stalled"
        return replace(fault, turn_rad=self._done.turn_rad, move_m=self._done.move_m) if heard else fault

    def claim(self) -> MotionReport | BodyFault:
        """What the wheels claim of the last command, once the line is there again."""
        fault = self._fault_of("base")
        if self._done is None:
            raise ValueError("expected a command before a claim of what was done of it, got none")
        return replace(self._done, sim_time_s=self._body.truth.time_s) if fault is None else fault

    def look(self, purpose: str) -> Frame | BodyFault:
        """A picture; where the camera fails, none is taken."""
        return self._fault_of("camera") or self._body.look(purpose)

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        """Whoever presses the button needs no line."""
        return self._body.ride(ride)

    def wait(self, duration_s: float) -> float:
        """Simulated time passes."""
        return self._body.wait(duration_s)

    def stop(self) -> None:
        """The simulated robot stands whenever nobody commands it."""

    def _fault_of(self, part: str) -> BodyFault | None:
        for kind in self._body.ailing:
            of, what, detail = AILMENTS[kind]
            if of == part:
                return BodyFault(part, what, detail, "", self._body.truth.time_s)
        return None
