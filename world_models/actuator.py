"""The actuator model (§3.2): what Harvey knows of how TURN and MOVE deviate from what is intended.

A MOVE drifts along a circular arc, tangent to the intended line at the start, and falls short by a factor that Table 1
gives as constant "to 3 decimal places": 228.3 in of 240 in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world_models.frames import Pose2


@dataclass(frozen=True, slots=True)
class ActuatorModel:
    """Standard deviations of one motion.

    Attributes:
        reach: metres gone per metre commanded (Table 1: 228.3 / 240).
        reach_sigma: of that factor, between robots and moves.
        curvature_sigma_per_m: of the arc; a foot of drift in 20 ft (§5) is 0.016 per metre.
        turn_sigma: of a turn's error as a part of the turn; turn_sigma_rad: of the rest.
        skitter_m: sideways motion of the tyres in a turn, along each axis.
        increment_m: two feet, the increment between corrections (§5).
        turn_increment_rad: the largest turn between corrections.
    """

    reach: float = 228.3 / 240.0
    reach_sigma: float = 0.012
    curvature_sigma_per_m: float = 0.011
    turn_sigma: float = 0.025
    turn_sigma_rad: float = math.radians(0.2)
    skitter_m: float = 0.004
    increment_m: float = 0.6096
    turn_increment_rad: float = math.radians(20.0)

    def commanded_m(self, distance_m: float) -> float:
        """What to command so that about this distance is gone."""
        return distance_m / self.reach

    def expected(self, turn_rad: float, move_m: float) -> Pose2:
        """Where a TURN and a MOVE are expected to lead, in the robot's frame before them."""
        return Pose2(0.0, 0.0, turn_rad) @ Pose2(self.reach * move_m, 0.0, 0.0)

    def spread(self, turn_rad: float, move_m: float) -> NDArray[np.float64]:
        """(3, 3) covariance of (x, y, heading) after a TURN and a MOVE, in the robot's frame before them.

        An arc of curvature c ends c d^2 / 2 beside the line with its heading off by c d: the two errors go together.
        """
        gone = self.reach * move_m
        turn_var = (self.turn_sigma * turn_rad) ** 2 + (self.turn_sigma_rad**2 if turn_rad else 0.0)
        skitter = self.skitter_m * min(1.0, abs(turn_rad) / (math.pi / 2)) + 0.0005
        arc = np.array([0.0, 0.5 * gone * gone, gone]) * self.curvature_sigma_per_m
        turned = np.array([0.0, gone, 1.0]) * math.sqrt(turn_var)
        along = np.array([self.reach_sigma * move_m + 0.0005, 0.0, 0.0])
        local = np.outer(arc, arc) + np.outer(turned, turned) + np.outer(along, along)
        c, s = math.cos(turn_rad), math.sin(turn_rad)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(rotation @ local @ rotation.T + np.diag([skitter**2, skitter**2, 1e-8]))

    def moved(
        self, pose: Pose2, covariance: NDArray[np.float64], turn_rad: float, move_m: float
    ) -> tuple[Pose2, NDArray[np.float64]]:
        """Pose and covariance (3, 3), both in one fixed frame, after a claimed TURN and MOVE."""
        after = pose @ self.expected(turn_rad, move_m)
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = -(after.y_m - pose.y_m), after.x_m - pose.x_m
        c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return after, np.asarray(lever @ covariance @ lever.T + turn @ self.spread(turn_rad, move_m) @ turn.T)
