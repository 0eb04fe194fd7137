"""Far views: where a robot that may be in one of several places can drive to see which of them it is in (§2).

All coordinates are in the robot's frame now, in metres. There the places are one place; what is free whichever of them
is true is their common floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import networkx as nx
import numpy as np
import shapely
from shapely import affinity

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor.lookout import find_floor
from knowledge_sources.methods.localization.hypotheses import PoseHypothesis, PredictView, are_distinguishable
from knowledge_sources.methods.localization.next_view import SensingAction, compute_separation
from knowledge_sources.methods.motion.routes import SLACK_M, find_bends
from knowledge_sources.settings import DEFAULT, Settings
from world_models.building.building import Building
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

MAX_FLOORS = 4
"""Size of the cache of floors, one for each set of rooms."""


class _Way(NamedTuple):
    """A way over the common floor: its length, and its points after the first, which is here."""

    length_m: float
    points: Floats


def choose_far_action(
    robot: RobotModel, hypotheses: Sequence[PoseHypothesis], looked: Sequence[Pose2], rooms: Sequence[str],
    predict: PredictView, settings: Settings = DEFAULT,
) -> SensingAction | None:
    """Choose the first leg of the shortest way to a view that tells two hypotheses apart; None where there is none.

    Args:
        hypotheses: the likeliest first; the way is free floor whichever of them is true.
        looked: poses of the views so far: what they did not tell they will not tell.
        rooms: of the floor.
        predict: the lines that should be visible from a pose, world.
    """
    tuning = settings.localization
    free = find_common_floor(robot, hypotheses, rooms, settings)
    compared = hypotheses[:tuning.far_hypotheses]
    weights = [h.weight for h in compared]
    for way in _list_ways(free, tuning.far_step_m):
        x_m, y_m = way.points[-1].tolist()
        arriving = _find_last_heading(way)
        for turn in (0.0, 0.5 * math.pi, -0.5 * math.pi, math.pi):
            look = Pose2(x_m, y_m, wrap_angle(arriving + turn))
            if _was_looked(look, looked, settings):
                continue
            views = [predict(h.world_from_robot @ look) for h in compared]
            if any(are_distinguishable([one], [other], settings, clearly=tuning.clear_difference)
                   for one, other in combinations(views, 2)):
                return _begin(way, look, compute_separation(views, weights, settings), settings)
    return None


def find_common_floor(
    robot: RobotModel, hypotheses: Sequence[PoseHypothesis], rooms: Sequence[str], settings: Settings = DEFAULT
) -> shapely.Geometry:
    """Find where the robot's centre may be, in its frame now, whichever hypothesis is true: the part that is here.

    Empty where the robot stands too near something in one of them.
    """
    tuning, building = settings.localization, robot.world
    clearance_m = robot.radius_m + tuning.move_clearance_m
    whole = building.cached("floors for the robot's centre", MAX_FLOORS, (tuple(rooms), clearance_m),
                            lambda: _shrink(building, rooms, clearance_m, tuning.far_coarse_m))
    common: shapely.Geometry = shapely.Point(0.0, 0.0).buffer(tuning.far_reach_m)
    for hypothesis in hypotheses:
        pose = hypothesis.world_from_robot
        near = shapely.intersection(whole, shapely.Point(pose.position).buffer(tuning.far_reach_m))
        here = pose.inverse()
        c, s = math.cos(here.heading_rad), math.sin(here.heading_rad)
        common = shapely.intersection(common, affinity.affine_transform(near, [c, -s, s, c, here.x_m, here.y_m]))
    at = shapely.Point(0.0, 0.0)
    return next((part for part in shapely.get_parts(common) if part.distance(at) <= SLACK_M), shapely.Polygon())


def _shrink(building: Building, rooms: Sequence[str], clearance_m: float, coarse_m: float) -> shapely.Geometry:
    """The floor on which the robot's centre may be, with few corners."""
    return shapely.buffer(find_floor(building, rooms), -clearance_m, join_style="mitre").simplify(coarse_m)


def _list_ways(free: shapely.Geometry, step_m: float) -> Iterator[_Way]:
    """The shortest ways to points on a grid over the free floor, the shortest first (visibility graph, Dijkstra)."""
    if free.is_empty:
        return
    yield _Way(0.0, np.zeros((1, 2)))
    low, high = np.ceil(np.divide(free.bounds[:2], step_m)), np.floor(np.divide(free.bounds[2:], step_m))
    axes = (np.arange(a, b + 1.0) * step_m for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    grid = grid[shapely.contains_xy(free, grid) & (np.linalg.norm(grid, axis=1) > 0.5 * step_m)]
    inner = np.concatenate([np.zeros((1, 2)), find_bends(free)])
    nodes = np.concatenate([inner, grid])
    first, second = np.triu_indices(len(inner), 1)
    grid_pairs = np.indices((len(inner), len(grid))).reshape(2, -1) + np.array([[0], [len(inner)]])
    pairs = np.column_stack([np.concatenate([first, grid_pairs[0]]), np.concatenate([second, grid_pairs[1]])])
    slack = free.buffer(SLACK_M)
    shapely.prepare(slack)
    pairs = pairs[shapely.covers(slack, shapely.linestrings(nodes[pairs]))]
    graph: nx.Graph = nx.Graph()
    lengths = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    graph.add_weighted_edges_from(zip(*pairs.T.tolist(), lengths.tolist(), strict=True))
    if 0 not in graph:
        return
    away, routes = nx.single_source_dijkstra(graph, 0)
    for node in sorted((k for k in away if k >= len(inner)), key=lambda k: (away[k], k)):
        yield _Way(float(away[node]), nodes[routes[node][1:]])


def _find_last_heading(way: _Way) -> float:
    """The direction in which the last part of a way leads [rad]; ahead where there is none."""
    leg = way.points[-1] - (way.points[-2] if len(way.points) > 1 else np.zeros(2))
    return math.atan2(float(leg[1]), float(leg[0]))


def _was_looked(look: Pose2, looked: Sequence[Pose2], settings: Settings) -> bool:
    """Whether a view like this was taken."""
    tuning = settings.localization
    return any(look.distance_to(old) < 0.5 * tuning.move_m
               and abs(wrap_angle(look.heading_rad - old.heading_rad)) < tuning.min_new_view_rad for old in looked)


def _begin(way: _Way, look: Pose2, separation: float, settings: Settings) -> SensingAction:
    """The first leg of a way, or the turn to the look where it ends."""
    tuning = settings.localization
    if way.length_m < tuning.far_arrived_m:
        return SensingAction(look.heading_rad, 0.0, separation)
    first = next(p for p in way.points if float(np.linalg.norm(p)) > 0.5 * tuning.far_arrived_m)
    move_m = min(float(np.linalg.norm(first)), tuning.far_leg_m)
    return SensingAction(math.atan2(float(first[1]), float(first[0])), move_m, separation)
