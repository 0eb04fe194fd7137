"""Active localization: which view tells the pose hypotheses apart, near by or at the end of a way.

Tried first are turns and short moves. Where none of them tells, the robot drives to the nearest view that would, on
floor that is free whichever hypothesis is true.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, islice
from typing import NamedTuple

import numpy as np
import shapely
from shapely import affinity

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor import find_floor
from knowledge_sources.methods.motion import (
    SLACK_M,
    find_bends,
    find_free_space,
    is_clear,
    list_shortest_routes,
)
from knowledge_sources.methods.verification import compute_coverage, predict_lines
from world_models.building.building import Building
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

SAME_LINE_PX = 8.0  # distance up to which lines of two predicted views are the same, as precise as poses are
SAME_LINE_RAD = 0.12  # angle up to which lines of two predicted views are the same
MIN_COMPARED_LENGTH_PX = 20.0  # shortest line by which predicted views are compared
MIN_DIFFERENT_LINES = 3.0  # lines in which two predicted views must differ to be distinct
MIN_DIFFERENT_FRACTION = 0.15  # part of their lines in which two predicted views must differ to be distinct
MAX_DIFFERENT_LINES = 20  # lines from which a larger difference separates hypotheses no better
UNKNOWN_WEIGHT = 0.1  # weight of poses that no hypothesis covers
TURNS_RAD = tuple(math.radians(a) for a in (180.0, 90.0, -90.0, 135.0, -135.0, 45.0, -45.0))
"""Turns on the spot that are tried; of equals the first is taken."""
TURNS_BEFORE_MOVE_RAD = tuple(math.radians(a) for a in (0.0, 90.0, -90.0, 180.0))  # turns that are tried before a move
MOVE_M = 0.6  # length of a move to another view
MOVE_CLEARANCE_M = 0.1  # clearance of a move beyond the robot's radius, from every hypothesis
MIN_NEW_VIEW_RAD = math.radians(30.0)  # angle from earlier views from which a view at the same position is new
CLEAR_DIFFERENCE = 2.0  # times as many lines as are needed, by which one or two views alone tell places apart
FAR_REACH_M = 12.0  # how far away a view that tells places apart is looked for
FAR_STEP_M = 1.0  # grid of the positions of such views
FAR_LEG_M = 1.2  # longest move on the way there; then another look is taken
FAR_ARRIVED_M = 0.15  # distance from such a position from which the robot only turns
FAR_COARSE_M = 0.03  # to this the free floor's outline is simplified
TOUCHED_PART = 0.95  # of the robot's radius that it keeps from what it touched: it stands at one radius from it
MIN_FAR_PART = 0.02  # of the likeliest's weight that such a place has at least: what tells of others is no news
MAX_FAR_LOOKS = 240  # most looks there that one search compares, the nearest first
FAR_HYPOTHESES = 3  # most places, the likeliest, that a far view is to tell apart

PredictView = Callable[[Pose2], Floats]
"""Returns the lines (n, 2, 2) that should be visible from a pose [px]."""


@dataclass(frozen=True, slots=True)
class PoseHypothesis:
    """A pose in a room, and its weight among the hypotheses (they sum to one)."""

    room: str
    world_from_robot: Pose2
    weight: float


def normalize_log_likelihoods(log_likelihoods: Sequence[float]) -> tuple[float, ...]:
    """Turn log likelihoods into weights that sum to one (softmax)."""
    if not log_likelihoods:
        return ()
    best = max(log_likelihoods)
    parts = [math.exp(value - best) for value in log_likelihoods]
    total = math.fsum(parts)
    return tuple(part / total for part in parts)


def make_view_predictor(robot: RobotModel) -> PredictView:
    """Return a function that predicts the long and clear lines visible from a pose."""
    def predict(pose: Pose2) -> Floats:
        lines = predict_lines(robot, pose).segments_px
        length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
        return np.asarray(lines[length >= MIN_COMPARED_LENGTH_PX])

    return predict


def compute_view_difference(one: Floats, other: Floats) -> float:
    """Compute by how many lines two views (n, 2, 2) and (m, 2, 2) differ: those of either that the other lacks."""
    return math.fsum(_count_missing(a, b) for a, b in ((one, other), (other, one)))


def are_distinguishable(ones: Sequence[Floats], others: Sequence[Floats], *, clearly: float = 1.0) -> bool:
    """Whether the views from one pose differ from those from another: all of them together, or one or two clearly.

    A few lines always differ: those just long, near or clear enough to be predicted from one pose only. Of many views
    that are alike and one that is not, all together are alike; so the one or two that differ most count by themselves.

    Args:
        clearly: by how many times as much as is needed they are to differ.
    """
    differ = [compute_view_difference(one, other) for one, other in zip(ones, others, strict=True)]
    lines = [len(one) + len(other) for one, other in zip(ones, others, strict=True)]
    most = sorted(range(len(differ)), key=lambda k: -differ[k])
    clear = CLEAR_DIFFERENCE
    return _is_difference(differ, lines, clearly) or any(
        _is_difference([differ[k] for k in most[:n]], [lines[k] for k in most[:n]], clear) for n in (1, 2))


def _is_difference(differ: Sequence[float], lines: Sequence[int], clearly: float) -> bool:
    least = max(MIN_DIFFERENT_LINES, MIN_DIFFERENT_FRACTION * math.fsum(lines))
    return math.fsum(differ) >= clearly * least


def _count_missing(one: Floats, other: Floats) -> float:
    """Number of lines of a view that are not in another; a line that is half there counts half."""
    covered = compute_coverage(one, other, SAME_LINE_PX, SAME_LINE_RAD)
    return float(np.sum(1.0 - np.nan_to_num(covered)))


HERE = Pose2(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class SensingAction:
    """A turn, then a move, then a look.

    Attributes:
        turn_rad, move_m: the motion.
        expected_separation: lines by which the new view is expected to separate the hypotheses.
    """

    turn_rad: float
    move_m: float
    expected_separation: float

    def apply_to(self, pose: Pose2) -> Pose2:
        """Where the motion leads."""
        return pose @ Pose2(0.0, 0.0, self.turn_rad) @ Pose2(self.move_m, 0.0, 0.0)


IsSafe = Callable[[PoseHypothesis, SensingAction], bool]
"""Whether an action's move is free of collisions if a hypothesis is true."""


def choose_sensing_action(
    hypotheses: Sequence[PoseHypothesis], looked: Sequence[Pose2], predict: PredictView, is_safe: IsSafe,
) -> SensingAction | None:
    """Choose the action with the largest expected separation; None where no action shows anything new.

    Args:
        looked: poses of the views so far, in the robot's frame now.
        is_safe: a move must be safe from every hypothesis.
    """
    options = [o for o in _list_actions(looked)
               if o.move_m == 0.0 or all(is_safe(hypothesis, o) for hypothesis in hypotheses)]
    weights = [hypothesis.weight for hypothesis in hypotheses]
    rated = []
    for option in options:
        views = [predict(option.apply_to(hypothesis.world_from_robot)) for hypothesis in hypotheses]
        rated.append(SensingAction(option.turn_rad, option.move_m, compute_separation(views, weights)))
    return max(rated, key=lambda action: action.expected_separation, default=None)  # of equals the first


def compute_separation(views: Sequence[Floats], weights: Sequence[float]) -> float:
    """Compute the expected number of lines by which a look separates hypotheses with these views.

    Sum over pairs by their weights, and of each hypothesis against the poses that none covers.
    """
    terms = []
    for i, one in enumerate(views):
        terms.append(weights[i] * UNKNOWN_WEIGHT * min(len(one), MAX_DIFFERENT_LINES))
        terms += [weights[i] * weights[j]
                  * min(compute_view_difference(one, views[j]), MAX_DIFFERENT_LINES)
                  for j in range(i)]
    return math.fsum(terms)


def can_distinguish(
    one: PoseHypothesis, other: PoseHypothesis, looked: Sequence[Pose2], predict: PredictView, is_safe: IsSafe,
) -> bool:
    """Whether any look within reach, or one that was taken, would tell two hypotheses apart."""
    a, b = one.world_from_robot, other.world_from_robot
    reach = [option.apply_to(HERE) for option in _list_actions(())
             if option.move_m == 0.0 or (is_safe(one, option) and is_safe(other, option))]
    return any(are_distinguishable([predict(a @ step)], [predict(b @ step)]) for step in (*looked, *reach))


def make_safety_check(robot: RobotModel, touched: Sequence[Floats] = ()) -> IsSafe:
    """Return a check whether an action's move keeps free of the walls and things of the hypothesis's room.

    And of what was ``touched``, whatever it is: points (2,) [m] in the robot's frame now.
    """
    clearance_m = robot.radius_m + MOVE_CLEARANCE_M

    def is_safe(hypothesis: PoseHypothesis, action: SensingAction) -> bool:
        if any(_leads_to(action, point, clearance_m) for point in touched):
            return False
        free, pose = find_free_space(robot.world, hypothesis.room, clearance_m), hypothesis.world_from_robot
        return is_clear(free, pose.position, action.apply_to(pose).position)

    return is_safe


def _leads_to(action: SensingAction, point: Floats, clearance_m: float) -> bool:
    """Whether a move comes nearer than a clearance to a point (2,) that lies ahead of it [m, the robot's frame]."""
    ahead_m, aside_m = Pose2(0.0, 0.0, -action.turn_rad).apply(point)
    return action.move_m > 0.0 and 0.0 < ahead_m < action.move_m + clearance_m and abs(aside_m) < clearance_m


def find_widest_gap(looked: Sequence[Pose2]) -> float:
    """Return the turn to the middle of the widest sector that no view has shown [rad]."""
    angles = sorted(wrap_angle(look.heading_rad) for look in looked)
    if not angles:
        return 0.0
    gaps = [(b - a, a) for a, b in zip(angles, [*angles[1:], angles[0] + 2.0 * math.pi], strict=True)]
    width, start = max(gaps, key=lambda gap: gap[0])
    return wrap_angle(start + 0.5 * width)


def _list_actions(looked: Sequence[Pose2]) -> list[SensingAction]:
    """The turns that show something new from here, and the moves."""
    move = MOVE_M
    here = [look.heading_rad for look in looked if math.hypot(look.x_m, look.y_m) < 0.5 * move]
    turns = [turn for turn in TURNS_RAD
             if all(abs(wrap_angle(turn - h)) >= MIN_NEW_VIEW_RAD for h in here)]
    moves = [SensingAction(turn, move, 0.0) for turn in TURNS_BEFORE_MOVE_RAD]
    return [*(SensingAction(turn, 0.0, 0.0) for turn in turns), *moves]


MAX_FLOORS = 4
"""Size of the cache of floors, one for each set of rooms."""


class _Way(NamedTuple):
    """A way over the common floor: its length, and its points after the first, which is here."""

    length_m: float
    points: Floats


def choose_far_action(
    robot: RobotModel, hypotheses: Sequence[PoseHypothesis], looked: Sequence[Pose2], rooms: Sequence[str],
    predict: PredictView, touched: Sequence[Floats] = (),
) -> SensingAction | None:
    """Choose the first leg of the shortest way to a view that tells two hypotheses apart; None where there is none.

    Args:
        hypotheses: the likeliest first; the way is free floor whichever of them is true.
        looked: poses of the views so far: what they did not tell they will not tell.
        rooms: of the floor.
        predict: the lines that should be visible from a pose, world.
        touched: where something was touched, (2,) [m] in the robot's frame now; the way keeps off it.
    """
    free = find_common_floor(robot, hypotheses, rooms)
    if touched and not free.is_empty:
        free = _keep_off(free, touched, robot.radius_m)
    compared = [h for h in hypotheses[:FAR_HYPOTHESES] if h.weight >= MIN_FAR_PART * hypotheses[0].weight]
    weights = [h.weight for h in compared]
    for way, look in islice(_list_far_looks(free, looked), MAX_FAR_LOOKS):
        views = [predict(h.world_from_robot @ look) for h in compared]
        if any(are_distinguishable([one], [other], clearly=CLEAR_DIFFERENCE)
               for one, other in combinations(views, 2)):
            return _begin(way, look, compute_separation(views, weights))
    return None


def _list_far_looks(free: shapely.Geometry, looked: Sequence[Pose2]) -> Iterator[tuple[_Way, Pose2]]:
    """The ways over the free floor with the new looks at their ends, the nearest first."""
    for way in _list_ways(free, FAR_STEP_M):
        x_m, y_m = way.points[-1].tolist()
        for turn in (0.0, 0.5 * math.pi, -0.5 * math.pi, math.pi):
            look = Pose2(x_m, y_m, wrap_angle(_find_last_heading(way) + turn))
            if not _was_looked(look, looked):
                yield way, look


def find_common_floor(
    robot: RobotModel, hypotheses: Sequence[PoseHypothesis], rooms: Sequence[str]
) -> shapely.Geometry:
    """Find where the robot's centre may be, in its frame now, whichever hypothesis is true: the part that is here.

    Empty where the robot stands too near something in one of them.
    """
    building = robot.world
    clearance_m = robot.radius_m + MOVE_CLEARANCE_M
    whole = building.cached("floors for the robot's centre", MAX_FLOORS, (tuple(rooms), clearance_m),
                            lambda: _shrink(building, rooms, clearance_m, FAR_COARSE_M))
    common: shapely.Geometry = shapely.Point(0.0, 0.0).buffer(FAR_REACH_M)
    for hypothesis in hypotheses:
        pose = hypothesis.world_from_robot
        near = shapely.intersection(whole, shapely.Point(pose.position).buffer(FAR_REACH_M))
        here = pose.inverse()
        c, s = math.cos(here.heading_rad), math.sin(here.heading_rad)
        common = shapely.intersection(common, affinity.affine_transform(near, [c, -s, s, c, here.x_m, here.y_m]))
    at = shapely.Point(0.0, 0.0)
    return next((part for part in shapely.get_parts(common) if part.distance(at) <= SLACK_M), shapely.Polygon())


def _keep_off(free: shapely.Geometry, touched: Sequence[Floats], radius_m: float) -> shapely.Geometry:
    """Free floor without where the robot's rim would reach a touched point; the part where it stands."""
    off = shapely.unary_union([shapely.Point(point).buffer(TOUCHED_PART * radius_m) for point in touched])
    left, at = shapely.difference(free, off), shapely.Point(0.0, 0.0)
    return next((part for part in shapely.get_parts(left) if part.distance(at) <= SLACK_M), shapely.Polygon())


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
    lengths = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    routes = ((length_m, route) for length_m, route in list_shortest_routes(pairs, lengths) if route[-1] >= len(inner))
    for length_m, route in sorted(routes, key=lambda found: (found[0], found[1][-1])):
        yield _Way(length_m, nodes[route[1:]])


def _find_last_heading(way: _Way) -> float:
    """The direction in which the last part of a way leads [rad]; ahead where there is none."""
    leg = way.points[-1] - (way.points[-2] if len(way.points) > 1 else np.zeros(2))
    return math.atan2(float(leg[1]), float(leg[0]))


def _was_looked(look: Pose2, looked: Sequence[Pose2]) -> bool:
    """Whether a view like this was taken."""
    return any(look.distance_to(old) < 0.5 * MOVE_M
               and abs(wrap_angle(look.heading_rad - old.heading_rad)) < MIN_NEW_VIEW_RAD for old in looked)


def _begin(way: _Way, look: Pose2, separation: float) -> SensingAction:
    """The first leg of a way, or the turn to the look where it ends."""
    if way.length_m < FAR_ARRIVED_M:
        return SensingAction(look.heading_rad, 0.0, separation)
    first = next(p for p in way.points if float(np.linalg.norm(p)) > 0.5 * FAR_ARRIVED_M)
    move_m = min(float(np.linalg.norm(first)), FAR_LEG_M)
    return SensingAction(math.atan2(float(first[1]), float(first[0])), move_m, separation)
