"""A motion that goes on: how fast it is, what is steered, how it errs, and what the encoders counted of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sim.body.actuator import Slip, Wheels, arc_displacement
from world_models.frames import Pose2


@dataclass(frozen=True, slots=True)
class Roll:
    """The state of a motion that is steered while it goes on. The one that stands is made without arguments.

    Attributes:
        speed_m_per_s: now, by the wheels; wanted_m_per_s: what it changes to.
        curvature_per_m: what is steered.
        slip: how it errs at present; None before its first step.
        way_m: by the wheels, since it began to err so.
        turned_rad, gone_m: by the wheels, since it began; told_rad, told_m: of these, what was claimed already.
    """

    speed_m_per_s: float = 0.0
    wanted_m_per_s: float = 0.0
    curvature_per_m: float = 0.0
    slip: Slip | None = None
    way_m: float = 0.0
    turned_rad: float = 0.0
    gone_m: float = 0.0
    told_rad: float = 0.0
    told_m: float = 0.0

    def steered(self, speed_m_per_s: float, curvature_per_m: float) -> Roll:
        """With another speed and another arc wanted."""
        return replace(self, wanted_m_per_s=speed_m_per_s, curvature_per_m=curvature_per_m)

    def errs_anew(self, increment_m: float) -> bool:
        """Whether it is to err otherwise from here (§3.2: an arc describes forward motions of under five feet)."""
        return self.slip is None or self.way_m >= increment_m

    def with_slip(self, slip: Slip) -> Roll:
        return replace(self, slip=slip, way_m=0.0)

    def step(self, duration_s: float) -> Pose2:
        """Where it is after a while at this speed, or before it where negative, in the robot's frame."""
        slip = self.slip or Slip(1.0, 1.0, 0.0)
        curvature = slip.curvature_per_m + self.curvature_per_m * slip.turn_factor
        return arc_displacement(self.speed_m_per_s * duration_s * slip.length_factor, curvature)

    def after(self, duration_s: float, acceleration_m_per_s2: float) -> tuple[Pose2, Roll]:
        """What a short while does, as a displacement in the robot's frame, and the state after it."""
        change = acceleration_m_per_s2 * duration_s
        speed = min(self.speed_m_per_s + change, max(self.speed_m_per_s - change, self.wanted_m_per_s))
        mean = replace(self, speed_m_per_s=0.5 * (self.speed_m_per_s + speed))
        way = mean.speed_m_per_s * duration_s
        return mean.step(duration_s), replace(
            self, speed_m_per_s=speed, way_m=self.way_m + way, gone_m=self.gone_m + way,
            turned_rad=self.turned_rad + way * self.curvature_per_m,
        )

    def claimed(self, wheels: Wheels) -> tuple[float, float]:
        """What the encoders counted since the last claim: (turn [rad], move [m])."""
        turned, gone = wheels.claimed(self.turned_rad, self.gone_m)
        return turned - self.told_rad, gone - self.told_m

    def told(self, turn_rad: float, move_m: float) -> Roll:
        """After that much was claimed."""
        return replace(self, told_rad=self.told_rad + turn_rad, told_m=self.told_m + move_m)
