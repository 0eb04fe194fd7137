"""What the knowledge sources of plan sketches have in common: a planner round obstacles, the sketches of a goal."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np
import shapely

from blackboard import Effect, Entry, Revise, View
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import to_log_odds
from knowledge_sources.methods.floor import build_polygon
from knowledge_sources.methods.motion import SubgoalPlanner
from knowledge_sources.methods.verification import MIN_MATCHED_LINES
from knowledge_sources.reads.questions import find_building, find_frames, find_robot
from knowledge_sources.settings import PlanSettings
from world_models import words
from world_models.entries import (
    Certificate,
    DoorState,
    Goal,
    Hypothesis,
    Impasse,
    Milestone,
    Obstacle,
    Place,
    PlanSketch,
    SketchStatus,
    Subgoal,
)
from world_models.frames import wrap_angle

MAX_ADJUSTMENTS = 8  # so often a sketch is adjusted at one milestone; then adjusting has failed
GOAL_TOLERANCE_M = 0.010  # tolerance at the goal
GOAL_HEADING_TOLERANCE_RAD = 0.02  # tolerance of a heading that the goal states
INEXACT_TOLERANCE_SIGMAS = 2.0
"""Deviations of the belief that are added to the tolerance of a goal where the model is inexact."""

MAX_LOOK_LOG_ODDS = 3.0  # most that one look counts for or against a place, in log odds, with those in other directions
MAX_LOOK_ERROR_RAD = math.radians(3.5)  # the robot faces a milestone when its heading is off by no more than this

Way = tuple[Subgoal, ...]


def find_planner(view: View, settings: PlanSettings) -> SubgoalPlanner:
    """It plans round what stands in the way; the robot drives only into what it then sees to be free."""
    return SubgoalPlanner(find_robot(view), settings, [entry.value for entry in find_obstacles(view)])


def plan_door_look(view: View, planner: SubgoalPlanner, belief: Hypothesis, door: DoorState) -> Subgoal | None:
    """To where a door of this room is seen from the front, and from where it was not seen yet; None: nowhere."""
    (frame,) = find_frames(view, {belief.locale})
    doorway = next((d for d in frame.value.doorways if d.name == door.door), None)
    seen_from = [np.array([picture.x_m, picture.y_m]) for picture in (*door.views, door.last)]
    return None if doorway is None else planner.plan_door_look(belief, doorway, seen_from)


def list_lookouts(view: View, goal: str) -> Floats:
    """Where the robot went to look again at what left no way to a goal, each time: (n, 2) [m, world]."""
    closed = view.where(Impasse, lambda impasse: impasse.goal == goal and not impasse.is_open)
    return np.array([entry.value.lookout for entry in closed]).reshape(-1, 2)


def find_way_to_goal(planner: SubgoalPlanner, belief: Hypothesis, goal: Goal) -> Way | None:
    """From locale to locale, from where the robot believes to be."""
    return planner.plan_between_locales(place_of(belief), goal.destination, GOAL_TOLERANCE_M)


def find_obstacles(view: View, locales: Collection[str] | None = None) -> tuple[Entry[Obstacle], ...]:
    """What stands in the way in some locales, or in any, and is not in the file."""
    return view.where(Obstacle, lambda o: o.is_there and (locales is None or o.locale in locales))


def name_obstacles(obstacles: Sequence[Entry[Obstacle]]) -> str:
    return f"; blocked by {' and '.join(entry.value.words() for entry in obstacles)}" if obstacles else ""


def list_locales(subgoals: Iterable[Subgoal]) -> set[str]:
    """The locales through which subgoals lead."""
    return {place.locale for subgoal in subgoals for place in (subgoal.origin, subgoal.destination)}


def place_of(belief: Hypothesis) -> Place:
    """The believed place, without a heading."""
    return Place(belief.locale, belief.locale_from_robot.x_m, belief.locale_from_robot.y_m)


def is_just_found(belief: Hypothesis) -> bool:
    """Whether the robot stands where a search has just found it: there the milestone that a sketch begins with holds.

    The looks of the search are its evidence; the same question put again at the same place would count them twice.
    """
    return belief.basis == "relocalization"


def supersede(view: View, because: Entry[object], status: SketchStatus = "superseded") -> Iterable[Effect]:
    """All active sketches end, before another one is drawn."""
    for old in view.where(PlanSketch, lambda s: s.is_active):
        yield Revise(old, replace(old.value, status=status), (because,))


def find_first_level(view: View) -> Entry[PlanSketch] | None:
    """The active sketch that leads from locale to locale."""
    return view.latest(PlanSketch, lambda s: s.is_active and not s.path)


def has_missed(view: View, belief: Hypothesis, sketch: PlanSketch, *, is_inexact: bool) -> bool:
    """Whether the end of the subgoal before a milestone is further than its tolerance.

    A model that is inexact makes it wider. From a lookout the robot has looked when it came there: it may turn since.
    """
    if sketch.at == 0:
        return False
    subgoal, building = sketch.subgoals[sketch.at - 1], find_building(view)
    here, there = belief.world_from_robot(building), subgoal.destination.in_world(building)
    heading = None if _is_of_look(view, sketch) else subgoal.destination.heading_rad
    error = 0.0 if heading is None else wrap_angle(here.heading_rad - there.heading_rad)
    wider_m = INEXACT_TOLERANCE_SIGMAS * belief.sigma_m if is_inexact else 0.0
    is_off = here.distance_to(there) > math.hypot(subgoal.tolerance_m, wider_m)
    return is_off or abs(error) > GOAL_HEADING_TOLERANCE_RAD


def _is_of_look(view: View, sketch: PlanSketch) -> bool:
    """Whether a sketch leads to a lookout, itself or as a part of one that does."""
    first = find_first_level(view)
    return sketch.is_look or (first is not None and first.value.is_look)


def tell_missed(
    view: View, belief: Hypothesis, sketch: PlanSketch
) -> tuple[str, tuple[Entry[Obstacle], ...]]:
    """What was tried so often, how far from it the last try ended, and what may stand there; and that itself.
    """
    there, then = sketch.subgoals[sketch.at - 1].destination, sketch.current
    building, robot = find_building(view), find_robot(view)
    at = there.in_world(building)
    off_m, rim = belief.world_from_robot(building).distance_to(at), shapely.Point(at.position).buffer(robot.radius_m)
    is_goal = then is None and not sketch.path and not sketch.is_look
    what = "the goal" if is_goal else "the way"
    if then is not None and then.is_ride:
        what = f"the elevator {then.passage}"
    taking = view.where(Obstacle, lambda o: o.status != "gone" and build_polygon(o.footprint).intersects(rim))
    occupied = f"; it is occupied by {' and '.join(o.value.words() for o in taking)}" if taking else ""
    tries, last = words.count(sketch.adjustments + 1, "try", "tries"), f"the last ended {words.metres(off_m)} from it"
    return f"{what} at {there} was not reached in {tries}: {last}{occupied}", taking


def find_tried(view: View, is_same: Callable[[Entry[Milestone]], bool]) -> tuple[float, ...]:
    """The headings in which the last milestone, if it is the same one, was not testable."""
    last = view.latest(Milestone)
    if last is None or last.value.status != "not testable" or not is_same(last):
        return ()
    return (*last.value.tried, last.value.look_heading_rad)


def find_car(sketch: PlanSketch, index: int) -> str:
    """The elevator's car in which a ride before a milestone ends, or "": it looks the same on every floor."""
    before = sketch.subgoals[index - 1] if index > 0 else None
    return before.destination.locale if before is not None and before.is_ride else ""


def find_car_of(view: View, milestone: Milestone) -> str:
    """The same for a milestone of any sketch, or of none."""
    sketch = view.get(milestone.sketch)
    return "" if sketch is None else find_car(sketch.value, milestone.index)


def list_log_odds(view: View, milestone: Milestone) -> tuple[float, ...]:
    """The log odds of a wrong place by each view that was tried for a milestone; 0 where it showed nothing."""
    last, certificate = view.latest(Milestone), view.latest(Certificate)
    if not milestone.tried or last is None or certificate is None or certificate.value.milestone != last.id:
        return (0.0,) * len(milestone.tried)
    c, most = certificate.value, MAX_LOOK_LOG_ODDS
    tells = c.matched >= MIN_MATCHED_LINES
    return (*last.value.log_odds_so_far, min(max(to_log_odds(c.p_false), -most), most) if tells else 0.0)
