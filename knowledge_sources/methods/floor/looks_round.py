"""Looks round: from where the camera sees a piece of floor, by the model; and which look is worth its time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.floor.floor_map import CELL_M, Sweep, measure_blind_m
from world_models.building.building import Building
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

MAX_HIDDEN_M = 0.2  # floor counts as seen where nothing higher than this can hide below the picture's lower border

MAX_FLOORS = 64
JOINT_M = 0.005
"""Rooms and the doorway between them overlap by this, so that no gap is left by rounding."""
BORDER_PX = 8.0
"""What is nearer to the border of the picture does not count as seen."""
MIN_DEPTH_M = 0.1
MAX_FIRST_SEEN_M = 4.5
"""A camera that sees no floor nearer than this sees none that matters."""
HEADINGS = 24
"""Directions, round the robot, that are tried for a look."""
LOOK_TURN_RAD_PER_S = math.radians(45.0)
"""How fast the robot turns, as far as the time that a look takes is weighed."""
LOOK_PICTURE_S = 0.2
"""Time that a picture with its command takes, weighed likewise."""


def find_floor(building: Building, locales: Iterable[str]) -> shapely.Geometry:
    """The floor of some locales and of the doorways between them, less what stands on it; cached [m, world]."""
    names = tuple(sorted(set(locales)))
    return building.cached("open floors", MAX_FLOORS, names, lambda: _compute_floor(building, names))


def _compute_floor(building: Building, names: Sequence[str]) -> shapely.Geometry:
    doorways = {d.name: d for name in names for d in building.doorways_of(name) if set(d.between) <= set(names)}
    parts = [shapely.Polygon(building.outline(name)) for name in names]
    parts += [shapely.convex_hull(shapely.MultiPoint(d.thresholds_world.reshape(-1, 2))) for d in doorways.values()]
    things = [shapely.Polygon(corners) for name in names for corners in building.obstacles(name)]
    floor = shapely.union_all([shapely.buffer(part, JOINT_M, join_style="mitre") for part in parts])
    return shapely.difference(floor, shapely.union_all(things)) if things else floor


def sees(robot: RobotModel, floor: shapely.Geometry, pose: Pose2, points: Floats) -> Mask:
    """Which points (n, 2) of the floor the camera sees from a pose, with what may stand there, by the model: those in
    its picture to which a straight line leads over the open floor.
    """
    seen = _is_in_picture(robot, pose, points)
    if seen.any():
        eye = (pose @ Pose2(robot.mount.forward_m, 0.0, 0.0)).position
        ends = np.stack([np.broadcast_to(eye, points[seen].shape), points[seen]], axis=1)
        shapely.prepare(floor)
        seen[seen] = shapely.covers(floor, shapely.linestrings(ends))
    return seen


def _is_in_picture(robot: RobotModel, pose: Pose2, points: Floats) -> Mask:
    """Which points are before the camera; the robot stands on the floor that they are on."""
    lifted = np.column_stack([pose.inverse().apply(points), np.full(len(points), MAX_HIDDEN_M)])
    there = robot.mount.camera_from_robot.apply(lifted)
    inside = there[:, 2] > MIN_DEPTH_M
    inside[inside] = robot.camera.inside(robot.camera.project(there[inside]), BORDER_PX)
    return np.asarray(inside)


def measure_first_seen_m(robot: RobotModel) -> float:
    """How far before its axis the robot first sees the floor straight ahead; 0 where it sees none that matters."""
    ahead_m = np.arange(0.0, MAX_FIRST_SEEN_M, CELL_M)
    seen = _is_in_picture(robot, Pose2(0.0, 0.0, 0.0), np.column_stack([ahead_m, np.zeros_like(ahead_m)]))
    return float(ahead_m[seen.argmax()])


class Lookout(NamedTuple):
    """A look round from where the robot stands.

    Attributes:
        heading_rad: to turn to [world].
        gain_s: time that it saves, less what it takes.
    """

    heading_rad: float
    gain_s: float


def choose_look(
    robot: RobotModel, floor: shapely.Geometry, here: Pose2, ahead: Sequence[Pose2], unseen: Sweep,
    slower_s_per_m: float,
) -> Lookout | None:
    """The look from here that is worth its time; None where there is none, or a better one from a place ahead.

    Args:
        ahead: poses on the way at which pictures will be taken anyway.
        unseen: what the robot is going to sweep and was not seen yet.
        slower_s_per_m: time that a metre of creeping takes beyond one of driving.
    """
    rest = unseen
    for pose in (here, *ahead):  # these pictures cost nothing
        if len(rest.points):
            rest = rest.only(~sees(robot, floor, pose, rest.points))
    blind_s = measure_blind_m(rest) * slower_s_per_m
    best = _find_best(robot, floor, here, rest, blind_s, slower_s_per_m) if blind_s > 0.0 else None
    if best is None:
        return None
    better = (_find_best(robot, floor, pose, rest, blind_s, slower_s_per_m) for pose in ahead)
    return None if any(look is not None and look.gain_s > best.gain_s for look in better) else best


def _find_best(
    robot: RobotModel, floor: shapely.Geometry, pose: Pose2, unseen: Sweep, blind_s: float, slower_s_per_m: float
) -> Lookout | None:
    """The look from a pose that saves the most time."""
    best: Lookout | None = None
    for k in range(HEADINGS):
        heading = wrap_angle(pose.heading_rad + math.tau * k / HEADINGS)
        turn_rad, worth_s = abs(wrap_angle(heading - pose.heading_rad)), 0.0 if best is None else best.gain_s
        pictures = 2 * math.ceil(turn_rad / robot.actuator.turn_increment_rad)
        cost_s = 2.0 * turn_rad / LOOK_TURN_RAD_PER_S + pictures * LOOK_PICTURE_S  # there, and back
        if blind_s > cost_s + worth_s:
            seen = sees(robot, floor, Pose2(pose.x_m, pose.y_m, heading), unseen.points)
            gain_s = blind_s - measure_blind_m(unseen.only(~seen)) * slower_s_per_m - cost_s
            best = Lookout(heading, gain_s) if gain_s > worth_s else best
    return best
