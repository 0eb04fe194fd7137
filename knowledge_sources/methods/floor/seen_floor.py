"""Seen floor: the union of what scans show free, what of a way it does not cover, and from where that is seen.

A scan shows the floor free in each wedge between two neighbouring bearings, from the greater of their near ends to the
lesser of their far ends. Where scans differ, the newest that tells of a point holds: right behind a
thing that ends it, an older one makes nothing free.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats, Mask
from world_models.building.building import Building
from world_models.entries import FreeFloor
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

HIDDEN_M = 0.3
"""So far behind the near side of a thing the floor counts as taken by it."""
SPACING_M = 0.05
"""Of the points that outline a region."""
MIN_POINTS = 3
WINDOW_M = 0.15
"""Fewer unseen points than that within so much of the way hide nothing: 75 square centimetres."""


class _Scan(NamedTuple):
    """A scan as arrays: bearings (n,) rise from the first one, which is ``first_rad``."""

    origin: Floats
    first_rad: float
    bearings_rad: Floats
    near_m: Floats
    far_m: Floats
    confirmed_m: Floats
    is_thing: Mask


@lru_cache(maxsize=256)
def _read_scan(scan: FreeFloor) -> _Scan:
    confirmed_m = scan.confirmed_m or scan.far_m  # what is ranged is no matter of looks
    bearings = np.unwrap(np.asarray(scan.bearings_rad, float)) if scan.bearings_rad else np.zeros(0)
    first = float(bearings[0]) if len(bearings) else 0.0
    return _Scan(np.array([scan.x_m, scan.y_m]), first, bearings - first, np.asarray(scan.near_m, float),
                 np.asarray(scan.far_m, float), np.asarray(confirmed_m, float),
                 np.array([end == "thing" for end in scan.ends], bool))


@dataclass(frozen=True, eq=False)
class SeenFloor:
    """Floor that is known to be free.

    Attributes:
        scans: the oldest first; only those that are young enough.
        discs: (n, 3) x, y, radius of what else is known to be free, where no scan sees a thing [m, world].
        taken: corners (k, 2) of what stands on the floor.
    """

    scans: tuple[FreeFloor, ...]
    discs: Floats
    taken: tuple[Floats, ...] = ()

    def ask(self, points: Floats) -> tuple[Mask, Mask, Mask]:
        """Which points (n, 2) are seen free; the scans, and the discs, that say so of any point, or deny it."""
        free, open_ = np.zeros(len(points), bool), np.ones(len(points), bool)
        scans, discs = np.zeros(len(self.scans), bool), np.zeros(len(self.discs), bool)
        for k in range(len(self.scans) - 1, -1, -1):
            rest = np.flatnonzero(open_)
            if not len(rest):
                break
            is_free, is_taken = _ask_scan(_read_scan(self.scans[k]), points[rest])
            free[rest[is_free]] = True
            open_[rest[is_free | is_taken]] = False
            scans[k] = (is_free | is_taken).any()
        rest = np.flatnonzero(open_)
        if len(rest) and len(self.discs):
            covers = _are_in(points[rest], self.discs)
            free[rest] = covers.any(axis=1)
            discs[covers.argmax(axis=1)[covers.any(axis=1)]] = True
        for corners in self.taken:
            free &= ~shapely.intersects_xy(shapely.Polygon(corners), points[:, 0], points[:, 1])
        return free, scans, discs

    def ask_confirmed(self, points: Floats) -> Mask:
        """Which of the points (n, 2) are seen free by more than looks: an earlier picture would tell what stands there,
        if it has an edge or a pattern; or the robot was there.
        """
        confirmed = np.asarray(_are_in(points, self.discs).any(axis=1))
        for scan in reversed(self.scans):
            rest = np.flatnonzero(~confirmed)
            if not len(rest):
                break
            if scan.confirmed_m or scan.sense != "camera":
                confirmed[rest] = _is_confirmed(_read_scan(scan), points[rest])
        return confirmed


def _are_in(points: Floats, discs: Floats) -> Mask:
    """(n, k) which of the points (n, 2) are in which of the discs (k, 3)."""
    dx, dy = (points[:, None, axis] - discs[:, axis] for axis in (0, 1))
    return np.asarray(np.sqrt(dx * dx + dy * dy) <= discs[:, 2])


def _is_confirmed(scan: _Scan, points: Floats) -> Mask:
    """Which points (n, 2) a scan shows free by an earlier picture too."""
    return _ask_scan(scan._replace(far_m=np.minimum(scan.far_m, scan.confirmed_m)), points)[0]


def _ask_scan(scan: _Scan, points: Floats) -> tuple[Mask, Mask]:
    """Which points (n, 2) a scan shows free, and which it shows taken."""
    out = points - scan.origin
    away = np.linalg.norm(out, axis=1)
    if len(scan.bearings_rad) < 2:
        return np.zeros(len(points), bool), np.zeros(len(points), bool)
    bearings = np.mod(np.arctan2(out[:, 1], out[:, 0]) - scan.first_rad, 2.0 * np.pi)
    right = np.searchsorted(scan.bearings_rad, bearings)
    within = (right > 0) & (right < len(scan.bearings_rad))
    j = np.clip(right, 1, len(scan.bearings_rad) - 1)
    i = j - 1
    near, far = np.maximum(scan.near_m[i], scan.near_m[j]), np.minimum(scan.far_m[i], scan.far_m[j])
    free = within & (away >= near) & (away <= far)
    behind = np.zeros(len(points), bool)
    for k in (i, j):
        behind |= scan.is_thing[k] & (away > scan.far_m[k]) & (away <= scan.far_m[k] + HIDDEN_M)
    return free, within & behind & ~free


class Sweep(NamedTuple):
    """What a disc sweeps on a way.

    Attributes:
        points: (n, 2) on the floor [m, world].
        at_m: (n,) how far the disc has come when it first covers each; 0 for what it covers at the start.
    """

    points: Floats
    at_m: Floats

    def only(self, kept: Mask) -> Sweep:
        return Sweep(self.points[kept], self.at_m[kept])


def sample_sweep(way: Sequence[tuple[float, float]], radius_m: float, most_m: float) -> Sweep:
    """What a disc sweeps on the first ``most_m`` of a way (k, 2), by points of a grid."""
    line = shapely.LineString(way) if len(way) > 1 else shapely.LineString([way[0], way[0]])
    length = min(line.length, most_m)
    at = np.append(np.arange(0.0, length, SPACING_M / 2.0), length)
    places = shapely.get_coordinates(shapely.line_interpolate_point(line, at))
    low, high = places.min(axis=0) - radius_m, places.max(axis=0) + radius_m
    xs, ys = (SPACING_M * np.arange(np.floor(a / SPACING_M), np.ceil(b / SPACING_M) + 1.0)
              for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    dx, dy = (grid[:, None, k] - places[None, :, k] for k in (0, 1))
    near = dx * dx + dy * dy <= radius_m**2
    swept = near.any(axis=1)
    return Sweep(grid[swept], at[near[swept].argmax(axis=1)])


def find_blind(unseen: Sweep) -> Floats:
    """How far the disc has come (n,), rising, where it begins to cover unseen points that may hide something."""
    at = np.sort(unseen.at_m)
    if len(at) < MIN_POINTS:
        return np.zeros(0)
    few = MIN_POINTS - 1
    return np.asarray(at[:-few][at[few:] - at[:-few] <= WINDOW_M])


def measure_blind_m(unseen: Sweep) -> float:
    """How much of the way leads into unseen floor."""
    return SPACING_M * len(np.unique(np.floor(find_blind(unseen) / SPACING_M)))


MAX_HIDDEN_M = 0.2  # floor counts as seen where nothing higher than this can hide below the picture's lower border

MAX_FLOORS = 64
BORDER_PX = 8.0
"""What is nearer to the border of the picture does not count as seen."""
MIN_DEPTH_M = 0.1
MAX_FIRST_SEEN_M = 4.5
"""A camera that sees no floor nearer than this sees none that matters."""
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


def sees(robot: RobotModel, floor: shapely.Geometry, pose: Pose2, points: Floats) -> Mask:
    """Which points (n, 2) of the floor the camera sees from a pose, with what may stand there, by the model."""
    seen = _is_in_picture(robot, pose, points)
    rest = np.flatnonzero(seen)
    if len(rest):
        seen[rest] = _is_in_sight(robot, floor, pose, points[rest])
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
    ahead_m = np.arange(0.0, MAX_FIRST_SEEN_M, SPACING_M)
    seen = _is_in_picture(robot, Pose2(0.0, 0.0, 0.0), np.column_stack([ahead_m, np.zeros_like(ahead_m)]))
    return float(ahead_m[seen.argmax()])


def _is_in_sight(robot: RobotModel, floor: shapely.Geometry, pose: Pose2, points: Floats) -> Mask:
    """To which points a straight line leads over the open floor."""
    ahead = np.array([math.cos(pose.heading_rad), math.sin(pose.heading_rad)])
    eye = pose.position + robot.mount.forward_m * ahead
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


class Lookout(NamedTuple):
    """A look round from where the robot stands.

    Attributes:
        heading_rad: to turn to [world].
        gain_s: time that it saves, less what it takes.
    """

    heading_rad: float
    gain_s: float


def choose_look(
    robot: RobotModel, floor: shapely.Geometry, here: Pose2, ahead: Sequence[Pose2], unseen: Sweep, costs: Costs,
) -> Lookout | None:
    """The look from here that is worth its time; None where there is none, or a better one from a place ahead.

    Args:
        ahead: poses on the way at which pictures will be taken anyway.
        unseen: what the robot is going to sweep and was not seen yet.
    """
    rest = unseen
    for pose in (here, *ahead):  # these pictures cost nothing
        if len(rest.points):
            rest = rest.only(~sees(robot, floor, pose, rest.points))
    blind_m = measure_blind_m(rest)
    if blind_m * costs.creep_s_per_m <= 0.0:
        return None
    best = _find_best(robot, floor, here, rest, blind_m, costs)
    if best is None:
        return None
    better = (_find_best(robot, floor, pose, rest, blind_m, costs) for pose in ahead)
    return None if any(look is not None and look.gain_s > best.gain_s for look in better) else best


def _find_best(
    robot: RobotModel, floor: shapely.Geometry, pose: Pose2, unseen: Sweep, blind_m: float, costs: Costs,
) -> Lookout | None:
    """The look from a pose that saves the most time."""
    best: Lookout | None = None
    for k in range(HEADINGS):
        heading = wrap_angle(pose.heading_rad + 2.0 * math.pi * k / HEADINGS)
        cost_s = costs.look_s(wrap_angle(heading - pose.heading_rad))
        if blind_m * costs.creep_s_per_m <= cost_s + (0.0 if best is None else best.gain_s):
            continue
        seen = sees(robot, floor, Pose2(pose.x_m, pose.y_m, heading), unseen.points)
        if not seen.any():
            continue
        gain_s = (blind_m - measure_blind_m(unseen.only(~seen))) * costs.creep_s_per_m - cost_s
        if gain_s > (0.0 if best is None else best.gain_s):
            best = Lookout(heading, gain_s)
    return best
