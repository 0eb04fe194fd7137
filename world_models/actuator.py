"""The actuator model (§3.2): what Harvey knows of how TURN and MOVE deviate from what is intended.

A MOVE drifts along a circular arc, tangent to the intended line at the start, and falls short by a factor that Table 1
gives as constant "to 3 decimal places": 228.3 in of 240 in.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from world_models.bounds import Bounds, check_bounds
from world_models.frames import Pose2, wrap_angle

BOUNDS: Mapping[str, Bounds] = {
    "reach": Bounds(0.1, 2.0),
    "reach_sigma": Bounds(1e-6, 1.0),
    "curvature_sigma_per_m": Bounds(1e-6, 10.0),
    "bend_sigma_per_m": Bounds(1e-6, 10.0),
    "turn_sigma": Bounds(1e-6, 1.0),
    "turn_sigma_rad": Bounds(1e-6, math.pi / 2.0),
    "skitter_m": Bounds(1e-6, 1.0),
    "increment_m": Bounds(0.01, 10.0),
    "turn_increment_rad": Bounds(0.01, math.pi),
    "speed_m_per_s": Bounds(0.001, 10.0),
    "brake_m_per_s2": Bounds(0.001, 100.0),
}
"""Far beyond any wheels, but such that what is computed with them is finite and a leg comes to its end."""
STRANGE = 4.0


@dataclass(frozen=True, slots=True)
class ActuatorModel:
    """Standard deviations of one motion; OutOfBoundsError for what no wheels do.

    Attributes:
        reach: metres gone per metre commanded (Table 1: 228.3 / 240).
        reach_sigma: of that factor, between robots and moves.
        curvature_sigma_per_m: of the arc; a foot of drift in 20 ft (§5) is 0.016 per metre.
        bend_sigma_per_m: of the arc of one move, round what the same wheels do in others.
        turn_sigma: of a turn's error as a part of the turn; turn_sigma_rad: of the rest.
        skitter_m: sideways motion of the tyres in a turn, along each axis.
        increment_m: two feet, the increment between corrections (§5).
        turn_increment_rad: the largest turn between corrections.
        speed_m_per_s: of a motion that is corrected on the move; brake_m_per_s2: how it comes to a stand at the least.
    """

    reach: float = 228.3 / 240.0
    reach_sigma: float = 0.012
    curvature_sigma_per_m: float = 0.011
    bend_sigma_per_m: float = 0.002
    turn_sigma: float = 0.025
    turn_sigma_rad: float = math.radians(0.2)
    skitter_m: float = 0.004
    increment_m: float = 0.6096
    turn_increment_rad: float = math.radians(20.0)
    speed_m_per_s: float = 0.4
    brake_m_per_s2: float = 0.5

    def __post_init__(self) -> None:
        check_bounds(self, BOUNDS)

    def commanded_m(self, distance_m: float) -> float:
        """What to command so that about this distance is gone."""
        return distance_m / self.reach

    def expected(self, turn_rad: float, move_m: float, curvature_per_m: float = 0.0) -> Pose2:
        """Where a TURN and a MOVE are expected to lead, in the robot's frame before them; positive bends to the left.
        """
        return Pose2(0.0, 0.0, turn_rad) @ arc(self.reach * move_m, curvature_per_m)

    def turn_variance(self, turn_rad: float) -> float:
        """Of a TURN's error [rad^2]."""
        return (self.turn_sigma * turn_rad) ** 2 + (self.turn_sigma_rad**2 if turn_rad else 0.0)

    def spread(self, turn_rad: float, move_m: float) -> NDArray[np.float64]:
        """(3, 3) covariance of (x, y, heading) after a TURN and a MOVE, in the robot's frame before them.

        An arc of curvature c ends c d^2 / 2 beside the line with its heading off by c d: the two errors go together.
        """
        gone = self.reach * move_m
        turn_var = self.turn_variance(turn_rad)
        skitter = self.skitter_m * min(1.0, abs(turn_rad) / (math.pi / 2)) + 0.0005
        bent = np.array([0.0, 0.5 * gone * gone, gone]) * self.curvature_sigma_per_m
        turned = np.array([0.0, gone, 1.0]) * math.sqrt(turn_var)
        along = np.array([self.reach_sigma * move_m + 0.0005, 0.0, 0.0])
        local = np.outer(bent, bent) + np.outer(turned, turned) + np.outer(along, along)
        c, s = math.cos(turn_rad), math.sin(turn_rad)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(rotation @ local @ rotation.T + np.diag([skitter**2, skitter**2, 1e-8]))

    def stopping_m(self) -> float:
        """The way in which it comes to a stand."""
        return self.speed_m_per_s**2 / (2.0 * self.brake_m_per_s2)

    def rolled(
        self, pose: Pose2, covariance: NDArray[np.float64], turn_rad: float, move_m: float, curvature_per_m: float
    ) -> tuple[Pose2, NDArray[np.float64]]:
        """Pose and covariance (3, 3), both in one fixed frame, after a claimed part of a motion that goes on.

        The parts of one increment err alike, so that they add up to what :meth:`spread` says of the whole: the variance
        of each is the increment's, by its share of the way.
        """
        gone = self.reach * move_m
        after = pose @ arc(gone, curvature_per_m + (turn_rad / gone if gone > 0.0 else 0.0))
        share = self.increment_m * gone
        along, turned = self.reach_sigma**2 * share, self.curvature_sigma_per_m**2 * share
        turned += (self.turn_sigma * turn_rad) ** 2
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = -(after.y_m - pose.y_m), after.x_m - pose.x_m
        c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        spread = np.diag([along, turned * gone**2 / 4.0, turned]) + np.diag([1e-9, 1e-9, 1e-9])
        return after, np.asarray(lever @ covariance @ lever.T + turn @ spread @ turn.T)

    def moved(
        self, pose: Pose2, covariance: NDArray[np.float64], turn_rad: float, move_m: float,
        curvature_per_m: float = 0.0,
    ) -> tuple[Pose2, NDArray[np.float64]]:
        """Pose and covariance (3, 3), both in one fixed frame, after a claimed TURN and MOVE of a known drift."""
        after = pose @ self.expected(turn_rad, move_m, curvature_per_m)
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = -(after.y_m - pose.y_m), after.x_m - pose.x_m
        c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return after, np.asarray(lever @ covariance @ lever.T + turn @ self.spread(turn_rad, move_m) @ turn.T)


@dataclass(frozen=True, slots=True)
class Drift:
    """How this run's wheels bend a MOVE, as far as it is known, and the stretch of way from which more is learnt.

    Attributes:
        curvature_per_m: of the arc that a MOVE is; positive drifts to the left.
        sigma_per_m: its standard deviation.
        heading_rad: believed at the beginning of the stretch [world].
        turned_rad, turned_variance: what was commanded since, and how well that is carried out.
        gone_m: metres since.
    """

    curvature_per_m: float
    sigma_per_m: float
    heading_rad: float
    turned_rad: float = 0.0
    turned_variance: float = 0.0
    gone_m: float = 0.0

    @staticmethod
    def unknown(actuator: ActuatorModel, heading_rad: float) -> Drift:
        """Before anything is seen of it."""
        return Drift(0.0, actuator.curvature_sigma_per_m, heading_rad)

    def rolled(self, actuator: ActuatorModel, turn_rad: float, move_m: float, *, on_the_spot: bool = True) -> Drift:
        """After a claimed TURN, on the spot or as a part of an arc that is steered, and MOVE."""
        variance = actuator.turn_variance(turn_rad) if on_the_spot else (actuator.turn_sigma * turn_rad) ** 2
        return replace(
            self, turned_rad=self.turned_rad + turn_rad, gone_m=self.gone_m + actuator.reach * move_m,
            turned_variance=self.turned_variance + variance,
        )

    def begun(self, heading_rad: float) -> Drift:
        """A stretch begins here."""
        return Drift(self.curvature_per_m, self.sigma_per_m, heading_rad)

    def learnt(self, actuator: ActuatorModel, heading_rad: float, sigma_rad: float) -> Drift:
        """At the end of a stretch, whose heading is seen: what it bent by is one more measurement (Kalman).

        What wheels cannot well have done (``STRANGE`` deviations), as when somebody pushed the robot, teaches nothing.

        Args:
            sigma_rad: of the change of heading as it was seen.
        """
        if self.gone_m <= 0.0:
            return self.begun(heading_rad)
        bent = wrap_angle(heading_rad - self.heading_rad - self.turned_rad) / self.gone_m
        noise = (self.turned_variance + sigma_rad**2) / self.gone_m**2 + actuator.bend_sigma_per_m**2
        if (bent - self.curvature_per_m) ** 2 > STRANGE**2 * (self.sigma_per_m**2 + noise):
            return self.begun(heading_rad)
        gain = self.sigma_per_m**2 / (self.sigma_per_m**2 + noise)
        curvature = self.curvature_per_m + gain * (bent - self.curvature_per_m)
        return Drift(curvature, math.sqrt(1.0 - gain) * self.sigma_per_m, heading_rad)


def arc(length_m: float, curvature_per_m: float) -> Pose2:
    """Along a circular arc, tangent to x at its start; positive curvature bends to the left (§3.2)."""
    turn = length_m * curvature_per_m
    if abs(turn) < 1e-9:
        return Pose2(length_m, 0.5 * length_m * turn, turn)
    return Pose2(math.sin(turn) / curvature_per_m, (1.0 - math.cos(turn)) / curvature_per_m, turn)
