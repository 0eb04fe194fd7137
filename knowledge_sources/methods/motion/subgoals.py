"""Subgoals from place to place: through the passages between locales, and round the obstacles within one (§3.3)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Geometry, LineString, Point

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor import build_polygon, find_floor, measure_first_seen_m
from knowledge_sources.methods.floor.looks_round import JOINT_M
from knowledge_sources.methods.motion.routes import (
    find_free_space,
    find_line_through,
    find_nearest,
    find_shortest_route,
    grow_obstacles,
    is_clear,
    list_lookouts,
)
from knowledge_sources.settings import PlanSettings
from world_models.building.locales import Doorway, Link, Passage
from world_models.building.passages import Route
from world_models.entries import Hypothesis, Obstacle, Place, Subgoal
from world_models.frames import Pose2
from world_models.robot import RobotModel

CLEARANCES_M = (0.12, 0.06, 0.03)  # margins round the robot's disc, tried in this order; the last must always be kept
DOORWAY_DISTANCES_M = (0.65, 0.55, 0.47, 0.40)
"""Distances from a doorway at which it is approached straight, tried in this order."""
SEEING_PARTS = (1.0, 0.75, 0.6)
"""From so much of the distance at which the robot first sees the floor it approaches a doorway, where there is room."""
DOORWAY_OFFSETS_M = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""Distances from its middle, to either side, at which it is approached diagonally, past what stands before it."""
LOOKOUT_DISTANCES_M = (1.8, 2.4, 3.0)  # distances from which it does so: the floor before it is in the picture
LOOKOUT_DIRECTIONS = 24  # directions round it from which that is tried
LOOKOUT_SHORT_M = 0.4  # so near before it something else may be in the line of sight: it may be a part of it
LOOKOUT_SAME_SIDE_M = 3.0  # so much farther another side of it may be than the one from which it was seen last
DOOR_LOOK_DISTANCES_M = (1.2, 1.6, 2.0, 2.6)  # distances from which a door is looked at from the front
DOOR_LOOK_APART_M = 0.7  # so far from where it was seen before: then it is another view
MIN_DOOR_LOOK_SINE = 0.7  # least sine of the angle at which it is seen there, 1 from the front
MAX_VISITS = 2  # so often one lookout is gone to: looks from one place count once
MIN_LOOKOUT_CHANGE_M = 0.4  # a place nearer than this to where the robot stands shows nothing new
WAY_TOLERANCE_M = 0.15  # tolerance at the end of a leg on the way
MAX_OVERLAP_M = 0.05  # so much nearer than touching a way may begin, where no other does: its place is not known better
LEFT_ROOM_M = 0.01  # of the room that a leg leaves to things, so much is kept
MIN_TOLERANCE_M = 0.02  # least tolerance at the end of a leg on the way
MIN_DOORWAY_CLEARANCE_M = 0.10  # a doorway with less room on each side of the robot is approached more exactly

MAX_ROUTES = 24
"""So many routes are tried for one that obstacles leave free."""


MAX_FREE_PASSAGES = 32
"""Size of the cache of what is free in and next to doorways."""


class _Ends(NamedTuple):
    """The places before and behind a passage, between which it is passed straight, and the tolerance at the first."""

    before: Place
    behind: Place
    tolerance_m: float


class SubgoalPlanner:
    """Plans the subgoals of a sketch, for one robot in the building as it is known now."""

    def __init__(
        self, robot: RobotModel, settings: PlanSettings, obstacles: Sequence[Obstacle] = ()
    ) -> None:
        """Prepare to plan.

        Args:
            obstacles: what stands somewhere and is not in the file; ways are sought round it, and by other doors.
        """
        self._robot, self._building, self._settings = robot, robot.world, settings
        self._obstacles = tuple(obstacle for obstacle in obstacles if obstacle.is_there)
        self._cluttered = frozenset(obstacle.locale for obstacle in self._obstacles)
        first_m = measure_first_seen_m(robot) if settings.approaches_seeing else 0.0
        self._seeing_m = [part * first_m for part in SEEING_PARTS if part * first_m > DOORWAY_DISTANCES_M[0]]

    def explain_unfit(self, there: Place) -> str:
        """Why the robot cannot stand at a place, as far as it knows; "" where it can."""
        building, name = self._building, there.locale
        if not building.locale(name).contains((there.x_m, there.y_m)):
            return f"is not within {name}"
        distance_m, what = find_nearest(building, name, there.in_world(building).position)
        radius_m, margin_m = self._robot.radius_m, CLEARANCES_M[-1]
        if distance_m >= radius_m + margin_m:
            return ""
        return (f"is {distance_m:.2f} m from {what}: the robot cannot stand there, with a radius of {radius_m:.2f} m"
                f" and the {margin_m:.2f} m that it keeps round itself")

    def plan_between_locales(self, here: Place, destination: Place, tolerance_m: float) -> tuple[Subgoal, ...] | None:
        """Subgoals through each passage to the destination, at the highest level where they differ (Figure 9).

        Where what the model lacks leaves no way through a room or to a passage, other passages are tried; and where
        none is left, passing one diagonally.
        """
        straight = self._plan_by_any(here, destination, tolerance_m, diagonal=False)
        return straight if straight or not self._cluttered else self._plan_by_any(
            here, destination, tolerance_m, diagonal=True)

    def _plan_by_any(
        self, here: Place, destination: Place, tolerance_m: float, *, diagonal: bool
    ) -> tuple[Subgoal, ...] | None:
        """Subgoals by the first route that obstacles leave free; ``diagonal``: its passages may be passed so.
        """
        tried: set[frozenset[str]] = set()
        todo: list[tuple[Passage, ...]] = [()]
        while todo and len(tried) < MAX_ROUTES:
            avoided = todo.pop(0)
            names = frozenset(passage.name for passage in avoided)
            if names in tried:
                continue
            tried.add(names)
            route = self._building.route(here.locale, destination.locale, avoided)
            if route is None:
                continue
            subgoals, blocked = self._plan_route(route, here, destination, tolerance_m, diagonal)
            if not blocked:
                return tuple(subgoals)
            todo += [(*avoided, passage) for passage in blocked]
        return None

    def _has_way(self, here: Place, there: Place) -> bool:
        """Whether a way leads round the obstacles of one room; where there are none, the model says so already."""
        if here.locale != there.locale or here.locale not in self._cluttered:
            return True
        start, end = here.in_world(self._building), there.in_world(self._building)
        return self._find_way(here.locale, start.position, end.position) is not None

    def _plan_route(
        self, route: Route, here: Place, destination: Place, tolerance_m: float, diagonal: bool
    ) -> tuple[list[Subgoal], list[Passage]]:
        """Subgoals along a route; or the passages at the ends of the first part of it on which obstacles leave no way.
        """
        subgoals: list[Subgoal] = []
        came: list[Passage] = []
        for step, rooms_m in zip(route.steps, self._measure_rooms_m(route, here, destination), strict=True):
            ends = self._find_ends(step.passage, step.origin, step.destination, rooms_m, diagonal)
            if ends is None or not self._has_way(here, ends.before):
                return [], [step.passage, *(() if ends is None else came)]
            subgoals.append(self._build_subgoal(here, ends.before, ends.tolerance_m))
            on_wheels = not isinstance(step.passage, Link)  # else it is a ride: there is nothing to drive
            subgoals.append(
                Subgoal(ends.before, ends.behind, on_wheels, step.passage.name, WAY_TOLERANCE_M))
            here, came = ends.behind, [step.passage]
        if came and not self._has_way(here, destination):
            return [], came
        return [*subgoals, self._build_subgoal(here, destination, tolerance_m)], []

    def _measure_rooms_m(self, route: Route, here: Place, destination: Place) -> list[tuple[float, float]]:
        """How far from each passage of a route the robot may turn to it, and leave it, without turning back: as far as
        the way begins or ends from it, or half as far as the next passage is.
        """
        ends = [here.in_world(self._building).position, destination.in_world(self._building).position]
        places = [[self._find_middle(step.passage, side) for side in (step.origin, step.destination)]
                  for step in route.steps]
        gaps = [0.5 * math.dist(a[1], b[0]) for a, b in pairwise(places)]
        gaps = [math.dist(ends[0], places[0][0]), *gaps, math.dist(places[-1][1], ends[1])] if places else []
        return list(pairwise(gaps))

    def _find_middle(self, passage: Passage, locale: str) -> Floats:
        """(2,) of a doorway's threshold in a locale; where the robot stops for a link [m, world]."""
        if isinstance(passage, Link):
            return passage.stop_of(locale)[:2]
        return np.asarray(passage.threshold_of(locale).mean(axis=0))

    def _find_ends(
        self, passage: Passage, origin: str, destination: str, rooms_m: tuple[float, float], diagonal: bool
    ) -> _Ends | None:
        """The places before and behind a passage: straight before it, or past what stands there, diagonally.

        Where a thing of the model leaves no room for either, it may be elsewhere: the passage is tried.
        """
        sides = origin, destination
        ends = [self._find_place_before(passage, side, m) for side, m in zip(sides, rooms_m, strict=True)]
        if None in ends and not isinstance(passage, Link) and (diagonal or not self._cluttered.intersection(sides)):
            middles = [self._find_middle(passage, side) for side in sides]
            for clearance_m in CLEARANCES_M:
                free = self._find_free_passage(sides, clearance_m)
                line = find_line_through(free, middles, passage.outward_from(origin), DOORWAY_DISTANCES_M,
                                         DOORWAY_OFFSETS_M)
                if line is not None:
                    a, b = (Place.of_world(self._building, side, float(x), float(y))
                            for side, (x, y) in zip(sides, line, strict=True))
                    return _Ends(a, b, min(clearance_m, self._way_tolerance_m(passage)))
        before, behind = (self._find_place_before(passage, side, 0.0, is_tried=True) if end is None
                          and side not in self._cluttered else end for side, end in zip(sides, ends, strict=True))
        return None if before is None or behind is None else _Ends(before, behind, self._way_tolerance_m(passage))

    def _find_free_passage(self, rooms: tuple[str, str], margin_m: float) -> Geometry:
        """Where the robot's centre may be in two rooms and their doorways, with a margin round the robot."""
        found = tuple(obstacle.footprint for obstacle in self._obstacles if obstacle.locale in rooms)
        key = (rooms, self._robot.radius_m + margin_m, found)
        return self._building.cached("free passages", MAX_FREE_PASSAGES, key, lambda: shapely.buffer(
            shapely.difference(find_floor(self._building, rooms), shapely.union_all([*map(build_polygon, found)])),
            -self._robot.radius_m - margin_m - JOINT_M))

    def _way_tolerance_m(self, passage: Passage) -> float:
        """Tolerance at the place before a passage, so that the robot passes it straight without contact."""
        if isinstance(passage, Link):
            return WAY_TOLERANCE_M
        beside = passage.width_m / 2 - self._robot.radius_m
        if beside >= MIN_DOORWAY_CLEARANCE_M:
            return WAY_TOLERANCE_M
        return max(beside, CLEARANCES_M[-1])

    def _find_place_before(self, passage: Passage, locale: str, most_m: float, is_tried: bool = False) -> Place | None:
        """The place from which a passage is passed straight, rather no farther from it; None where something is in the
        way, unless it ``is_tried`` all the same.
        """
        if isinstance(passage, Link):
            x, y, heading = passage.stop_of(locale)
            return Place.of_world(self._building, locale, float(x), float(y), float(heading))
        middle, outward = self._find_middle(passage, locale), passage.outward_from(locale)
        wide, free = (self._free_space(locale, CLEARANCES_M[k]) for k in (0, -1))
        seeing = (m for m in self._seeing_m if m <= most_m and wide.covers(Point(middle - m * outward)))
        near = (m for m in DOORWAY_DISTANCES_M if free.covers(Point(middle - m * outward)))
        fit: Iterator[float] = chain(seeing, near)
        if locale in self._cluttered:
            fit = (m for m in fit if self._is_passed(middle, middle - m * outward, locale))
        away = next(fit, DOORWAY_DISTANCES_M[0] if is_tried else math.nan)
        x, y = middle - away * outward
        if math.isnan(away) or not is_clear(self._free_space(locale, -self._robot.radius_m), middle, (x, y)):
            return None
        return Place.of_world(self._building, locale, float(x), float(y))

    def _build_subgoal(self, origin: Place, destination: Place, tolerance_m: float) -> Subgoal:
        """A subgoal, primitive where a straight line leads there; between locales a later sketch refines it."""
        if origin.locale != destination.locale:
            return Subgoal(origin, destination, False, tolerance_m=tolerance_m)
        a, b = origin.in_world(self._building), destination.in_world(self._building)
        free = self._free_space(destination.locale, CLEARANCES_M[-1])
        straight = a.distance_to(b) <= self._settings.max_leg_m and is_clear(free, a.position, b.position)
        return Subgoal(origin, destination, straight, tolerance_m=tolerance_m)

    def plan_across(self, subgoal: Subgoal, belief: Hypothesis) -> tuple[Subgoal, ...] | None:
        """Straight legs round the obstacles of one locale, none longer than ``max_leg_m``."""
        locale = subgoal.destination.locale
        here, there = belief.world_from_robot(self._building), subgoal.destination.in_world(self._building)
        route = self._find_way(locale, here.position, there.position)
        if route is None:
            return None
        points = _divide(route, self._settings.max_leg_m)
        places = [Place.of_world(self._building, locale, float(x), float(y)) for x, y in points]
        places[-1] = subgoal.destination
        last = len(places) - 2
        return tuple(
            Subgoal(a, b, True, tolerance_m=self._limit_tolerance_m(
                a, b, subgoal.tolerance_m if i == last else WAY_TOLERANCE_M))
            for i, (a, b) in enumerate(pairwise(places))
        )

    def _limit_tolerance_m(self, a: Place, b: Place, most_m: float) -> float:
        """The tolerance of a straight leg: no more than the room that it leaves to what the model lacks.

        A short leg away from what the robot stands at is driven, too, and not taken to be done.
        """
        leg = LineString([place.in_world(self._building).position for place in (a, b)])
        room_m = min((leg.distance(build_polygon(obstacle.footprint)) - self._robot.radius_m
                      for obstacle in self._obstacles if obstacle.locale == b.locale), default=math.inf)
        return min(most_m, max(room_m - LEFT_ROOM_M, MIN_TOLERANCE_M))

    def plan_look(self, belief: Hypothesis, obstacle: Obstacle, lookouts: Floats) -> Subgoal | None:
        """A place in the robot's room to look at an obstacle again, from elsewhere; None where none is left.

        It is so far away that the floor before the obstacle is in the picture; near, but rather on another side. No
        place is led to a third time: ``lookouts`` (n, 2) [world] are those that were.
        """
        locale, here = belief.locale, belief.world_from_robot(self._building)
        poses = list_lookouts(
            self._free_space(locale, CLEARANCES_M[0], is_round=True),
            find_floor(self._building, {locale, obstacle.locale}), obstacle.footprint, LOOKOUT_DISTANCES_M,
            LOOKOUT_DIRECTIONS, LOOKOUT_SHORT_M)
        away = np.linalg.norm(poses[:, :2] - here.position, axis=1)
        middle = np.mean(build_polygon(obstacle.footprint).exterior.coords[:-1], axis=0)
        side_rad = math.atan2(*(middle - here.position)[::-1])
        same_side = np.maximum(0.0, np.cos(poses[:, 2] - side_rad))
        order = np.argsort(away + LOOKOUT_SAME_SIDE_M * same_side, kind="stable")
        visits = np.linalg.norm(poses[:, None, :2] - lookouts, axis=2) < MIN_LOOKOUT_CHANGE_M
        is_new = (away >= MIN_LOOKOUT_CHANGE_M) & (visits.sum(axis=1) < MAX_VISITS)
        return self._lead_to_first(locale, here, poses[order[is_new[order]]])

    def plan_door_look(self, belief: Hypothesis, doorway: Doorway, seen_from: Sequence[Floats]) -> Subgoal | None:
        """The nearest place in the robot's room from which a doorway is seen from the front; None where none is left.

        Args:
            seen_from: places (2,) [world] from which it was seen; no nearer ones show anything new.
        """
        locale, here = belief.locale, belief.world_from_robot(self._building)
        poses = list_lookouts(
            self._free_space(locale, CLEARANCES_M[0], is_round=True),
            find_floor(self._building, {locale}), doorway.threshold_of(locale), DOOR_LOOK_DISTANCES_M,
            LOOKOUT_DIRECTIONS, LOOKOUT_SHORT_M)
        outward = doorway.outward_from(locale)
        kept = np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])]) @ outward >= MIN_DOOR_LOOK_SINE
        for place in seen_from:
            kept &= np.linalg.norm(poses[:, :2] - place, axis=1) >= DOOR_LOOK_APART_M
        poses = poses[kept]
        away = np.linalg.norm(poses[:, :2] - here.position, axis=1)
        return self._lead_to_first(locale, here, poses[np.argsort(away, kind="stable")])

    def _lead_to_first(self, locale: str, here: Pose2, poses: Floats) -> Subgoal | None:
        """The subgoal to the first of some poses (n, 3) to which a way leads."""
        for pose in poses:
            if self._find_way(locale, here.position, pose[:2]) is not None:
                x, y, heading = (float(v) for v in pose)
                return self._build_subgoal(
                    Place.of_world(self._building, locale, here.x_m, here.y_m),
                    Place.of_world(self._building, locale, x, y, heading), WAY_TOLERANCE_M)
        return None

    def _find_way(self, locale: str, start: Floats, end: Floats) -> list[Floats] | None:
        """The shortest way across a locale, with the largest margin that leaves one; None where none does."""
        def floor() -> Geometry:
            doorways = self._building.doorways_of(locale)  # it may stand in one
            openings = [shapely.convex_hull(shapely.multipoints(doorway.thresholds_world.reshape(-1, 2)))
                        for doorway in doorways]
            beyond = [shapely.Polygon(self._building.outline(room)) for room in sorted(
                {room for doorway in doorways for room in doorway.between} - {locale})]
            parts = [self._free_space(locale, -self._robot.radius_m), *openings, *beyond]
            return shapely.buffer(shapely.union_all(shapely.buffer(parts, JOINT_M, join_style="mitre")), -JOINT_M,
                                  join_style="mitre")

        for radius_m in (self._robot.radius_m, self._robot.radius_m - MAX_OVERLAP_M):
            for free in self._list_free_spaces(locale):
                route = find_shortest_route(free, start, end, floor, radius_m)
                if route is not None:
                    return route
        return None

    def _list_free_spaces(self, locale: str) -> Iterator[Geometry]:
        """Where the robot's centre may be, with ever smaller margins."""
        if locale in self._cluttered:
            yield self._find_wide_space(locale)
        for margin_m in CLEARANCES_M:
            yield self._free_space(locale, margin_m)
        yield self._free_space(locale, CLEARANCES_M[-1], is_round=True)

    def _find_wide_space(self, locale: str) -> Geometry:
        """Where the robot's centre may be with more room to what the model lacks: its top may be wider than its feet.
        """
        away_m = self._robot.radius_m + CLEARANCES_M[0] + self._settings.overhang_m
        found = [obstacle.footprint for obstacle in self._obstacles if obstacle.locale == locale]
        return shapely.difference(self._free_space(locale, CLEARANCES_M[0]), grow_obstacles(found, away_m))

    def _is_passed(self, middle: Floats, before: Floats, locale: str) -> bool:
        """Whether the robot clears all obstacles of a locale between a doorway and a place before it."""
        line, reach_m = LineString([middle, before]), self._robot.radius_m + CLEARANCES_M[-1]
        return all(line.distance(build_polygon(obstacle.footprint)) >= reach_m
                   for obstacle in self._obstacles if obstacle.locale == locale)

    def _free_space(self, locale: str, margin_m: float, *, is_round: bool = False) -> Geometry:
        """Where the robot's centre may be with a margin round the robot; cached."""
        return find_free_space(self._building, locale, self._robot.radius_m + margin_m, is_round=is_round)


def _divide(route: list[Floats], max_leg_m: float) -> list[Floats]:
    """The same route with way points in between, so that no leg is longer than ``max_leg_m``."""
    points = route[:1]
    for a, b in pairwise(route):
        parts = max(1, math.ceil(float(np.linalg.norm(b - a)) / max_leg_m))
        points += [a + (b - a) * (i / parts) for i in range(1, parts + 1)]
    return points
