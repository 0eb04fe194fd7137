"""Error model of the wheels (§3.2, Table 1): a TURN skitters; a MOVE drifts along an arc and falls short.

Sizes: Table 1's unservoed run ends 2.1 in off a 20 ft line and "other runs resulted in as much as a foot", so a run's
curvature c, with c (5.8 m)^2 / 2 between 2 and 12 in, is 0.003 to 0.018 per metre. It falls short by a constant factor,
228.3 / 240 = 0.951.

A motion that is steered while it goes on keeps its speed, its arc, its errors, and what the encoders counted of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from world_models.actuator import arc
from world_models.frames import Pose2
from world_models.units import Bounded, bounded

STEP_M = 0.02
"""Largest step of the integration of a motion [m]."""


@dataclass(frozen=True, slots=True)
class ActuatorParameters(Bounded):
    """Errors, speeds and encoders of the wheels.

    Attributes:
        turn_scale_sigma: standard deviation of a turn's error, relative to the turn.
        turn_sigma_rad: standard deviation of a turn's error that does not depend on its size.
        skitter_sigma_m: standard deviation, along x and y, of the sideways motion of a turn of 90 degrees or more.
        curvature_low_per_m, curvature_high_per_m: bounds of a run's curvature, drawn uniformly; its sign is random.
        curvature_sigma_per_m: standard deviation of one move's curvature about the run's.
        shortfall_low, shortfall_high: bounds of the part by which a run's moves fall short, drawn uniformly.
        distance_sigma: standard deviation of one move's length, as a part of it.
        encoder_step_m, encoder_step_rad: resolution of the wheel encoders.
        speed_m_per_s, turn_speed_rad_per_s: of every motion.
        acceleration_m_per_s2: of a motion that is steered on the move.
        increment_m: path on the move after which new errors are drawn.
        command_s: time that every command takes in addition.
    """

    turn_scale_sigma: float = bounded(0.02, 0.0, 1.0)
    turn_sigma_rad: float = bounded(math.radians(0.1), 0.0, math.pi / 2.0)
    skitter_sigma_m: float = bounded(0.003, 0.0, 1.0)
    curvature_low_per_m: float = bounded(0.0045, 0.0, 10.0)
    curvature_high_per_m: float = bounded(0.0145, 0.0, 10.0)
    curvature_sigma_per_m: float = bounded(0.0015, 0.0, 10.0)
    shortfall_low: float = bounded(0.04, 0.0, 0.99)
    shortfall_high: float = bounded(0.06, 0.0, 0.99)
    distance_sigma: float = bounded(0.003, 0.0, 1.0)
    encoder_step_m: float = bounded(0.001, 0.0, 1.0)
    encoder_step_rad: float = bounded(math.radians(0.05), 0.0, math.pi)
    speed_m_per_s: float = bounded(0.6, 0.001, 10.0)
    turn_speed_rad_per_s: float = bounded(math.radians(45.0), 0.001, 100.0)
    acceleration_m_per_s2: float = bounded(0.8, 0.001, 100.0)
    increment_m: float = bounded(0.6096, 0.001, 100.0)
    command_s: float = bounded(0.1, 0.0, 3600.0)

    def __post_init__(self) -> None:
        Bounded.__post_init__(self)
        ordered = self.curvature_low_per_m <= self.curvature_high_per_m and self.shortfall_low <= self.shortfall_high
        if not ordered:
            raise ValueError("expected low <= high bounds of curvature and shortfall, got "
                             f"{self.curvature_low_per_m}..{self.curvature_high_per_m} and "
                             f"{self.shortfall_low}..{self.shortfall_high}")


@dataclass(frozen=True, slots=True)
class SimulatedWheels:
    """The wheels of one run: the parameters, and the errors that are constant over the run.

    Attributes:
        length_factor: true length over commanded length.
        curvature_per_m: of the arc that a straight MOVE becomes; positive drifts to the left.
    """

    parameters: ActuatorParameters
    length_factor: float
    curvature_per_m: float

    @staticmethod
    def draw(parameters: ActuatorParameters, rng: np.random.Generator) -> SimulatedWheels:
        """The wheels of one run. Always takes three numbers from ``rng``."""
        shortfall = rng.uniform(parameters.shortfall_low, parameters.shortfall_high)
        curvature = rng.uniform(parameters.curvature_low_per_m, parameters.curvature_high_per_m)
        side = 1.0 if rng.random() < 0.5 else -1.0
        return SimulatedWheels(parameters, 1.0 - float(shortfall), float(curvature) * side)

    def sample_turn(self, turn_rad: float, rng: np.random.Generator) -> Pose2:
        """What a TURN does, as a displacement in the robot's frame; a turn of 0 does nothing. Four random numbers."""
        scale, offset, x, y = rng.standard_normal(4)
        if turn_rad == 0.0:
            return Pose2(0.0, 0.0, 0.0)
        p = self.parameters
        skitter = p.skitter_sigma_m * min(1.0, math.sqrt(abs(turn_rad) / (math.pi / 2.0)))
        error = float(scale) * p.turn_scale_sigma * turn_rad + float(offset) * p.turn_sigma_rad
        return Pose2(skitter * float(x), skitter * float(y), turn_rad + error)

    def sample_arc(self, move_m: float, rng: np.random.Generator) -> tuple[float, float]:
        """What a MOVE does: (signed length [m], curvature [1/m]) of an arc tangent to x. Two random numbers."""
        stretch, bend = rng.standard_normal(2)
        p = self.parameters
        length = move_m * self.length_factor * (1.0 + p.distance_sigma * float(stretch))
        return length, self.curvature_per_m + p.curvature_sigma_per_m * float(bend)

    def sample_slip(self, rng: np.random.Generator) -> Slip:
        """The errors of one motion whose length is not known yet. Always takes three numbers from ``rng``."""
        scale, stretch, bend = rng.standard_normal(3)
        p = self.parameters
        return Slip(
            turn_factor=1.0 + p.turn_scale_sigma * float(scale),
            length_factor=self.length_factor * (1.0 + p.distance_sigma * float(stretch)),
            curvature_per_m=self.curvature_per_m + p.curvature_sigma_per_m * float(bend),
        )

    def sample_skitter(self, turn_rad: float, rng: np.random.Generator) -> tuple[float, float]:
        """Sideways motion (x, y) [m] of a part of a turn; its variance is proportional to the angle."""
        x, y = rng.standard_normal(2)
        size = self.parameters.skitter_sigma_m * math.sqrt(abs(turn_rad) / (math.pi / 2.0))
        return size * float(x), size * float(y)

    def quantize(self, turn_rad: float, move_m: float) -> tuple[float, float]:
        """What the encoders report of a commanded motion: the command, rounded to their resolution."""
        p = self.parameters
        return _round_to(turn_rad, p.encoder_step_rad), _round_to(move_m, p.encoder_step_m)

    def turn_s(self, turn_rad: float) -> float:
        """Duration of a turn [s]."""
        return abs(turn_rad) / self.parameters.turn_speed_rad_per_s

    def move_s(self, move_m: float) -> float:
        """Duration of a move [s]."""
        return abs(move_m) / self.parameters.speed_m_per_s


@dataclass(frozen=True, slots=True)
class Slip:
    """The errors of one motion: what is really done for each part that the wheels roll.

    Attributes:
        turn_factor: radians per radian.
        length_factor: metres per metre.
        curvature_per_m: of the arc that a move is.
    """

    turn_factor: float
    length_factor: float
    curvature_per_m: float


def arc_steps(length_m: float, curvature_per_m: float) -> Iterator[Pose2]:
    """An arc as equal displacements of at most ``STEP_M``, each in the frame at the end of the one before."""
    count = math.ceil(abs(length_m) / STEP_M)
    for _ in range(count):
        yield arc(length_m / count, curvature_per_m)


def _round_to(value: float, step: float) -> float:
    return round(value / step) * step if step > 0 else value


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
        return arc(self.speed_m_per_s * duration_s * slip.length_factor, curvature)

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

    def read_encoders(self, wheels: SimulatedWheels) -> tuple[float, float]:
        """What the encoders counted since the last report: (turn [rad], move [m])."""
        turned, moved = wheels.quantize(self.turned_rad, self.moved_m)
        return turned - self.reported_rad, moved - self.reported_m

    def mark_reported(self, turn_rad: float, move_m: float) -> ContinuousMotion:
        """The motion after so much more was reported."""
        return replace(self, reported_rad=self.reported_rad + turn_rad, reported_m=self.reported_m + move_m)
