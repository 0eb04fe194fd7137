"""Laws of subgoals round what the model lacks: by which doors, past what stands before them, and from where to look."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from generated_boards import LENGTH_M, WIDTH_M, Bench, to_world
from harvey.testing import HALL, HOUSE, STUDY, plain_robot
from knowledge_sources.methods.floor import find_floor, measure_first_seen_m
from knowledge_sources.methods.floor.looks_round import sees
from knowledge_sources.methods.motion import CLEARANCES_M, SubgoalPlanner
from knowledge_sources.methods.motion.subgoals import (
    LEFT_ROOM_M,
    LOOKOUT_DIRECTIONS,
    LOOKOUT_DISTANCES_M,
    LOOKOUT_SAME_SIDE_M,
    MIN_DOORWAY_CLEARANCE_M,
    MIN_LOOKOUT_CHANGE_M,
    MIN_TOLERANCE_M,
    WAY_TOLERANCE_M,
)
from knowledge_sources.reads import find_robot
from knowledge_sources.settings import DEFAULT
from world_models.camera import Camera, CameraMount
from world_models.entries import Place
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2
from world_models.robot import RobotModel

S = DEFAULT.plan
WEST = HOUSE.replace('along = 2.0', 'along = 3.2').replace("[doors]", """[locales.west]
kind = "office"
in = "house"
at = [-4.2, 0]
size = [4, 4]

[doors]
low-door = { between = ["west", "hall"], wall = "east", along = 0.8, width = 1.0, open = true }
high-door = { between = ["west", "hall"], wall = "east", along = 3.2, width = 1.0, open = true }""")
"""The house of the kit with a room west of the hall, from which two doors lead there."""


def plan(bench: Bench) -> SubgoalPlanner:
    things = [bench.view[f"Obstacle-{k}"].value for k in range(1, 9) if bench.view.get(f"Obstacle-{k}")]
    return SubgoalPlanner(find_robot(bench.view), S, things)


@pytest.mark.parametrize("bars", ["nothing", "along the hall", "the far door"])
@pytest.mark.parametrize("y_m", [0.8, 3.2])
def test_where_the_room_behind_a_door_is_barred_it_comes_in_by_another(bars: str, y_m: float) -> None:
    """From either part of the room; only the part with the door by which it goes on is of use."""
    bench = Bench(plain_robot(read_world(Source.parse(WEST, "house.toml"))))
    if bars == "along the hall":
        bench.stand(4.0, 2.0, 3.95, 0.1)
    elif bars == "the far door":
        bench.stand(7.6, 3.2, 0.2, 0.75)
    way = plan(bench).plan_between_locales(Place("west", 1.0, y_m), Place(STUDY, 3.0, 3.2), 0.01)
    passages = None if way is None else [step.passage for step in way if step.passage]
    if bars == "the far door":
        assert way is None
    else:
        assert passages is not None and passages[1:] == ["study-door"]
        assert bars == "nothing" or passages[0] == "high-door"


@pytest.mark.parametrize("thing", [None, (7.5, 2.3, 0.05), (7.5, 1.7, 0.05), (7.35, 1.6, 0.1), (7.0, 2.0, 0.1)])
@pytest.mark.parametrize("back", [False, True])
def test_a_way_is_one_step_after_the_other_through_the_door_and_past_what_stands_before_it(
    thing: tuple[float, float, float] | None, back: bool
) -> None:
    """Straight, or diagonally: from the room where it is to the one behind, and clear of what stands there."""
    bench = Bench(plain_robot())
    if thing is not None:
        bench.stand(*thing, thing[2])
    start, goal = Place(HALL, 5.0, 2.8), Place(STUDY, 3.0, 2.0)
    here, there = (goal, start) if back else (start, goal)
    way = plan(bench).plan_between_locales(here, there, 0.01)
    assert way is not None
    before, through, after = way
    assert (before.origin, after.destination) == (here, there) and through.passage == "study-door"
    assert (before.destination, after.origin) == (through.origin, through.destination)
    assert (through.origin.locale, through.destination.locale) == (here.locale, there.locale)
    assert before.tolerance_m > 0.0 and through.primitive
    if thing is not None:
        line = shapely.LineString([p.in_world(plain_robot().world).position for p in (
            through.origin, through.destination)])
        least_m = line.distance(shapely.Polygon(bench.view["Obstacle-1"].value.footprint))
        assert least_m >= plain_robot().radius_m + CLEARANCES_M[-1] - 1e-3


@settings(max_examples=20, deadline=None)
@given(st.floats(0.4, 1.6), st.floats(0.3, 1.2), st.floats(0.0, 0.4))
def test_a_doorway_is_approached_from_where_the_floor_in_it_is_seen(
    height_m: float, angle_rad: float, tilt_rad: float
) -> None:
    """Whatever the camera: at the place before it, facing it, all floor from its threshold on is in the picture."""
    plain = plain_robot()
    robot = RobotModel(plain.world, Camera.from_field_of_view(2.0 * angle_rad), CameraMount(height_m, 0.1, tilt_rad),
                       plain.actuator)
    here, there = Place(HALL, 5.0, 2.8), Place(STUDY, 3.0, 2.0)
    way = SubgoalPlanner(robot, S).plan_between_locales(here, there, 0.01)
    shortest = SubgoalPlanner(robot, replace(S, approaches_seeing=False)).plan_between_locales(here, there, 0.01)
    assert way is not None and shortest is not None
    door = next(d for d in robot.world.doorways_of(HALL) if d.name == "study-door")
    middle, outward = door.threshold_of(HALL).mean(axis=0), door.outward_from(HALL)
    before = way[0].destination.in_world(robot.world).position
    away_m, nearest_m = (float(outward @ (middle - p.destination.in_world(robot.world).position))
                         for p in (way[0], shortest[0]))
    first_m = measure_first_seen_m(robot)
    assert away_m == pytest.approx(max(first_m, nearest_m)) or first_m > 2.0  # the hall has no room for more
    if nearest_m <= first_m <= 2.0:
        facing = Pose2(float(before[0]), float(before[1]), math.atan2(outward[1], outward[0]))
        ahead = middle + np.linspace(0.01, 0.5, 10)[:, None] * outward
        assert sees(robot, find_floor(robot.world, (HALL, STUDY)), facing, ahead).all()
        assert not sees(robot, find_floor(robot.world, (HALL, STUDY)), facing, [middle - 0.06 * outward]).any()


@settings(max_examples=20, deadline=None)
@given(st.floats(0.7, 3.0), st.floats(0.7, 3.0), st.sampled_from((0.8, 3.2)))
def test_it_never_turns_back_on_its_way_through_doors(begin_m: float, end_m: float, along_m: float) -> None:
    """Near before a door, near behind one, and between two that are opposite, it goes on ahead."""
    robot = plain_robot(read_world(Source.parse(WEST.replace("along = 3.2", f"along = {along_m}", 1), "house.toml")))
    bench = Bench(robot)
    doors = {d.name: d for d in robot.world.doorways_of(HALL)}
    first, last = doors["low-door" if along_m == 0.8 else "high-door"], doors["study-door"]
    start = first.threshold_of("west").mean(axis=0) - begin_m * first.outward_from("west")
    goal = last.threshold_of(STUDY).mean(axis=0) - end_m * last.outward_from(STUDY)
    way = plan(bench).plan_between_locales(Place.of_world(robot.world, "west", *start.tolist()),
                                           Place.of_world(robot.world, STUDY, *goal.tolist()), 0.01)
    assert way is not None
    ahead = [float(first.outward_from("west") @ p.destination.in_world(robot.world).position) for p in way]
    assert (np.diff([float(first.outward_from("west") @ start), *ahead]) >= -1e-6).all()


@pytest.mark.parametrize("room_m", [
    -0.05, LEFT_ROOM_M + MIN_TOLERANCE_M - 1e-3, LEFT_ROOM_M + MIN_TOLERANCE_M + 1e-3, 0.5])
def test_a_leg_is_driven_as_exactly_as_there_is_room_beside_it(room_m: float) -> None:
    """But not more exactly than it can be, where the robot stands at something; and no less than was asked."""
    bench = Bench(plain_robot())
    bench.stand(4.0, 2.1 + plain_robot().radius_m + room_m, 0.1, 0.1)
    found = plan(bench)._limit_tolerance_m(Place(HALL, 3.0, 2.0), Place(HALL, 5.0, 2.0), 0.1)
    assert found == pytest.approx(min(0.1, max(room_m - LEFT_ROOM_M, MIN_TOLERANCE_M)), abs=2e-4)


@pytest.mark.parametrize("beside_m", [0.02, 0.05, 0.099, 0.101, 0.3])
def test_a_narrow_door_is_come_to_as_exactly_as_it_leaves_room_beside_the_robot(beside_m: float) -> None:
    """But not more exactly than the robot keeps clear of things anyway; a wide one as any place on the way."""
    width_m = 2.0 * (plain_robot().radius_m + beside_m)
    text = HOUSE.replace("width = 1.0", f"width = {width_m!r}")
    way = plan(Bench(plain_robot(read_world(Source.parse(text, "house.toml"))))).plan_between_locales(
        Place(HALL, 5.0, 2.2), Place(STUDY, 3.0, 2.0), 0.01)
    assert way is not None
    wanted = WAY_TOLERANCE_M if beside_m >= MIN_DOORWAY_CLEARANCE_M else max(beside_m, CLEARANCES_M[-1])
    assert way[0].tolerance_m == pytest.approx(wanted) and way[-1].tolerance_m == 0.01


@settings(max_examples=15, deadline=None)
@given(st.floats(1.0, 2.5), st.floats(0.9, 3.1), st.sampled_from((3.2, 4.0, 5.5)), st.floats(1.6, 2.4))
def test_it_looks_again_from_where_that_is_best_by_way_and_by_side(
    x: float, y: float, at_x: float, at_y: float
) -> None:
    """Redone one place after the other: near, but rather from another side than that where the robot is."""
    bench = Bench(plain_robot())
    belief = bench.believe(Pose2(x, y, 0.0)).value
    thing = bench.stand(at_x, at_y, 0.1, 0.1).value
    found = plan(bench).plan_look(belief, thing, np.zeros((0, 2)))
    r = plain_robot().radius_m + CLEARANCES_M[0]
    floor = shapely.box(0.0, 0.0, LENGTH_M, WIDTH_M)
    free = floor.buffer(-r, join_style="mitre").difference(shapely.box(
        at_x - 0.1, at_y - 0.1, at_x + 0.1, at_y + 0.1).buffer(r, quad_segs=32))
    hall = to_world(Pose2(0.0, 0.0, 0.0))
    best = math.inf
    for far_m in LOOKOUT_DISTANCES_M:
        for k in range(LOOKOUT_DIRECTIONS):
            out = 2.0 * math.pi * k / LOOKOUT_DIRECTIONS - hall.heading_rad  # directions are counted in the world
            there = np.array([at_x + far_m * math.cos(out), at_y + far_m * math.sin(out)])
            away_m = math.dist(there, (x, y))
            if away_m < MIN_LOOKOUT_CHANGE_M or not free.contains(shapely.Point(there)):
                continue
            before, after = np.array([at_x - x, at_y - y]), np.array([at_x, at_y]) - there
            same = max(0.0, float(before @ after) / (math.hypot(*before) * math.hypot(*after)))
            best = min(best, away_m + LOOKOUT_SAME_SIDE_M * same)
    if found is None:
        assert best == math.inf
        return
    end = found.destination
    before, after = np.array([at_x - x, at_y - y]), np.array([at_x - end.x_m, at_y - end.y_m])
    same = max(0.0, float(before @ after) / (math.hypot(*before) * math.hypot(*after)))
    assert math.dist((end.x_m, end.y_m), (x, y)) + LOOKOUT_SAME_SIDE_M * same == pytest.approx(best, abs=0.05)
    assert end.heading_rad == pytest.approx(math.atan2(after[1], after[0]))
