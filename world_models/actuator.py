"""The actuator model (§3.2): motion model of the primitives TURN and MOVE, with covariances.

A MOVE drifts along a circular arc, tangent to the intended line at its start, and falls short by a constant factor:
228.3 in of 240 in (Table 1, constant "to 3 decimal places").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world_models.frames import Pose2
from world_models.units import Bounded, bounded

MAX_INNOVATION_SIGMAS = 4.0
"""Gate of the drift filter: a curvature further off than this is a push or a slip and is ignored."""


@dataclass(frozen=True, slots=True)
class ActuatorModel(Bounded):
    """Motion model of one kind of wheels; all sigmas are standard deviations.

    Attributes:
        reach: metres driven per metre commanded (Table 1: 228.3 / 240).
        reach_sigma: of that factor, between robots and moves.
        curvature_sigma_per_m: of the arc of a MOVE; a foot of drift in 20 ft (§5) is 0.016 per metre.
        bend_sigma_per_m: of one move's curvature round the mean curvature of the same wheels.
        turn_sigma: of a turn's error, as a fraction of the turn; turn_sigma_rad: constant part of that error.
        skitter_m: sideways slip of the tyres in a turn, along each axis.
        increment_m: distance between corrections; two feet (§5).
        turn_increment_rad: largest turn between corrections.
        speed_m_per_s: of a motion corrected on the move; brake_m_per_s2: smallest deceleration when stopping.

    Raises:
        OutOfBoundsError: a value outside its bounds.
    """

    reach: float = bounded(228.3 / 240.0, 0.1, 2.0)
    reach_sigma: float = bounded(0.012, 1e-6, 1.0)
    curvature_sigma_per_m: float = bounded(0.011, 1e-6, 10.0)
    bend_sigma_per_m: float = bounded(0.002, 1e-6, 10.0)
    turn_sigma: float = bounded(0.025, 1e-6, 1.0)
    turn_sigma_rad: float = bounded(math.radians(0.2), 1e-6, math.pi / 2.0)
    skitter_m: float = bounded(0.004, 1e-6, 1.0)
    increment_m: float = bounded(0.6096, 0.01, 10.0)
    turn_increment_rad: float = bounded(math.radians(30.0), 0.01, math.pi)
    speed_m_per_s: float = bounded(0.6, 0.001, 10.0)
    brake_m_per_s2: float = bounded(0.5, 0.001, 100.0)

    def compute_command_m(self, distance_m: float) -> float:
        """The MOVE to command [m] so that about ``distance_m`` is driven."""
        return distance_m / self.reach

    def predict_motion(self, turn_rad: float, move_m: float, curvature_per_m: float = 0.0) -> Pose2:
        """Expected pose after a TURN and a MOVE, in the robot's frame before them.

        Positive curvature bends to the left.
        """
        return Pose2(0.0, 0.0, turn_rad) @ arc(self.reach * move_m, curvature_per_m)

    def turn_variance(self, turn_rad: float) -> float:
        """Variance of a TURN's error [rad^2]."""
        return (self.turn_sigma * turn_rad) ** 2 + (self.turn_sigma_rad**2 if turn_rad else 0.0)

    def motion_covariance(self, turn_rad: float, move_m: float) -> NDArray[np.float64]:
        """(3, 3) covariance of (x, y, heading) after a TURN and a MOVE, in the robot's frame before them.

        An arc of length d and curvature c ends c d^2 / 2 off the line, with heading error c d: the two errors
        are correlated.
        """
        gone = self.reach * move_m
        turn_var = self.turn_variance(turn_rad)
        skitter = self.skitter_m * min(1.0, abs(turn_rad) / (math.pi / 2)) + 0.0005
        bent = np.array([0.0, 0.5 * gone * gone, gone]) * self.curvature_sigma_per_m
        turned = np.array([0.0, gone, 1.0]) * math.sqrt(turn_var)
        along = np.array([self.reach_sigma * abs(move_m) + 0.0005, 0.0, 0.0])
        local = np.outer(bent, bent) + np.outer(turned, turned) + np.outer(along, along)
        c, s = math.cos(turn_rad), math.sin(turn_rad)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(rotation @ local @ rotation.T + np.diag([skitter**2, skitter**2, 1e-8]))

    def stopping_distance_m(self) -> float:
        """Distance from full speed to standstill [m]."""
        return self.speed_m_per_s**2 / (2.0 * self.brake_m_per_s2)

    def propagate_course(
        self, pose: Pose2, covariance: NDArray[np.float64], turn_rad: float, move_m: float, curvature_per_m: float
    ) -> tuple[Pose2, NDArray[np.float64]]:
        """Pose and covariance (3, 3) after one reported part of a continuous motion, in the frame they are given in.

        The errors of the parts of one increment are fully correlated and add up to :meth:`motion_covariance` of the
        whole: the variance of each part is the increment's, times its share of the distance, forwards or backwards.
        A part without distance is a turn on the spot.
        """
        gone = self.reach * move_m
        on_the_spot = abs(gone) < 1e-9
        after = pose @ (Pose2(gone, 0.0, turn_rad) if on_the_spot else arc(gone, curvature_per_m + turn_rad / gone))
        share = self.increment_m * abs(gone)
        along, turned = self.reach_sigma**2 * share, self.curvature_sigma_per_m**2 * share
        turned += (self.turn_sigma * turn_rad) ** 2
        own = np.diag([along, turned * gone**2 / 4.0, turned]) + np.diag([1e-9, 1e-9, 1e-9])
        return after, _propagate_covariance(pose, after, covariance, own)

    def propagate_move(
        self, pose: Pose2, covariance: NDArray[np.float64], turn_rad: float, move_m: float,
        curvature_per_m: float = 0.0,
    ) -> tuple[Pose2, NDArray[np.float64]]:
        """Pose and covariance (3, 3) after a reported TURN and MOVE, in the frame they are given in.

        ``curvature_per_m`` is the known drift.
        """
        after = pose @ self.predict_motion(turn_rad, move_m, curvature_per_m)
        return after, _propagate_covariance(pose, after, covariance, self.motion_covariance(turn_rad, move_m))


def _propagate_covariance(
    before: Pose2, after: Pose2, covariance: NDArray[np.float64], motion_covariance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """First-order propagation J P J^T + R Q R^T; Q (3, 3) is in the robot's frame before the motion."""
    jacobian = np.eye(3)
    jacobian[0, 2], jacobian[1, 2] = -(after.y_m - before.y_m), after.x_m - before.x_m
    c, s = math.cos(before.heading_rad), math.sin(before.heading_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(jacobian @ covariance @ jacobian.T + turn @ motion_covariance @ turn.T)


def arc(length_m: float, curvature_per_m: float) -> Pose2:
    """The pose at the end of a circular arc that starts along x; positive curvature bends to the left (§3.2)."""
    turn = length_m * curvature_per_m
    if abs(turn) < 1e-9:
        return Pose2(length_m, 0.5 * length_m * turn, turn)
    return Pose2(math.sin(turn) / curvature_per_m, (1.0 - math.cos(turn)) / curvature_per_m, turn)
