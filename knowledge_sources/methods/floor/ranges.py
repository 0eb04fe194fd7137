"""Free floor from a ring of range sensors: free up to the nearest echo in a cone, and what the model says of that echo.

A sensor hears at its height only, and the nearest thing anywhere in its cone. So the floor of a cone is free up to
its echo; where cones overlap, as far as the one that hears furthest. Without an echo nothing is known: a wall may
have thrown the sound away. What stands on the arc of an echo is where no other cone, and no earlier reading, found free
floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from knowledge_sources.methods.arrays import Floats, Indices, Mask
from world_models.building.building import Building
from world_models.building.locales import ROBOT_TOP_M, STEP_M
from world_models.entries import FloorEnd, FloorThing, FreeFloor, Point, Ranges
from world_models.frames import Pose2
from world_models.robot import RobotModel

RANGE_SIGMAS = 3.0  # free floor ends so many standard deviations of a distance before an echo
RANGE_SLACK_M = 0.1
"""An echo that is nearer than the model's nearest wall or thing by no more is of that: what is flush with a wall is
not in the model."""
MAX_RANGE_THING_M = 1.2  # a thing is concluded from an echo up to here from its sensor: further, its cone is too wide
RANGE_BEARINGS = 120  # directions in which the free floor of a reading is written down
RANGE_ARC_POINTS = 9  # places on the arc of an echo that are asked after
RANGE_JOIN_M = 0.2  # echoes of neighbouring sensors that are no further apart are of one thing
RANGE_DEPTH_M = 0.1  # how deep a thing is taken to be that was ranged
ECHO_P = 0.7  # probability of a thing after one echo that the model does not explain
MAX_RANGE_P = 0.99  # probability that many echoes add up to


@dataclass(frozen=True, slots=True)
class Cones:
    """The cones of n range sensors on the robot's rim, with the robot's axis as origin; world frame.

    Attributes:
        origin: (2,) the robot's axis [m].
        rim_m: of each sensor from there.
        axes_rad: (n,) directions.
        half_beam_rad: half of their angle.
        away_m: (n,) from sensor to echo; infinite without one.
    """

    origin: Floats
    rim_m: float
    axes_rad: Floats
    half_beam_rad: float
    away_m: Floats

    @property
    def sensors(self) -> Floats:
        """(n, 2) their places [m]."""
        return self.origin + self.rim_m * np.stack([np.cos(self.axes_rad), np.sin(self.axes_rad)], axis=-1)

    @property
    def is_heard(self) -> Mask:
        return np.isfinite(self.away_m)


def see_ranges(
    robot: RobotModel, locale: str, pose: Pose2, sigma_m: float, sigma_rad: float, ranges: Ranges,
    earlier: Sequence[FreeFloor],
) -> FreeFloor:
    """What one reading tells of the floor round a robot.

    Args:
        pose: of the robot [world]; sigma_m, sigma_rad: how well it is known.
        earlier: what earlier readings showed, newest first.
    """
    cones = _build_cones(robot, pose, ranges)
    rooms = find_rooms_within(robot.world, locale, pose, ranges.max_range_m)
    place_m = math.hypot(ranges.sigma_m, sigma_m)
    expected = measure_nearest(cones, list_solid_segments(robot.world, rooms), 3.0 * sigma_rad, 3.0 * sigma_m)
    slack_m = RANGE_SLACK_M + 3.0 * place_m
    is_new = cones.is_heard & (cones.away_m < expected - slack_m)
    is_known = cones.is_heard & (np.abs(cones.away_m - expected) <= slack_m)
    count = RANGE_BEARINGS
    bearings = (np.arange(count + 1) - count // 2) * math.tau / count  # the last is the first again
    near, far, ended_by = find_free_intervals(cones, bearings, RANGE_SIGMAS * ranges.sigma_m)
    free = far > near
    ends: list[FloorEnd] = ["thing" if is_new[k] else "model" if is_known[k] else "sight" for k in ended_by]
    touching_m = _find_touching(cones, is_new, bearings)
    far = np.where(free, far, touching_m)
    ends = [end if is_free else "thing" if there > 0.0 else "sight"
            for end, is_free, there in zip(ends, free, touching_m, strict=True)]
    sigmas = np.hypot(place_m, sigma_rad * np.maximum(far, 0.0))
    floor = FreeFloor(
        "ranges", locale, pose.x_m, pose.y_m, _rounded(bearings), _rounded(np.where(free, near, cones.rim_m)),
        _rounded(far), tuple(ends), _rounded(sigmas), (), ranges.when_s)
    is_new &= cones.away_m <= MAX_RANGE_THING_M
    things = _find_things(cones, is_new, floor, earlier, rooms, robot.world, place_m)
    return replace(floor, things=tuple(things))


def find_rooms_within(building: Building, locale: str, pose: Pose2, reach_m: float) -> tuple[str, ...]:
    """A room and those whose open doors are all within reach on the way to them, by the straight line."""
    found = [locale]
    for room in found:
        for doorway in building.doorways_of(room):
            other = doorway.other(room)
            if other not in found and math.dist(doorway.centre_world, pose.position) <= reach_m + doorway.width_m:
                found.append(other)
    return tuple(found)


def list_solid_segments(building: Building, rooms: Sequence[str]) -> Floats:
    """(n, 2, 2) outlines on the floor of what the file has of walls and things, at the robot's height [m, world].

    What was found to stand there and the file lacks is left out.
    """
    scene, floor_m = building.scene_of(rooms), building.floor_m(rooms[0])
    polygons = scene.polygons_world[scene.surface_face >= 0]
    heights = polygons[:, :, 2] - floor_m
    polygons = polygons[(heights.min(axis=1) < ROBOT_TOP_M) & (heights.max(axis=1) > STEP_M), :, :2]
    sides = [np.stack([polygons, np.roll(polygons, -1, axis=1)], axis=2).reshape(-1, 2, 2)]
    for room in rooms:
        corners = [thing.footprint_world for thing in building.things_of(room)
                   if thing.is_obstacle and thing.kind != "obstacle"]
        sides += [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in corners]
    return np.concatenate(sides)


def measure_nearest(cones: Cones, segments: Floats, more_rad: float, place_m: float) -> Floats:
    """(n,) distance from each sensor to the nearest point of segments in its cone [m]; infinite where there is none.

    Each cone is wider by an angle, and by what a place that is known to ``place_m`` leaves open at the echo.
    """
    away = np.where(cones.is_heard, cones.away_m, 1.0)
    half = np.minimum(cones.half_beam_rad + more_rad + np.arctan2(place_m, np.maximum(away, 0.3)), 1.5)
    ends = segments[None] - cones.sensors[:, None, None]
    c, s = np.cos(cones.axes_rad)[:, None, None], np.sin(cones.axes_rad)[:, None, None]
    ends = np.stack([c * ends[..., 0] + s * ends[..., 1], c * ends[..., 1] - s * ends[..., 0]], axis=-1)
    start, along = ends[:, :, 0], ends[:, :, 1] - ends[:, :, 0]
    low, high = np.zeros(start.shape[:2]), np.ones(start.shape[:2])
    for side in (1.0, -1.0):  # a cone is what two half-planes have in common: clip the segments by both
        normal = np.stack([np.sin(half), side * np.cos(half)], axis=-1)[:, None]
        at_start, slope = np.sum(start * normal, axis=-1), np.sum(along * normal, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -at_start / slope
        low = np.where(slope > 0.0, np.maximum(low, crossing), low)
        high = np.where(slope < 0.0, np.minimum(high, crossing), high)
        high = np.where((slope == 0.0) & (at_start < 0.0), -1.0, high)
    length2 = np.maximum(np.sum(along * along, axis=-1), 1e-18)
    part = np.minimum(np.maximum(-np.sum(start * along, axis=-1) / length2, low), high)
    points = start + part[..., None] * along
    distances = np.where(low <= high, np.hypot(points[..., 0], points[..., 1]), np.inf)
    return np.asarray(distances.min(axis=1, initial=np.inf))


def find_free_intervals(cones: Cones, bearings_rad: Floats, margin_m: float) -> tuple[Floats, Floats, Indices]:
    """Where each bearing (m,) from the robot's axis is free: (near [m], far [m], by whose echo it ends).

    All bearings that are nearer to one of them than to another are free as it is. Where ``far`` is not above ``near``
    nothing is known.
    """
    half_step = 0.5 * math.tau / (len(bearings_rad) - 1)
    off = np.abs(np.remainder(bearings_rad[:, None] - cones.axes_rad + math.pi, math.tau) - math.pi) + half_step
    clear = np.where(cones.is_heard, cones.away_m, 0.0) - margin_m  # (n,) free distance from each sensor
    rim, tangent = cones.rim_m, math.tan(cones.half_beam_rad)
    opening = tangent * np.cos(off) - np.sin(off)
    with np.errstate(divide="ignore", invalid="ignore"):
        near = np.where(opening > 1e-9, rim * tangent / opening, np.inf)
        far = rim * np.cos(off) + np.sqrt(clear**2 - (rim * np.sin(off)) ** 2)
    far = np.where((clear > 0.0) & np.isfinite(far) & (far > near), far, -np.inf)  # (m, n)
    ended_by = np.argmax(far, axis=1)
    rows = np.arange(len(bearings_rad))
    begins = near[rows, ended_by]
    joins = (far >= begins[:, None]) & np.isfinite(far)  # cones that reach into the one that hears furthest
    return np.where(joins, near, np.inf).min(axis=1), far[rows, ended_by], ended_by


def _find_touching(cones: Cones, is_new: Mask, bearings_rad: Floats) -> Floats:
    """(m,) how far from the robot's axis something new is, so near that no floor before it is heard free; else 0."""
    off = np.abs(np.remainder(bearings_rad[:, None] - cones.axes_rad + math.pi, math.tau) - math.pi)
    within = is_new & (cones.away_m < cones.rim_m) & (off <= cones.half_beam_rad)
    away = np.where(within, cones.away_m, np.inf).min(axis=1, initial=np.inf)
    return np.where(np.isfinite(away), cones.rim_m + away - 1e-3, 0.0)


def _build_cones(robot: RobotModel, pose: Pose2, ranges: Ranges) -> Cones:
    away = [math.inf if distance is None else max(0.0, distance - robot.radius_m) for distance in ranges.distances_m]
    axes = np.array(ranges.directions_rad, float) + pose.heading_rad
    return Cones(np.array(pose.position, float), robot.radius_m, axes, ranges.half_beam_rad, np.array(away, float))


def is_free_at(floor: FreeFloor, points: Floats, margin_m: float) -> Mask:
    """Which points (n, 2) [m, world] a floor of :func:`see_ranges` has found free, by more than a margin."""
    off = points - (floor.x_m, floor.y_m)
    away, bearing = np.hypot(off[:, 0], off[:, 1]), np.arctan2(off[:, 1], off[:, 0])
    count = len(floor.bearings_rad) - 1
    index = np.round((bearing - floor.bearings_rad[0]) * count / math.tau).astype(int) % count
    return np.asarray((away >= np.array(floor.near_m)[index]) & (away < np.array(floor.far_m)[index] - margin_m))


def _find_things(
    cones: Cones, is_new: Mask, floor: FreeFloor, earlier: Sequence[FreeFloor], rooms: Sequence[str],
    building: Building, sigma_m: float,
) -> Iterator[FloorThing]:
    """Something for each group of neighbouring echoes that the model does not explain."""
    outlines = shapely.union_all([shapely.buffer(shapely.Polygon(building.outline(room)), -sigma_m) for room in rooms])
    arcs: list[tuple[int, Floats]] = []
    for k in np.flatnonzero(is_new):
        arc = _cut_arc(cones, int(k), floor, earlier, 3.0 * sigma_m, RANGE_ARC_POINTS)
        if shapely.contains_xy(outlines, *arc[len(arc) // 2]):
            arcs.append((int(k), arc))
    for group in _join_neighbours(arcs, len(cones.axes_rad), RANGE_JOIN_M):
        footprint = _build_footprint(cones, group, RANGE_DEPTH_M)
        echoes = len(group)
        nearest_m = min(float(cones.away_m[k]) for k, _ in group)
        yield FloorThing(
            footprint, sigma_m, 0.0, math.inf, min(MAX_RANGE_P, 1.0 - (1.0 - ECHO_P) ** echoes),
            (0.0, 0.0, 0.0, 0.0),
            f"{echoes} echo{'es' * (echoes > 1)} where the model has free floor, the nearest {nearest_m:.2f} m away")


def _cut_arc(
    cones: Cones, k: int, floor: FreeFloor, earlier: Sequence[FreeFloor], margin_m: float, points: int
) -> Floats:
    """The middle half (m, 2) of the places on the arc of an echo where no cone finds free floor, nor did one before.

    Where all of the arc was free before, what is heard has come since then.
    """
    angles = cones.axes_rad[k] + np.linspace(-cones.half_beam_rad, cones.half_beam_rad, points)
    arc = cones.sensors[k] + cones.away_m[k] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    kept = np.ones(len(arc), bool)
    for seen in (floor, *earlier):
        rest = kept & ~is_free_at(seen, arc, margin_m)
        if not rest.any():  # it has come since then
            break
        kept = rest
    left = np.flatnonzero(kept)
    quarter = len(left) // 4
    return np.asarray(arc[left[quarter : len(left) - quarter]])


def _join_neighbours(
    arcs: Sequence[tuple[int, Floats]], count: int, join_m: float
) -> Iterator[list[tuple[int, Floats]]]:
    """Arcs in groups: those of neighbouring sensors of a ring that are not further apart than ``join_m``."""
    rest = list(arcs)
    while rest:
        group = [rest.pop(0)]
        for member in group:
            for other in list(rest):
                beside = abs(member[0] - other[0]) in (1, count - 1)
                gaps = np.linalg.norm(member[1][:, None] - other[1][None], axis=-1)
                if beside and float(gaps.min()) <= join_m:
                    group.append(other)
                    rest.remove(other)
        yield group


def _build_footprint(cones: Cones, group: Sequence[tuple[int, Floats]], depth_m: float) -> tuple[Point, ...]:
    """The hull of the arcs of a group and of what is a little behind them, counter-clockwise."""
    points: list[Floats] = []
    for k, arc in group:
        out = arc - (cones.sensors[k] if cones.away_m[k] > 1e-6 else cones.origin)  # what touches a sensor is a point
        out = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
        across = 0.01 * np.stack([-out[:, 1], out[:, 0]], axis=-1)  # one point of an arc has a width too
        points += [arc - across, arc + across, arc + depth_m * out]
    hull = orient(shapely.MultiPoint(np.concatenate(points)).convex_hull)
    return tuple((round(float(x), 3), round(float(y), 3)) for x, y in np.asarray(hull.exterior.coords)[:-1])


def _rounded(values: Floats) -> tuple[float, ...]:
    return tuple(round(float(value), 4) for value in values)
