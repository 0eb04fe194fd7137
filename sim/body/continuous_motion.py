"""A motion that is steered while it goes on: its speed, its arc, its errors, and what the encoders counted of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sim.body.actuator import Slip, Wheels, arc_displacement
from world_models.frames import Pose2


@dataclass(frozen=True, slots=True)
class ContinuousMotion:
    """The state of a motion that is steered on the move; without arguments, of a robot that stands.

    Attributes:
        speed_m_per_s: of the wheels, now; wanted_m_per_s: the speed that it accelerates to.
        curvature_per_m: of the arc that is steered, positive to the left.
        slip: its present errors; None before its first step.
        slip_way_m: path by the wheels since these errors were drawn.
        turned_rad, moved_m: by the wheels since the motion began.
        reported_rad, reported_m: how much of these the encoders have reported.
    """

    speed_m_per_s: float = 0.0
    wanted_m_per_s: float = 0.0
    curvature_per_m: float = 0.0
    slip: Slip | None = None
    slip_way_m: float = 0.0
    turned_rad: float = 0.0
    moved_m: float = 0.0
    reported_rad: float = 0.0
    reported_m: float = 0.0

    def steer(self, speed_m_per_s: float, curvature_per_m: float) -> ContinuousMotion:
        """The motion with another wanted speed and another arc."""
        return replace(self, wanted_m_per_s=speed_m_per_s, curvature_per_m=curvature_per_m)

    def needs_slip(self, increment_m: float) -> bool:
        """Whether new errors are due (§3.2: one arc describes a forward motion of under five feet)."""
        return self.slip is None or self.slip_way_m >= increment_m

    def with_slip(self, slip: Slip) -> ContinuousMotion:
        """The motion with new errors."""
        return replace(self, slip=slip, slip_way_m=0.0)

    def displacement_after(self, duration_s: float) -> Pose2:
        """The displacement after a while at the present speed (before now, where negative), in the robot's frame."""
        slip = self.slip or Slip(1.0, 1.0, 0.0)
        curvature = slip.curvature_per_m + self.curvature_per_m * slip.turn_factor
        return arc_displacement(self.speed_m_per_s * duration_s * slip.length_factor, curvature)

    def advance(self, duration_s: float, acceleration_m_per_s2: float) -> tuple[Pose2, ContinuousMotion]:
        """One short step: the displacement in the robot's frame, and the motion after it."""
        change = acceleration_m_per_s2 * duration_s
        speed = min(self.speed_m_per_s + change, max(self.speed_m_per_s - change, self.wanted_m_per_s))
        mean = replace(self, speed_m_per_s=0.5 * (self.speed_m_per_s + speed))
        way = mean.speed_m_per_s * duration_s
        return mean.displacement_after(duration_s), replace(
            self, speed_m_per_s=speed, slip_way_m=self.slip_way_m + way, moved_m=self.moved_m + way,
            turned_rad=self.turned_rad + way * self.curvature_per_m,
        )

    def read_encoders(self, wheels: Wheels) -> tuple[float, float]:
        """What the encoders counted since the last report: (turn [rad], move [m])."""
        turned, moved = wheels.quantize(self.turned_rad, self.moved_m)
        return turned - self.reported_rad, moved - self.reported_m

    def mark_reported(self, turn_rad: float, move_m: float) -> ContinuousMotion:
        """The motion after so much more was reported."""
        return replace(self, reported_rad=self.reported_rad + turn_rad, reported_m=self.reported_m + move_m)
