"""What stands on the floor and is not in the model: found when it is certain enough, joined, and forgotten."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Post
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor import MIN_OBSTACLE_CERTAINTY, MIN_THING_CERTAINTY
from knowledge_sources.methods.floor.weigh_sight import FREE_FLOOR_ODDS
from knowledge_sources.reads import find_building_as_filed
from knowledge_sources.reads.floor_ahead import PUT_DOWN_FREE_M, list_free_discs
from knowledge_sources.settings import DEFAULT
from things_in_hall import CARTON, HALL, HERE, X_M, Y_M, Hall, carton
from world_models.entries import FloorThing, FreeFloor, Goal, Obstacle, Place
from world_models.frame_building import FrameBuilding
from world_models.frames import Pose2
from world_models.visibility.lines_and_points import visible_lines

SCREEN = tuple((X_M + x, Y_M + y) for x, y in ((3.9, 0.6), (4.3, 0.6), (4.3, 1.8), (3.9, 1.8)))


@pytest.fixture
def hall() -> Hall:
    return Hall()


@pytest.mark.parametrize(("aside_rad", "obstacles"), [(0.0, 1), (0.5, 2)])
def test_a_sight_without_feet_before_what_is_known_is_not_another_thing(
    hall: Hall, aside_rad: float, obstacles: int
) -> None:
    hall.see(carton(), seen_s=1.0)
    (known,) = hall.obstacles
    turn = np.array([[math.cos(aside_rad), -math.sin(aside_rad)], [math.sin(aside_rad), math.cos(aside_rad)]])
    near = np.array([(1.3, -0.15), (1.9, -0.15), (1.9, 0.15), (1.3, 0.15)]) @ turn.T + HERE.position
    cut = FloorThing(tuple((float(x), float(y)) for x, y in near), 0.15, 0.5, math.inf, 0.97,
                     (200.0, 400.0, 260.0, 510.0), "unlike the floor", is_cut=True)
    hall.see(cut, seen_s=3.0, ahead_m=0.05)
    assert len(hall.obstacles) == obstacles
    assert hall.obstacles[0].footprint == known.footprint


def test_one_sure_picture_makes_an_obstacle_and_says_which_pixels(hall: Hall) -> None:
    hall.see(carton(), seen_s=1.0)
    (found,) = hall.obstacles
    assert found.status == "there" and found.by == "camera" and found.certainty >= 0.9
    assert found.width_m == pytest.approx(0.5, abs=0.05)
    assert "pixels (200, 300) to (260, 350)" in found.sentence() and "0.4 m high" in found.sentence()
    (change,) = hall.frame.changes
    assert (change.what, change.name) == ("extra", found.name) and change.height_m == pytest.approx(0.45)


def test_what_is_seen_again_is_one_obstacle_and_the_frame_stays(hall: Hall) -> None:
    hall.see(carton(), seen_s=1.0)
    before = hall.frame
    for step in range(5):
        hall.see(carton(by_m=0.01 * step), seen_s=2.0 + step)
    assert len(hall.obstacles) == 1 and hall.frame is before
    hall.see(carton(by_m=0.25), seen_s=9.0)
    assert len(hall.obstacles) == 1 and hall.frame is not before and len(hall.frame.changes) == 1


def test_what_is_seen_free_is_forgotten_within_two_pictures_and_found_again(hall: Hall) -> None:
    hall.see(carton(), seen_s=1.0)
    hall.see(carton(), seen_s=2.0)
    for seen_s in (3.0, 4.0):
        hall.see(seen_s=seen_s, ahead_m=0.2 * (seen_s - 2.0))
    assert [o.status for o in hall.obstacles] == ["gone"]
    assert hall.frame.changes == () and "is gone" in hall.obstacles[0].sentence()
    hall.see(carton(), seen_s=5.0)
    assert [o.status for o in hall.obstacles] == ["gone", "there"] and len(hall.frame.changes) == 1


def test_what_was_touched_is_forgotten_when_its_floor_is_clearly_free(hall: Hall) -> None:
    touched = Obstacle(f"{HALL}/obstacle-1", HALL, CARTON, 0.05, 4.0, 1.2, 0.45, certainty=0.99, touched_s=0.5)
    hall.apply(Post(touched))
    hall.see(seen_s=3.0)
    hall.see(seen_s=4.0, ahead_m=0.2)
    assert [o.status for o in hall.obstacles] == ["gone"]


@given(st.floats(2.0, 4.2), st.booleans())
@settings(max_examples=10, deadline=None)
def test_a_touch_is_not_explained_by_what_is_known_on_another_side(away_rad: float, left: bool) -> None:
    """What the model lacks explains no touch elsewhere: something else stands there."""
    hall = Hall()
    direction = 0.3 if left else -0.3
    out = cmath.exp(1j * (direction + away_rad)) * (hall.robot.radius_m + 0.05)
    x, y = HERE.x_m + out.real, HERE.y_m + out.imag
    beside = tuple((x + a * abs(out.real), y + b * abs(out.imag)) for a, b in ((0.0, 0.0), (0.1, 0.0), (0.0, 0.1)))
    hall.apply(Post(Obstacle(f"{HALL}/obstacle-1", HALL, beside, 0.02, 4.0, 1.2, 0.1, certainty=0.99)))
    hall.touch(direction, turns=(), basis="milestone")
    assert len(hall.obstacles) == 2 and hall.obstacles[1].touched_s == 3.0


def test_what_the_model_has_there_is_no_obstacle(hall: Hall) -> None:
    outline = hall.robot.world.outline(HALL)
    wall_y = float(outline[:, 1].max())
    strip = tuple((X_M + x, wall_y - y) for x, y in ((3.0, 0.04), (4.0, 0.04), (4.0, 0.0), (3.0, 0.0)))
    skirting = FloorThing(strip, 0.03, 0.1, math.inf, 0.99, (0.0, 0.0, 9.0, 9.0), "unlike the floor")
    hall.see(skirting, seen_s=1.0)
    assert hall.obstacles == []


def test_without_what_was_found_the_building_is_as_before_and_what_is_known_of_both_is_kept(hall: Hall) -> None:
    assert find_building_as_filed(hall.board.view) is None
    before = FrameBuilding(hall.board.view).obstacles(HALL)
    hall.see(carton(), seen_s=1.0)
    known, bare = FrameBuilding(hall.board.view), find_building_as_filed(hall.board.view)
    assert bare is not None
    assert len(known.obstacles(HALL)) == len(before) + 1 and len(bare.obstacles(HALL)) == len(before)
    computed: list[str] = []

    def count(building: FrameBuilding) -> int:
        def compute() -> int:
            computed.append(HALL)
            return len(building.obstacles(HALL))

        return building.cached("things", 4, HALL, compute)

    for _ in range(3):
        again = find_building_as_filed(hall.board.view)
        assert again is not None
        assert (count(FrameBuilding(hall.board.view)), count(again)) == (len(before) + 1, len(before))
    assert len(computed) == 2


def test_nothing_is_expected_to_be_seen_behind_it_and_all_of_it_when_it_is_gone(hall: Hall) -> None:
    robot = hall.robot
    camera_from_world = robot.camera_from_world(HERE)
    high = replace(carton(height_m=1.2), footprint=SCREEN)

    def lines() -> Floats:
        building = FrameBuilding(hall.board.view)
        return visible_lines(building, robot.camera, camera_from_world, locales=[HALL]).segments_px

    before = lines()
    hall.see(high, seen_s=1.0)
    during = lines()
    assert total_length(during) < 0.9 * total_length(before)
    for seen_s in (3.0, 4.0):
        hall.see(seen_s=seen_s, ahead_m=0.2 * (seen_s - 2.0))
    assert np.array_equal(lines(), before)


def total_length(segments: Floats) -> float:
    return float(np.linalg.norm(np.diff(segments, axis=1), axis=2).sum())


def test_the_numbers_fit_together() -> None:
    s = DEFAULT.action
    assert MIN_THING_CERTAINTY < MIN_OBSTACLE_CERTAINTY < s.max_obstacle_certainty
    odds = s.max_obstacle_certainty / (1.0 - s.max_obstacle_certainty) * FREE_FLOOR_ODDS**2
    assert odds < s.min_gone_certainty / (1.0 - s.min_gone_certainty)  # two pictures are enough


@given(st.floats(-0.6, 0.6))
@settings(max_examples=10, deadline=None)
def test_what_was_touched_stays_in_the_way_though_a_sight_without_feet_shows_less(direction_rad: float) -> None:
    hall = Hall()
    hall.touch(direction_rad, turns=(), basis="milestone")
    (touched,) = hall.obstacles
    x, y = shapely.Polygon(touched.footprint).centroid.coords[0]
    part = tuple((x + dx, y + dy) for dx, dy in ((0.0, -0.05), (0.2, -0.05), (0.2, 0.05), (0.0, 0.05)))
    cut = FloorThing(part, 0.15, 0.5, math.inf, 0.97, (200.0, 400.0, 260.0, 510.0), "unlike the floor", is_cut=True)
    hall.see(cut, seen_s=6.0, ahead_m=0.05)
    (known,) = hall.obstacles
    kept = shapely.Polygon(known.footprint)
    assert kept.area >= 0.9 * shapely.intersection(shapely.Polygon(touched.footprint),
                                                  shapely.Polygon(known.footprint)).area


@pytest.mark.parametrize("heading_rad", [0.0, 1.2, -2.5])
def test_the_floor_that_is_free_as_it_was_put_down_is_round_the_robot_and_not_round_its_camera(
    hall: Hall, heading_rad: float
) -> None:
    eye = HERE @ Pose2(0.0, 0.0, heading_rad) @ Pose2(hall.robot.mount.forward_m, 0.0, 0.0)
    bearings = tuple((heading_rad + np.linspace(-0.5, 0.5, 41)).tolist())
    scan = FreeFloor("camera", HALL, eye.x_m, eye.y_m, bearings, (1.5,) * 41, (3.0,) * 41, ("sight",) * 41,
                     (0.02,) * 41, (), 0.5)
    at = Place.of_world(hall.robot.world, HALL, HERE.x_m + 0.03, HERE.y_m)
    hall.apply(Post(scan), Post(Goal(at, at)))
    discs = list_free_discs(hall.board.view, hall.robot, HERE, hall.board.view.all(FreeFloor))
    x_m, y_m, radius_m = discs[-1].circle
    assert radius_m == PUT_DOWN_FREE_M
    assert hall.robot.mount.forward_m > 0.05 and math.dist((x_m, y_m), HERE.position) < 1e-6
