"""Increments (§5): how far the robot turns and moves next along a leg."""

from __future__ import annotations

import math
from dataclasses import replace

from knowledge_sources.methods.motion.pure_pursuit import (
    compute_bearing,
    compute_chord_turn,
    find_aim_point,
    measure_progress,
)
from world_models.actuator import ActuatorModel
from world_models.entries import Leg, MotorCommand
from world_models.frames import Pose2, wrap_angle

MAX_HEADING_ERROR_RAD = math.radians(3.0)  # the motor moves when it faces its aim to within this; else it turns
MAX_ARRIVAL_HEADING_ERROR_RAD = math.radians(0.5)  # largest error of a heading that the goal states
AIM_AT_END_M = 0.25  # with less than this to go, the motor steers at the end of the leg itself
ARRIVAL_PART = 0.8  # part of a leg's tolerance within which it has arrived
MAX_LOOK_ERROR_RAD = math.radians(6.0)
"""The robot looks where the floor is to be seen when it faces there to within this."""


def plan_increment(
    actuator: ActuatorModel, leg: Leg, here: Pose2, curvature_per_m: float, lookahead_m: float
) -> MotorCommand | None:
    """The next increment from a pose (world); None on arrival. A move is an arc whose chord points at the aim.

    Near its end it may turn for nothing: what it follows shifts its belief in turning. After a full turn without a move
    it has arrived: the look at the milestone tells by how far it missed.
    """
    if leg.turned_rad > math.tau:
        return None
    along, left = measure_progress(leg, here)
    within_m = leg.tolerance_m * ARRIVAL_PART
    away = math.hypot(leg.x1_m - here.x_m, leg.y1_m - here.y_m)
    if away <= within_m or (along <= 0.0 and abs(left) <= within_m):
        return plan_turn(leg.heading_rad, here, actuator, MAX_ARRIVAL_HEADING_ERROR_RAD)
    turn = compute_bearing(find_aim(leg, here, lookahead_m), here)
    if abs(turn) > MAX_HEADING_ERROR_RAD:
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
