"""Pure pursuit along a straight leg (§5), with a bound on the position error.

The law: *correcting the heading alone keeps the position error bounded along a segment.* Let y be the distance from the
line, e the heading against it (both small), and let each increment of length d begin with a TURN towards the point of
the line that lies L ahead, L >= d, and be an arc of the wheels' curvature c (§3.2). Before the increment the believed
pose is wrong by at most b across the line and by at most h in heading; the TURN itself errs by at most t, and the
estimated drift by at most k in curvature. After the turn the robot faces along ``-(y + b') / L + h' + t'``, with
|b'| <= b, |h'| <= h, |t'| <= t, whatever its heading was before; the chord of the estimated arc is subtracted from the
turn, so that the increment ends at::

    y_next = (1 - d / L) y + d (-b' / L + h' + t') + k' d^2 / 2 ,   |k'| <= k

The heading before the increment has dropped out, and y is multiplied by 0 <= 1 - d/L < 1. So from any start

    |y_n| <= (1 - d / L)^n |y_0| + Y,      Y = b + L (h + t) + k d L / 2

since the sum of the geometric series is L/d times what one increment adds. Y does not grow with the length of the
segment; without the turns y grows with its square. Where drift is not estimated, k is the drift itself. Within an
increment the arc strays from its chord by at most c d^2 / 8 more. On the move the same holds with d the way between two
pictures and L the look-ahead then; the curvature steered takes the place of the turn.

Source: R. C. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, 1992.
"""

from __future__ import annotations

import math
from dataclasses import replace

from world_models.actuator import ActuatorModel
from world_models.building.building import Building
from world_models.entries import Leg, PlanSketch
from world_models.frames import Pose2, wrap_angle

MAX_START_OFFSET_M = 0.15
"""From nearer than this the robot returns to the planned line; from further off it draws a new one."""
ROLLING_STOP_MARGIN_M = 0.1  # the robot stops so far before floor that was not seen to be free
MAX_CURVATURE_PER_M = 1.0  # largest curvature that is steered on the move


def lay_leg(id: str, sketch: PlanSketch, here: Pose2, world: Building) -> Leg:
    """The leg of a sketch's current subgoal, from the planned line or from where the robot is [world]."""
    subgoal = sketch.subgoals[sketch.at]
    end, planned = subgoal.destination.in_world(world), subgoal.origin.in_world(world)
    start = planned if planned.distance_to(here) <= MAX_START_OFFSET_M else here
    heading = None if subgoal.destination.heading_rad is None else end.heading_rad
    return Leg(id, sketch.at, start.x_m, start.y_m, end.x_m, end.y_m, subgoal.tolerance_m, heading)


def measure_progress(leg: Leg, here: Pose2) -> tuple[float, float]:
    """Distance left along the leg, and distance of the robot to the left of it [m]."""
    dx, dy = leg.x1_m - leg.x0_m, leg.y1_m - leg.y0_m
    length = math.hypot(dx, dy) or 1.0
    rx, ry = leg.x1_m - here.x_m, leg.y1_m - here.y_m
    return (rx * dx + ry * dy) / length, (rx * dy - ry * dx) / length


def compute_bearing(point: tuple[float, float], here: Pose2) -> float:
    """Direction of a point (x, y), world, against the robot's heading, positive to the left [rad]."""
    return wrap_angle(math.atan2(point[1] - here.y_m, point[0] - here.x_m) - here.heading_rad)


def find_aim_point(leg: Leg, along_m: float, lookahead_m: float) -> tuple[float, float]:
    """The point of the leg to steer at [m, world], ``lookahead_m`` ahead of where ``along_m`` are left of it."""
    length = math.hypot(leg.x1_m - leg.x0_m, leg.y1_m - leg.y0_m)
    part = min(1.0, max(0.0, (length - along_m + lookahead_m) / max(length, 1e-9)))
    return leg.x0_m + part * (leg.x1_m - leg.x0_m), leg.y0_m + part * (leg.y1_m - leg.y0_m)


def update_leg(leg: Leg, here: Pose2, point: tuple[float, float]) -> Leg:
    """The leg with the robot's distances to its end and to its line, and the direction of the point steered at."""
    along, left = measure_progress(leg, here)
    return replace(leg, to_go_m=along, left_m=left, aim_rad=compute_bearing(point, here))


def compute_chord_turn(turn_rad: float, curvature_per_m: float, length_m: float) -> float:
    """Turn that puts the chord of the arc that follows, and not its tangent, in a direction [rad]."""
    return turn_rad - 0.5 * curvature_per_m * length_m


def compute_curvature_to(point: tuple[float, float], here: Pose2) -> float:
    """Curvature of the arc tangent to the robot's heading that passes through a point ahead [1/m]."""
    away = math.hypot(point[0] - here.x_m, point[1] - here.y_m)
    return 2.0 * math.sin(compute_bearing(point, here)) / max(away, 1e-6)


def steer_to(point: tuple[float, float], here: Pose2, drift_per_m: float) -> float:
    """The curvature to steer to reach a point [1/m], where the wheels add theirs."""
    wanted = compute_curvature_to(point, here) - drift_per_m
    return min(max(wanted, -MAX_CURVATURE_PER_M), MAX_CURVATURE_PER_M)


def choose_speed(free_m: float, most_m_per_s: float, actuator: ActuatorModel, creep_speed_m_per_s: float) -> float:
    """The highest speed, or what can be stopped from before the floor ends that is seen to be free [m/s]."""
    room_m = max(0.0, free_m - ROLLING_STOP_MARGIN_M)
    fastest = math.sqrt(2.0 * actuator.brake_m_per_s2 * room_m)
    return min(most_m_per_s, max(fastest, creep_speed_m_per_s))
