"""Laws of what a further sight or a touch makes of a thing that is known: it loses nothing that was surely there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from generated_boards import to_world
from harvey.testing import HALL, house, plain_robot
from knowledge_sources.methods.floor import Sight, build_polygon, see_ranges, touch_again
from knowledge_sources.methods.floor.footprints import ThingShape, find_same
from knowledge_sources.methods.floor.ranges import RANGE_SLACK_M
from knowledge_sources.methods.floor.rivals_on_floor import ShownSight
from knowledge_sources.methods.floor.weigh_sight import see_again
from knowledge_sources.methods.floor.weigh_touch import TOUCHED_SIDE_M, Touched
from knowledge_sources.settings import DEFAULT
from things_in_hall import known_by_sight
from world_models.entries import Contact, FloorThing, FreeFloor, Obstacle, Ranges
from world_models.frames import Pose2

NONE = shapely.Polygon()
Corners = tuple[tuple[float, float], ...]


def box(x: float, y: float, half_x: float, half_y: float) -> Corners:
    """Corners in the world of a box in the hall's frame."""
    return tuple((float(a), float(b)) for a, b in (
        to_world(Pose2(x + i * half_x, y + k * half_y, 0.0)).position for i, k in ((-1, -1), (1, -1), (1, 1), (-1, 1))))


WHOLE, FAR_END = box(4.0, 2.0, 0.5, 0.4), box(4.6, 2.0, 0.1, 0.1)
THING = Obstacle("hall/obstacle-1", HALL, WHOLE, 0.05, 4.0, 2.0, 1.0, 0.8, 0.3, certainty=0.9, by="sight")


@settings(max_examples=30)
@given(st.floats(-math.pi, math.pi))
def test_touched_it_reaches_to_where_it_was_touched(direction: float) -> None:
    """It loses nothing, and no more is added than the touched square."""
    here = to_world(Pose2(4.0 - 1.0 * math.cos(direction), 2.0 - 1.0 * math.sin(direction), 0.0))
    out = to_world(Pose2(0.0, 0.0, direction)).heading_rad
    contact = Contact("bumper", 0.0, 0.2, 7.0)
    touched = Touched(np.array(here.position), np.array([math.cos(out), math.sin(out)]), contact)
    new = touch_again(house(), touched, THING)
    square = build_polygon(touched.build_square(TOUCHED_SIDE_M))
    hull = shapely.convex_hull(shapely.union(build_polygon(WHOLE), square))
    assert build_polygon(new.footprint).hausdorff_distance(hull) < 8e-3
    assert (new.status, new.seen_s, new.touched_s) == ("there", 7.0, 7.0)


@pytest.mark.parametrize("touched_s", [None, 3.0])
def test_no_picture_takes_back_what_was_touched(touched_s: float | None) -> None:
    """A nearer sight sees only its far end."""
    known = replace(THING, touched_s=touched_s, seen_from_m=4.0)
    end = build_polygon(FAR_END)
    new = look(known=known, shape=ThingShape(end, 1.0), free=build_polygon(WHOLE))
    assert new is not None
    wanted = end
    if touched_s is not None:
        wanted = shapely.convex_hull(shapely.union(wanted, build_polygon(WHOLE)))
    assert build_polygon(new.footprint).symmetric_difference(wanted).area < 5e-3


@pytest.mark.parametrize("sigma_m", [0.09, 0.11])
def test_a_sight_that_is_twice_as_vague_moves_no_footprint(sigma_m: float) -> None:
    """Though it is nearer; one that is nearly as sure does."""
    near = ThingShape(build_polygon(box(3.2, 2.0, 0.3, 0.3)), 1.4)
    new = look(known=replace(THING, seen_from_m=4.0), sigma_m=sigma_m, shape=near)
    assert new is not None
    assert (build_polygon(new.footprint).symmetric_difference(build_polygon(WHOLE)).area < 5e-3) == (sigma_m > 0.1)


@pytest.mark.parametrize("sigmas", [(0.03, 0.04), (0.04, 0.03), (0.0, 0.05), (0.12, 0.05)])
@pytest.mark.parametrize("more", [-1e-3, 1e-3])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_another_sight_is_of_a_thing_within_twice_what_both_leave_open(
    sigmas: tuple[float, float], more: float, side: float
) -> None:
    """Either sight may be the surer; of two things within reach that which it covers more of."""
    mine, known_m = sigmas
    gap_m = 2.0 * math.hypot(mine, known_m) + more
    known = replace(THING, footprint=box(4.0, 2.0, 0.2, 0.2), sigma_m=known_m)
    shape = build_polygon(box(4.0 + side * (0.4 + gap_m), 2.0, 0.2, 0.2))
    assert find_same({"Obstacle-1": known}, shape, mine, math.inf) == ("Obstacle-1" if more < 0.0 else None)
    other = replace(THING, footprint=box(4.0 + side * 0.7, 2.0, 0.2, 0.2), sigma_m=known_m)
    assert find_same({"Obstacle-1": known, "Obstacle-2": other}, shape, mine, math.inf) == "Obstacle-2"


def look(*, p: float = 0.6, sigma_m: float = 0.05, sigma_height_m: float = 0.3, seen_s: float = 9.0,
         way_m: float = 0.0, known: Obstacle = THING, height_m: float = 0.7, shape: ThingShape | None = None,
         free: shapely.Geometry = NONE) -> Obstacle | None:
    """A thing after another sight from a way away, of all of it unless a shape is told."""
    eye = to_world(Pose2(1.5, 2.0, 0.0))
    floor = FreeFloor("camera", HALL, eye.x_m, eye.y_m, (0.0,), (1.0,), (1.0,), ("thing",), (0.02,), (), seen_s)
    thing = FloorThing(known.footprint, sigma_m, height_m, sigma_height_m, p, (0.0, 0.0, 9.0, 9.0), "unlike the floor")
    sight = Sight(floor, "CameraPicture-1", house(), NONE, plain_robot().camera, (),
                  {known.name: known_by_sight(known, (eye.x_m + way_m, eye.y_m))})
    again = see_again(sight, known, thing, shape or ThingShape.of(known), ShownSight(), free, DEFAULT.action)
    return None if again is None else again.obstacle


@pytest.mark.parametrize("sigma_m", [0.02, 0.05, 0.2])
@pytest.mark.parametrize("sigma_height_m", [0.05, 0.3, 1.0])
def test_of_two_sights_the_sharper_tells_place_and_height(sigma_m: float, sigma_height_m: float) -> None:
    new = look(sigma_m=sigma_m, sigma_height_m=sigma_height_m)
    assert new is not None and new.sigma_m == min(sigma_m, THING.sigma_m)
    is_higher = sigma_height_m < 0.7 * THING.sigma_height_m
    assert (new.height_m, new.sigma_height_m) == ((0.7, sigma_height_m) if is_higher else (
        THING.height_m, THING.sigma_height_m))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("sigma_m", "sigma_rad", "is_new"), [
    (0.001, 0.001, True), (0.001, 0.1, False), (0.05, 0.001, True), (0.4, 0.001, False)])
def test_an_echo_may_be_of_the_wall_beside_the_cone_as_far_as_the_pose_leaves_it_open(
    side: float, sigma_m: float, sigma_rad: float, is_new: bool
) -> None:
    """A wall 1.2 m aside; an echo ahead that is nearer than where the cone meets it, but for heading and place."""
    robot, half, away_m = plain_robot(), 0.2, 4.0
    pose = to_world(Pose2(2.0, 2.0 + 0.8 * side, 0.0))
    heard = Ranges((0.0,), (away_m + robot.radius_m,), 0.01, half, 8.0, 1.0)
    seen = see_ranges(robot, HALL, pose, sigma_m, sigma_rad, heard, ())
    place_m = math.hypot(0.01, sigma_m)
    wide = half + 3.0 * sigma_rad + math.atan2(3.0 * sigma_m, away_m)
    far_end = 6.0 - robot.radius_m
    nearest = min(1.2 / math.sin(wide), far_end)
    assert is_new == (away_m < nearest - RANGE_SLACK_M - 3.0 * place_m)  # what the table is by
    ahead = int(np.argmin(np.abs(np.array(seen.bearings_rad) - pose.heading_rad)))
    assert (seen.ends[ahead] == "thing") == is_new
