"""Floor ahead (§5): how far the way ahead is seen to be free, and where to look for the rest; pure reads."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely

from blackboard import Entry, View
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor import (
    LOOK_PICTURE_S,
    FloorMap,
    Lookout,
    Sweep,
    build_polygon,
    choose_look,
    find_blind,
    find_floor,
    sample_sweep,
)
from knowledge_sources.methods.motion import MAX_LOOK_ERROR_RAD, Clearance, choose_move, plan_turn
from knowledge_sources.reads.conditions import Belief
from knowledge_sources.reads.lost import locate_contact
from knowledge_sources.reads.questions import active_goal, deepest_sketch, find_robot, list_touches
from knowledge_sources.reads.sketches import find_first_level
from knowledge_sources.settings import ActionSettings, Settings
from world_models.building.locales import EXTRA_KIND
from world_models.entries import (
    CameraPicture,
    Contact,
    DoorState,
    FreeFloor,
    Goal,
    Hypothesis,
    Impasse,
    Leg,
    MotionReport,
    MotorCommand,
    Obstacle,
    PlaceSearch,
    PlanSketch,
    RideReport,
)
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

SEEN_MARGIN_M = 0.03  # margin round the robot's disc within which the floor must be seen to be free
PUT_DOWN_FREE_M = 0.75  # round where it was put down the floor is free to this distance: a person sees it
NEAR_MODEL_M = 0.08  # nearer to a wall or a thing of the model the floor need not be seen
STEP_M = 0.05  # of the way, along which distances to things are measured
MIN_MOVE_M = 0.05  # where there is less room before what may stand there, the leg is halted
MAX_BRAKING_M = 0.6  # so far ahead the way is asked after: more than the robot needs to stop
UNSURE_GAP_M = 0.3  # what was seen of what is only suspected may be a part of it, which reaches so much further
AT_M = 0.025  # of the way, to which it is told where a touch may happen
WIDER_STEPS = 20  # in which the probability falls with the distance from what may be wider than is known
TOUCHED_GAP_M = 0.02  # what was touched is not come so near to again
TOUCHED_AWAY = 0.2  # nearer to it than that a move must lead away from it by this part of the way
TOUCH_HOLDS_M = 0.5  # after so much of the way a touch that is no obstacle tells no more where not to go
AWAY_M = 0.15  # length of the move away from what was touched
AWAY_STEP_RAD = math.radians(15.0)  # of the directions that are tried for it
MAX_DRIVEN_GAP_M = 0.8  # between two pictures that are no further apart the robot drove straight
LOOK_BEFORE_M = 0.4  # from so far before its rim would touch a door that may be shut, it looks at that once more
LOOK_AHEAD_M = 1.1  # so much of the way beyond a leg is looked at before it ends: what is too near to be seen then
LOOK_FROM_M = 3.0  # distance from the end of a leg from which that begins

Point = tuple[float, float]
Standing = tuple[Entry[Any], shapely.Geometry, float, float]
"""What may stand there, from how near to it a move leads away, and by how much of the way [m]."""
NOT_TOUCHED = (0.0, -1e-9)
"""The last two of these for what the robot may drive along."""


class FloorAhead:
    """What the board tells of the floor along the way of one leg."""

    def __init__(self, view: View, leg: Leg, belief: Entry[Hypothesis], whole: Settings) -> None:
        settings = whole.action
        self._settings, self._leg = settings, leg
        self._robot = find_robot(view)
        self._here = belief.value.world_from_robot(self._robot.world)
        self._ahead_rad = math.atan2(leg.y1_m - self._here.y_m, leg.x1_m - self._here.x_m)
        self._to_go_m = math.dist((leg.x1_m, leg.y1_m), self._here.position)
        self._beyond, locales = _find_way_beyond(view, self._robot)
        self._locales = tuple(sorted({belief.value.locale, *locales}))
        self._floor = find_floor(self._robot.world, self._locales)
        found = [shapely.Polygon(thing.footprint_world) for name in self._locales
                 for thing in self._robot.world.things_of(name) if thing.kind == EXTRA_KIND]
        self._tested = shapely.buffer(shapely.union_all([self._floor, *found]), -NEAR_MODEL_M)
        self._suspected = _list_what_may_stand(view)
        self._touches = _list_touches(view, self._here)
        doubted = {entry.value.door: entry for entry in view.where(
            DoorState, lambda door: door.may_be_shut and door.touched_s is None)}
        self._doubted = [(doubted[door.name], shapely.MultiPoint(np.concatenate(door.thresholds_world)).convex_hull)
                         for door in self._robot.world.doorways_of(belief.value.locale) if door.name in doubted]
        drawn, named = find_first_level(view), {id for impasse in view.all(Impasse) for id in impasse.value.behind}
        self._asks_for_look = drawn is not None and not drawn.value.halts and not any(
            entry.id in named for entry in doubted.values())
        self._scans = _find_scans(view, belief, settings)
        self._discs = list_free_discs(view, self._robot, self._here, self._scans)
        search = _find_last_search(view)  # what was seen before it was found does not count
        self._reasons: dict[str, Entry[Any]] = {} if search is None else {search.id: search}
        self._map = FloorMap(
            [entry.value for entry in self._scans], np.array([disc.circle for disc in self._discs]))
        self._wider = [(polygon, 1.0, whole.plan.overhang_m) for polygon in found]
        self._wider += [(polygon, entry.value.certainty, UNSURE_GAP_M) for entry, polygon in self._suspected
                        if not entry.value.is_there]

    @property
    def because(self) -> tuple[Entry[Any], ...]:
        """What the answers so far rest on: views of the floor, what may stand on it, and since when.
        """
        return tuple(sorted(self._reasons.values(), key=lambda entry: (entry.cycle, entry.id)))

    def measure_clearance(self, way_m: float) -> Clearance:
        """Where straight ahead a touch may happen on so much of the way, and how probably; beyond the leg's end too.

        Something stands, as far as is known, on each floor of which the map tells nothing, and elsewhere as probably as
        the map says. What was found, or is suspected, may reach further than was seen of it, by any length up to the
        longest that is likely.
        """
        room_m = self._measure_room_m(way_m)
        swept = self._sweep_ahead(room_m)
        places = shapely.points(swept.points)
        p = self._tell(swept)
        for polygon, certainty, wider_m in self._wider:
            away_m = shapely.distance(places, polygon)
            near = 1.0 - np.where(away_m > 0.0, away_m + SEEN_MARGIN_M, 0.0) / wider_m
            steps = np.ceil(np.where(swept.at_m > 0.0, near.clip(0.0), 0.0) * WIDER_STEPS)  # else it is there already
            p = np.maximum(p, certainty * steps / WIDER_STEPS)
        p[(swept.at_m > self._to_go_m) & (shapely.distance(places, self._floor) > SEEN_MARGIN_M)] = 1.0
        risks: dict[float, Floats] = {1.0: np.array([room_m] if room_m < way_m else [])}
        borne = (self._settings.creep_speed_m_per_s / self._robot.actuator.speed_m_per_s) ** 2
        for level in sorted(set(np.round(p[p > borne], 3).tolist())):
            risks[level] = np.append(risks.get(level, []), find_blind(swept.only(p > level - 1e-3)))
        at_m = np.floor(np.concatenate([*risks.values()]) / AT_M + 1e-6) * AT_M
        stops, number = np.unique(at_m, return_inverse=True)
        worst = np.zeros(len(stops))
        np.maximum.at(worst, number, np.repeat([*risks], [len(at) for at in risks.values()]))
        return Clearance(stops, worst, room_m)

    def keep_to_seen(self, command: MotorCommand) -> tuple[Leg, MotorCommand | None]:
        """A move only as far as the floor is seen to be free; before it a look at what will be needed behind the leg.
        Before a door that may be shut it stops for a picture; where that does not tell, it halts once, so that the door
        is looked at from elsewhere before it is touched.

        Returns the leg and the command. That is None where something may stand in floor that is not seen, right before
        the robot.
        """
        leg, here, actuator = self._leg, self._here, self._robot.actuator
        look = self.choose_look()
        if look is not None:
            looking = replace(leg, looking_rad=look.heading_rad, looked_at=(
                *leg.looked_at, (here.x_m, here.y_m, look.heading_rad)))
            turned = plan_turn(look.heading_rad, here, actuator, MAX_LOOK_ERROR_RAD)
            if turned is not None:
                return looking, turned
        wanted_m = actuator.reach * command.move_m
        clearance = self.measure_clearance(wanted_m + MAX_BRAKING_M)
        if clearance.room_m < min(MIN_MOVE_M, wanted_m):
            return leg, self._lead_away() if self._touches else None
        doors = [(*pair, *NOT_TOUCHED) for pair in self._doubted]
        before_m = min(wanted_m, self._measure_to_m(doors, wanted_m + 2.0 * LOOK_BEFORE_M) - LOOK_BEFORE_M)
        if before_m < min(MIN_MOVE_M, wanted_m) and self._asks_for_look:
            return leg, None
        free_m, speed = choose_move(
            clearance, before_m if before_m >= MIN_MOVE_M else wanted_m, actuator,
            self._settings.creep_speed_m_per_s, LOOK_PICTURE_S)
        move_m = min(command.move_m, actuator.compute_command_m(free_m))
        return leg, MotorCommand(command.turn_rad, move_m, None if speed >= actuator.speed_m_per_s else speed)

    def _lead_away(self) -> MotorCommand | None:
        """A turn and a short move away from what was touched, as near as may be to the way; None: there is no room.

        So the next motion never repeats the one that ended in a touch, also where the model explains it.
        """
        here = self._here
        walls = shapely.boundary(self._floor)
        rim_m = min(self._robot.radius_m, shapely.distance(walls, shapely.Point(here.position)))
        for turn_rad in sorted(np.arange(-math.pi, math.pi, AWAY_STEP_RAD).tolist(), key=abs):
            heading_rad = self._ahead_rad + turn_rad
            there = here.x_m + AWAY_M * math.cos(heading_rad), here.y_m + AWAY_M * math.sin(heading_rad)
            aside = copy.copy(self)
            aside._ahead_rad = heading_rad
            if shapely.distance(walls, shapely.Point(there)) >= rim_m and aside._measure_room_m(AWAY_M) >= AWAY_M:
                turned_rad = wrap_angle(heading_rad - here.heading_rad)
                move_m = self._robot.actuator.compute_command_m(AWAY_M)
                return MotorCommand(turned_rad, move_m, self._settings.creep_speed_m_per_s)
        return None

    def _measure_room_m(self, way_m: float) -> float:
        """How far the robot can go straight ahead before its rim comes to what may stand there; 0..way.

        Along what was touched it does not go, but away from it.
        """
        touched = [pair for pair in self._suspected if pair[0].value.touched_s is not None]
        away = ((*pair, TOUCHED_GAP_M, TOUCHED_AWAY * STEP_M) for pair in (*touched, *self._touches))
        return self._measure_to_m([*((*pair, *NOT_TOUCHED) for pair in self._suspected), *away], way_m)

    def _measure_to_m(self, stands: Sequence[Standing], way_m: float) -> float:
        along, free_m = np.arange(0.0, way_m + STEP_M, STEP_M), way_m
        points = shapely.points(self._find_ahead(along))
        for entry, polygon, near_m, away_m in stands:
            gaps = shapely.distance(points, polygon)
            met = np.flatnonzero((gaps[1:] < self._robot.radius_m + near_m) & (gaps[1:] < gaps[:-1] + away_m))
            if len(met):
                free_m = min(free_m, float(along[met[0]]))
                self._reasons[entry.id] = entry
        return free_m

    def _find_ahead(self, along_m: Floats) -> Floats:
        """(n, 2) places so far straight ahead [m, world]."""
        ahead = np.array([math.cos(self._ahead_rad), math.sin(self._ahead_rad)])
        return np.asarray(self._here.position + along_m[:, None] * ahead)

    def choose_look(self) -> Lookout | None:
        """A look from here at floor that is needed behind the end of this leg, where it is the best place for that."""
        s, end = self._settings, (self._leg.x1_m, self._leg.y1_m)
        to_go_m = self._to_go_m
        if to_go_m > LOOK_FROM_M or not self._beyond or len(self._leg.looked_at) >= s.max_looks:
            return None
        swept = sample_sweep([end, *self._beyond], self._robot.radius_m + SEEN_MARGIN_M, LOOK_AHEAD_M)
        unseen = swept.only(self._tell(swept) >= 1.0)
        if len(unseen.points) == 0:
            return None
        slower_s_per_m = 1.0 / s.creep_speed_m_per_s - 1.0 / self._robot.actuator.speed_m_per_s
        look = choose_look(
            self._robot, self._floor, self._here, self._list_poses_ahead(to_go_m), unseen, slower_s_per_m)
        if look is None or self._was_tried(look.heading_rad):
            return None
        return look

    def _was_tried(self, heading_rad: float) -> bool:
        """Whether the robot has looked there already from about here."""
        return any(math.dist((x, y), self._here.position) < 0.3 and abs(wrap_angle(heading_rad - there)) < 0.4
                   for x, y, there in self._leg.looked_at)

    def _list_poses_ahead(self, to_go_m: float) -> list[Pose2]:
        """Where pictures will be taken on what is left of the leg, and at its end in the direction of the next."""
        leg, step_m = self._leg, self._robot.actuator.increment_m
        heading = math.atan2(leg.y1_m - self._here.y_m, leg.x1_m - self._here.x_m)
        count = max(1, math.ceil(to_go_m / step_m - 0.1))
        parts = [min(1.0, step_m * k / max(to_go_m, 1e-9)) for k in range(1, count + 1)]
        poses = [Pose2(self._here.x_m + part * (leg.x1_m - self._here.x_m),
                       self._here.y_m + part * (leg.y1_m - self._here.y_m), heading) for part in parts]
        x, y = self._beyond[0]
        return [*poses, Pose2(leg.x1_m, leg.y1_m, math.atan2(y - leg.y1_m, x - leg.x1_m))]

    def _sweep_ahead(self, most_m: float) -> Sweep:
        """What the robot sweeps straight ahead, but for what it stands on, which is free, and leaves behind."""
        here, there = self._find_ahead(np.array([0.0, most_m]))
        sweep = sample_sweep([here, there], self._robot.radius_m + SEEN_MARGIN_M, most_m)
        off = sweep.points - here
        return sweep.only((np.linalg.norm(off, axis=1) > self._robot.radius_m) & (off @ (there - here) > 0.0))

    def _tell(self, swept: Sweep) -> Floats:
        """How probably something stands on each cell of a sweep, but for those next to something that the model has."""
        p, asked = np.zeros(len(swept.points)), shapely.contains_xy(self._tested, *swept.points.T)
        told = self._map.ask(swept.points[asked])
        p[asked] = told.p
        reasons = [self._scans[k] for k in np.flatnonzero(told.sights)]
        reasons += [entry for k in np.flatnonzero(told.discs) for entry in self._discs[k].because]
        self._reasons.update((entry.id, entry) for entry in reasons)
        return p


def _list_what_may_stand(view: View) -> list[tuple[Entry[Obstacle], shapely.Polygon]]:
    """What the robot does not creep into."""
    found = view.where(Obstacle, lambda o: o.status != "gone")
    return [(entry, build_polygon(entry.value.footprint)) for entry in found]


def _list_touches(view: View, here: Pose2) -> list[tuple[Entry[Contact], shapely.Point]]:
    """Where something was touched on the last of the way, and is no obstacle: the model explains it, or may [world]."""
    known = {obstacle.value.touched_s for obstacle in view.all(Obstacle)}
    found = []
    for contact in list_touches(view):
        gone_m = math.fsum(report.value.move_m for report in view.since(MotionReport, contact.cycle)
                           if report.because != contact.because)
        if gone_m < TOUCH_HOLDS_M and contact.value.when_s not in known:
            found.append((contact, shapely.Point(here.apply(locate_contact(view, contact)))))
    return found


def find_swept_next(belief: Belief, leg: Leg, settings: ActionSettings) -> shapely.Geometry:
    """What the robot will sweep next on its leg [m, world]."""
    here = shapely.Point(belief.pose.position)
    way = shapely.LineString([here, (leg.x1_m, leg.y1_m)])
    return shapely.intersection(way, here.buffer(settings.act_within_m)).buffer(belief.robot.radius_m + SEEN_MARGIN_M)


class FreeDisc(NamedTuple):
    """Floor that is free without being seen.

    Attributes:
        circle: x, y, radius [m, world].
        because: what tells where it is, besides the belief.
    """

    circle: tuple[float, float, float]
    because: tuple[Entry[FreeFloor], ...] = ()


def list_free_discs(
    view: View, robot: RobotModel, here: Pose2, scans: Sequence[Entry[FreeFloor]]
) -> list[FreeDisc]:
    """What is free under the robot, where it has driven from look to look, and where it was put down."""
    radius_m = robot.radius_m
    step_m = 0.3 * radius_m  # so near to one another they leave no gap at the sides
    discs = [FreeDisc((here.x_m, here.y_m, radius_m + SEEN_MARGIN_M))]
    for pair in pairwise([entry for entry in scans if entry.value.sense == "camera"]):
        a, b = (entry.value for entry in pair)
        gap_m = math.dist((a.x_m, a.y_m), (b.x_m, b.y_m))
        if step_m < gap_m <= MAX_DRIVEN_GAP_M:
            parts = np.linspace(0.0, 1.0, math.ceil(gap_m / step_m) + 1).tolist()
            discs += [FreeDisc((a.x_m + part * (b.x_m - a.x_m), a.y_m + part * (b.y_m - a.y_m), radius_m), pair)
                      for part in parts]
    goal = active_goal(view)
    if goal is not None and goal.id == f"{Goal.__name__}-1" and view.latest(RideReport) is None:
        discs.append(_find_put_down(view, robot, goal.value))
    return discs


def _find_put_down(view: View, robot: RobotModel, goal: Goal) -> FreeDisc:
    """Round where the robot was put down: by the first picture, if it is still on the board, else by what was said."""
    first = view.get(f"{FreeFloor.__name__}-1")
    at = start = goal.origin.in_world(robot.world).position
    if first is not None and first.value.bearings_rad:
        eye, ahead = first.value, first.value.bearings_rad[len(first.value.bearings_rad) // 2]
        before_m = robot.mount.forward_m if eye.sense == "camera" else 0.0  # the robot's axis is behind its camera
        axis = np.array([eye.x_m, eye.y_m]) - before_m * np.array([math.cos(ahead), math.sin(ahead)])
        at = axis if math.dist(axis, start) <= MAX_DRIVEN_GAP_M else start
    return FreeDisc((float(at[0]), float(at[1]), PUT_DOWN_FREE_M), () if first is None else (first,))


def _find_scans(view: View, belief: Entry[Hypothesis], settings: ActionSettings) -> tuple[Entry[FreeFloor], ...]:
    """What the robot saw of the floor that it is on, the oldest first; only since it was last found, as it was seen
    from elsewhere before.
    """
    now_s = tell_time_s(view)
    ride, found = view.latest(RideReport), _find_last_search(view)
    since_s = max(now_s - settings.max_seen_age_s, -math.inf if ride is None else ride.value.sim_time_s)
    since = -1 if found is None else found.cycle
    return tuple(entry for entry in view.since(FreeFloor, since)
                 if entry.value.seen_s >= since_s and _is_of(entry, belief))


def _find_last_search(view: View) -> Entry[PlaceSearch] | None:
    """The search by which the robot was last found."""
    return view.latest(PlaceSearch, lambda search: search.status == "found")


def _is_of(scan: Entry[FreeFloor], belief: Entry[Hypothesis]) -> bool:
    """Whether a scan was placed by this belief, and not by one that was given up."""
    beliefs = [ref.id for ref in scan.because if ref.id.startswith(f"{Hypothesis.__name__}-")]
    return not beliefs or belief.id in beliefs


def tell_time_s(view: View) -> float:
    frame, report = view.latest(CameraPicture), view.latest(MotionReport)
    return max(0.0 if frame is None else frame.value.sim_time_s, 0.0 if report is None else report.value.sim_time_s)


def _find_way_beyond(view: View, robot: RobotModel) -> tuple[list[Point], set[str]]:
    """The way behind the current leg, as far as the sketches say, and the locales of both."""
    sketch = deepest_sketch(view)
    if sketch is None:
        return [], set()
    goal_sketches = {entry.value.path: entry.value for entry in view.where(
        PlanSketch, lambda s: s.is_active and s.goal == sketch.value.goal)}
    world = robot.world
    points: list[Point] = []
    locales: set[str] = set()
    current = sketch.value.current
    if current is not None:
        locales |= {current.origin.locale, current.destination.locale}
    path = sketch.value.path
    while path in goal_sketches:
        level = goal_sketches[path]
        for subgoal in level.subgoals[level.at + 1:]:
            if subgoal.is_ride or len(points) >= 3:
                return points, locales
            there = subgoal.destination.in_world(world)
            points.append((there.x_m, there.y_m))
            locales |= {subgoal.origin.locale, subgoal.destination.locale}
        if not path:
            break
        path = path[:-1]
    return points, locales
