"""Laws of the way to a view that tells places apart: it is free whichever is true, and its end tells."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.generated.floors import Floor, generated_floor
from knowledge_sources.methods.localization import MAX_SEARCHED_VIEWS, next_view
from knowledge_sources.methods.localization.next_view import (
    PoseHypothesis,
    PredictView,
    are_distinguishable,
    choose_far_action,
    find_common_floor,
    make_view_predictor,
)
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

CAMERA, MOUNT = Camera.from_field_of_view(math.radians(65.0)), CameraMount(1.0, 0.1)
HERE = Pose2(0.0, 0.0, 0.0)
SYMMETRIC = generated_floor(11, 4, symmetric=True)


@lru_cache(maxsize=4)
def robot_on(seed: int) -> tuple[Floor, RobotModel]:
    floor = SYMMETRIC if seed == 11 else generated_floor(seed, 6)
    return floor, RobotModel(floor.world, CAMERA, MOUNT, ActuatorModel())


def draw_places(robot: RobotModel, seed: int, count: int) -> list[PoseHypothesis]:
    """Places in rooms, clear of walls and things."""
    rng, found = np.random.default_rng(seed), list[PoseHypothesis]()
    rooms = list(robot.world.rooms)
    while len(found) < count:
        room = str(rng.choice(rooms))
        low, high = robot.world.outline(room).min(axis=0), robot.world.outline(room).max(axis=0)
        x, y = rng.uniform(low, high)
        body = shapely.Point(x, y).buffer(robot.radius_m + next_view.MOVE_CLEARANCE_M + 2.0 * next_view.FAR_COARSE_M)
        if shapely.Polygon(robot.world.outline(room)).covers(body) and not any(
                shapely.Polygon(o).intersects(body) for o in robot.world.obstacles(room)):
            pose = Pose2(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))
            found.append(PoseHypothesis(room, pose, 1.0 / count))
    return found


def is_solid(robot: RobotModel, pose: Pose2, margin_m: float) -> bool:
    """Whether a robot that stands there would be in something, by the raw outlines and things."""
    body = shapely.Point(pose.position).buffer(robot.radius_m - margin_m)
    rooms = [shapely.Polygon(robot.world.outline(name)) for name in robot.world.rooms]
    doors = [shapely.MultiPoint(np.concatenate(d.thresholds_world)).convex_hull.buffer(0.02)
             for name in robot.world.rooms for d in robot.world.doorways_of(name)]
    things = [shapely.Polygon(o) for name in robot.world.rooms for o in robot.world.obstacles(name)]
    return not shapely.union_all([*rooms, *doors]).covers(body) or any(thing.intersects(body) for thing in things)


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), floor=st.integers(0, 2), count=st.integers(1, 3))
def test_the_common_floor_is_free_in_every_place(seed: int, floor: int, count: int) -> None:
    _, robot = robot_on(floor)
    places = draw_places(robot, seed, count)
    free = find_common_floor(robot, places, robot.world.rooms)
    assert free.covers(shapely.Point(0.0, 0.0))
    rng = np.random.default_rng(seed)
    low, high = np.array(free.bounds[:2]), np.array(free.bounds[2:])
    points = rng.uniform(low, high, (60, 2))
    for x, y in points[shapely.contains_xy(free, points)]:
        assert math.hypot(x, y) <= next_view.FAR_REACH_M + 1e-6
        for place in places:
            at = place.world_from_robot @ Pose2(float(x), float(y), 0.0)
            assert not is_solid(robot, at, 0.01)


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 2**32 - 1), floor=st.integers(0, 2))
def test_each_leg_is_free_in_every_place_and_no_longer_than_said(seed: int, floor: int) -> None:
    _, robot = robot_on(floor)
    places = draw_places(robot, seed, 2)
    action = choose_far_action(robot, places, [HERE], robot.world.rooms, make_view_predictor(robot))
    if action is None:
        return
    assert 0.0 <= action.move_m <= next_view.FAR_LEG_M and action.expected_separation > 0.0
    for place in places:
        for part in np.linspace(0.0, 1.0, 9):
            along = Pose2(0.0, 0.0, action.turn_rad) @ Pose2(float(part) * action.move_m, 0.0, 0.0)
            assert not is_solid(robot, place.world_from_robot @ along, 0.01)


def make_far_predictor(robot: RobotModel, places: list[PoseHypothesis], tells_at: Pose2) -> PredictView:
    """Views that are the same everywhere, but those from near one place of the first hypothesis: there is more."""
    plain = np.array([[[60.0 + 40.0 * k, 100.0], [60.0 + 40.0 * k, 300.0]] for k in range(10)])
    more = np.concatenate([plain, plain + np.array([20.0, 0.0]), plain + np.array([0.0, 205.0])])

    def predict(pose: Pose2) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        there = places[0].world_from_robot @ tells_at
        looks_there = abs(wrap_angle(pose.heading_rad - there.heading_rad)) < math.radians(46.0)
        return more if pose.distance_to(there) < 1.0 and looks_there else plain

    return predict


@pytest.mark.parametrize("away_m", [3.0, 6.0])
def test_driving_on_it_comes_to_the_only_view_that_tells(away_m: float) -> None:
    """Two places in a long corridor: leg by leg, planned again from each, to where they differ."""
    _, robot = robot_on(11)
    (room,) = [name for name in robot.world.rooms if name == "corridor-0"]
    low, high = robot.world.outline(room).min(axis=0), robot.world.outline(room).max(axis=0)
    middle = Pose2(*(0.5 * (low + high)).tolist(), 0.0 if high[0] - low[0] > high[1] - low[1] else 0.5 * math.pi)
    places = [PoseHypothesis(room, middle @ Pose2(4.0 - k, 0.0, 0.0), 0.5) for k in (0.0, 1.0)]
    tells_at = Pose2(-away_m, 0.0, 0.0)
    predict = make_far_predictor(robot, places, tells_at)
    moved, looked, driven_m = HERE, [HERE], 0.0
    for _ in range(MAX_SEARCHED_VIEWS + 10):
        now = [PoseHypothesis(p.room, p.world_from_robot @ moved, 0.5) for p in places]
        views = [predict(h.world_from_robot) for h in now]
        if are_distinguishable([views[0]], [views[1]], clearly=next_view.CLEAR_DIFFERENCE):
            break
        seen_from = [moved.inverse() @ old for old in looked]
        action = choose_far_action(robot, now, seen_from, robot.world.rooms, predict)
        assert action is not None
        moved = action.apply_to(moved)
        driven_m += action.move_m
        looked.append(moved)
    else:
        pytest.fail("it never came to where the views differ")
    assert driven_m <= away_m + 0.5


def test_where_no_view_tells_it_stays() -> None:
    _, robot = robot_on(11)
    places = draw_places(robot, 3, 2)
    same = np.array([[[60.0 + 40.0 * k, 100.0], [60.0 + 40.0 * k, 300.0]] for k in range(10)])
    assert choose_far_action(robot, places, [HERE], robot.world.rooms, lambda _: same) is None


@given(seed=st.integers(0, 2**32 - 1), alike=st.integers(1, 15))
def test_one_view_that_differs_clearly_tells_however_many_are_alike(seed: int, alike: int) -> None:
    rng = np.random.default_rng(seed)
    start = rng.uniform(50.0, 400.0, (12, 1, 2))
    plain = np.concatenate([start, start + rng.uniform(40.0, 80.0, (12, 1, 2))], axis=1)
    other = np.concatenate([plain[:6], plain[6:] + np.array([0.0, 700.0])])
    assert not are_distinguishable([plain] * alike, [plain] * alike)
    assert are_distinguishable([plain] * alike + [other], [plain] * (alike + 1))
