"""What is left of a sketch, compared with what has changed on its way."""

from __future__ import annotations

import shapely

from knowledge_sources.methods.floor import build_polygon, measure_approach_m
from knowledge_sources.methods.motion.subgoals import CLEARANCES_M
from world_models.building.locale_frame import LocaleFrame
from world_models.entries import Obstacle, PlanSketch
from world_models.frames import Pose2
from world_models.robot import RobotModel

LEG_SLACK_M = 0.03  # an obstacle that is nearer to a leg than the least clearance by so much blocks it


def meets(sketch: PlanSketch, obstacle: Obstacle, here: Pose2, robot: RobotModel) -> bool:
    """Whether what is left of a sketch leads against an obstacle that is there, or round one that is gone.

    Args:
        here: the robot's pose [world].
    """
    world, footprint, at = robot.world, build_polygon(obstacle.footprint), shapely.Point(here.position)
    clearance_m = CLEARANCES_M[-1] if obstacle.is_there else CLEARANCES_M[0]
    reach_m = robot.radius_m + clearance_m + (-LEG_SLACK_M if obstacle.is_there else LEG_SLACK_M)
    for index, subgoal in enumerate(sketch.subgoals[sketch.at:]):
        if obstacle.locale not in (subgoal.origin.locale, subgoal.destination.locale):
            continue
        start, end = (shapely.Point(p.in_world(world).position) for p in (subgoal.origin, subgoal.destination))
        if obstacle.is_there and obstacle.touched_s == obstacle.seen_s:
            return True  # the robot stands at it
        if not obstacle.is_there:
            near_m = min(start.distance(footprint), end.distance(footprint))
        elif subgoal.primitive:
            near_m = measure_approach_m(shapely.LineString([at if index == 0 else start, end]), footprint, reach_m)
        else:
            near_m = end.distance(footprint)
        if near_m < reach_m:
            return True
    return False


def leads_through(sketch: PlanSketch, frame: LocaleFrame) -> bool:
    """Whether what is left of a sketch passes through a door that is shut, or across a room that has changed."""
    left = sketch.subgoals[sketch.at:]
    shut = {doorway.name for doorway in frame.shut_doorways}
    if any(subgoal.passage in shut for subgoal in left):
        return True
    crosses = any(frame.name in (subgoal.origin.locale, subgoal.destination.locale) for subgoal in left)
    is_rearranged = not frame.changes or any(change.what in ("gone", "extra") for change in frame.changes)
    return crosses and is_rearranged
