"""Lookout: from where floor that lies ahead can be seen, and whether it is worth to turn there now."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.floor.seen_floor import Sweep, measure_blind_m
from world_models.building.building import Building
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

MAX_HIDDEN_M = 0.2  # floor counts as seen where nothing higher than this can hide below the picture's lower border

MAX_FLOORS = 64
BORDER_PX = 8.0
"""What is nearer to the border of the picture does not count as seen."""
MIN_DEPTH_M = 0.1
HEADINGS = 24
"""Directions, round the robot, that are tried for a look."""


def find_floor(building: Building, locales: Iterable[str]) -> shapely.Geometry:
    """The floor of some locales and of the doorways between them, less what stands on it; cached [m, world]."""
    names = tuple(sorted(set(locales)))
    return building.cached("open floors", MAX_FLOORS, names, lambda: _compute_floor(building, names))


def _compute_floor(building: Building, names: Sequence[str]) -> shapely.Geometry:
    doorways = {d.name: d for name in names for d in building.doorways_of(name) if set(d.between) <= set(names)}
    parts = [shapely.Polygon(building.outline(name)) for name in names]
    parts += [shapely.convex_hull(shapely.MultiPoint(d.thresholds_world.reshape(-1, 2))) for d in doorways.values()]
    things = [shapely.Polygon(corners) for name in names for corners in building.obstacles(name)]
    floor = shapely.union_all([shapely.buffer(part, 0.005, join_style="mitre") for part in parts])
    return shapely.difference(floor, shapely.union_all(things)) if things else floor


def sees(
    robot: RobotModel, floor: shapely.Geometry, pose: Pose2, points: Floats, max_hidden_m: float
) -> Mask:
    """Which points (n, 2) of the floor the camera sees from a pose, as far as the model tells.

    ``max_hidden_m``: height up to which what stands on a point has to be in the picture too.
    """
    seen = _is_in_picture(robot, pose, points, max_hidden_m)
    rest = np.flatnonzero(seen)
    if len(rest):
        seen[rest] = _is_in_sight(robot, floor, pose, points[rest])
    return seen


def _is_in_picture(robot: RobotModel, pose: Pose2, points: Floats, max_hidden_m: float) -> Mask:
    """Which points are before the camera; the robot stands on the floor that they are on."""
    lifted = np.column_stack([pose.inverse().apply(points), np.full(len(points), max_hidden_m)])
    there = robot.mount.camera_from_robot.apply(lifted)
    inside = there[:, 2] > MIN_DEPTH_M
    inside[inside] = robot.camera.inside(robot.camera.project(there[inside]), BORDER_PX)
    return np.asarray(inside)


def _is_in_sight(robot: RobotModel, floor: shapely.Geometry, pose: Pose2, points: Floats) -> Mask:
    """To which points a straight line leads over the open floor."""
    eye = np.array(pose.position) + robot.mount.forward_m * np.array([math.cos(pose.heading_rad),
                                                                      math.sin(pose.heading_rad)])
    lines = shapely.linestrings(np.stack([np.broadcast_to(eye, points.shape), points], axis=1))
    shapely.prepare(floor)
    return np.asarray(shapely.covers(floor, lines))


class Costs(NamedTuple):
    """What looking and creeping take.

    Attributes:
        turn_rad_per_s: how fast the robot turns; picture_s: time that each picture on the way takes with its command.
        turn_increment_rad: largest turn between pictures.
        creep_s_per_m: time that a metre of creeping takes beyond one of driving.
    """

    turn_rad_per_s: float
    picture_s: float
    turn_increment_rad: float
    creep_s_per_m: float

    def look_s(self, turn_rad: float) -> float:
        """Time to turn there, take pictures, and turn back."""
        pictures = 2 * math.ceil(abs(turn_rad) / self.turn_increment_rad)
        return 2.0 * abs(turn_rad) / self.turn_rad_per_s + pictures * self.picture_s


class Look(NamedTuple):
    """A look round from where the robot stands.

    Attributes:
        heading_rad: to turn to [world].
        gain_s: time that it saves, less what it takes.
    """

    heading_rad: float
    gain_s: float


def choose_look(
    robot: RobotModel, floor: shapely.Geometry, here: Pose2, ahead: Sequence[Pose2], unseen: Sweep, costs: Costs,
    max_hidden_m: float,
) -> Look | None:
    """The look from here that is worth its time; None where there is none, or a better one from a place ahead.

    Args:
        ahead: poses on the way at which pictures will be taken anyway.
        unseen: what the robot is going to sweep and was not seen yet.
        max_hidden_m: as of :func:`sees`.
    """
    rest = unseen
    for pose in (here, *ahead):  # these pictures cost nothing
        if len(rest.points):
            rest = rest.only(~sees(robot, floor, pose, rest.points, max_hidden_m))
    blind_m = measure_blind_m(rest)
    if blind_m * costs.creep_s_per_m <= 0.0:
        return None
    best = _find_best(robot, floor, here, rest, blind_m, costs, max_hidden_m)
    if best is None:
        return None
    better = (_find_best(robot, floor, pose, rest, blind_m, costs, max_hidden_m) for pose in ahead)
    return None if any(look is not None and look.gain_s > best.gain_s for look in better) else best


def _find_best(
    robot: RobotModel, floor: shapely.Geometry, pose: Pose2, unseen: Sweep, blind_m: float, costs: Costs,
    max_hidden_m: float,
) -> Look | None:
    """The look from a pose that saves the most time."""
    best: Look | None = None
    for k in range(HEADINGS):
        heading = wrap_angle(pose.heading_rad + 2.0 * math.pi * k / HEADINGS)
        cost_s = costs.look_s(wrap_angle(heading - pose.heading_rad))
        if blind_m * costs.creep_s_per_m <= cost_s + (0.0 if best is None else best.gain_s):
            continue
        seen = sees(robot, floor, Pose2(pose.x_m, pose.y_m, heading), unseen.points, max_hidden_m)
        if not seen.any():
            continue
        gain_s = (blind_m - measure_blind_m(unseen.only(~seen))) * costs.creep_s_per_m - cost_s
        if gain_s > (0.0 if best is None else best.gain_s):
            best = Look(heading, gain_s)
    return best
