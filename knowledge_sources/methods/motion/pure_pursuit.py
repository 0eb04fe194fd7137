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
from world_models.entries import Leg, MotorCommand, PlanSketch
from world_models.frames import Pose2, wrap_angle

MAX_HEADING_ERROR_RAD = math.radians(3.0)  # the motor moves when it faces its aim to within this; else it turns
MAX_ARRIVAL_HEADING_ERROR_RAD = math.radians(0.5)  # largest error of a heading that the goal states
AIM_AT_END_M = 0.25  # with less than this to go, the motor steers at the end of the leg itself
ARRIVAL_PART = 0.8  # part of a leg's tolerance within which it has arrived
MAX_LOOK_ERROR_RAD = math.radians(6.0)
"""The robot looks where the floor is to be seen when it faces there to within this."""

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


def plan_increment(
    actuator: ActuatorModel, leg: Leg, here: Pose2, sigma_m: float, curvature_per_m: float, lookahead_m: float
) -> MotorCommand | None:
    """The next increment from a pose (world), known to ``sigma_m``; None on arrival. A move is an arc whose chord
    points at the aim.

    It turns and looks before it moves, but not for less than what the direction of its aim is unknown by: what it
    follows shifts its belief in turning, and so near its end it would turn for nothing. After a full turn without a
    move it has arrived: the look at the milestone tells by how far it missed.
    """
    if leg.turned_rad > math.tau:
        return None
    along, left = measure_progress(leg, here)
    within_m = leg.tolerance_m * ARRIVAL_PART
    away = math.hypot(leg.x1_m - here.x_m, leg.y1_m - here.y_m)
    if away <= within_m or (along <= 0.0 and abs(left) <= within_m):
        return plan_turn(leg.heading_rad, here, actuator, MAX_ARRIVAL_HEADING_ERROR_RAD)
    aim = find_aim(leg, here, lookahead_m)
    turn = compute_bearing(aim, here)
    unknown_rad = math.atan2(sigma_m, math.hypot(aim[0] - here.x_m, aim[1] - here.y_m))
    if abs(turn) > max(MAX_HEADING_ERROR_RAD, min(unknown_rad, actuator.turn_increment_rad)):
        return MotorCommand(limit_turn(turn, actuator), 0.0)
    distance = min(actuator.increment_m, actuator.compute_command_m(away))
    turn = compute_chord_turn(turn, curvature_per_m, actuator.reach * distance)
    return MotorCommand(turn if abs(turn) > MAX_ARRIVAL_HEADING_ERROR_RAD / 10 else 0.0, distance)


def count_increment(leg: Leg, command: MotorCommand) -> Leg:
    """The leg with one more increment; a turn to look at the floor is none towards its aim."""
    turned = 0.0 if leg.looking_rad is not None else leg.turned_rad + abs(command.turn_rad)
    return replace(leg, increments=leg.increments + 1, turned_rad=0.0 if command.move_m > 0.0 else turned)


def plan_turn(heading_rad: float | None, here: Pose2, actuator: ActuatorModel, most_rad: float) -> MotorCommand | None:
    """The turn to a heading; None where the robot faces there to within ``most_rad``, or no heading is wanted."""
    if heading_rad is None:
        return None
    turn = wrap_angle(heading_rad - here.heading_rad)
    return MotorCommand(limit_turn(turn, actuator), 0.0) if abs(turn) > most_rad else None


def find_aim(leg: Leg, here: Pose2, lookahead_m: float) -> tuple[float, float]:
    """The point of the line to steer at [m, world]: ahead by ``lookahead_m``, near the end the end itself."""
    along, _ = measure_progress(leg, here)
    if along < AIM_AT_END_M:
        return leg.x1_m, leg.y1_m
    return find_aim_point(leg, along, lookahead_m)


def limit_turn(turn_rad: float, actuator: ActuatorModel) -> float:
    """One increment of a turn; a long turn is divided equally, so that landmarks stay in view."""
    return turn_rad / max(1, math.ceil(abs(turn_rad) / actuator.turn_increment_rad))
