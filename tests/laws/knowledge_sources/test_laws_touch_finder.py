"""Law of what a touch tells: a square behind the point that was touched, where nothing of the model explains it."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Post, Revise, Revised
from harvey.testing import answer, check_source
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.methods.floor import judge_thing
from knowledge_sources.model.touch_finder import MAX_TOUCH_SIGMA_RAD, TouchFinder
from knowledge_sources.settings import DEFAULT
from things_in_hall import CARTON, HALL, HERE, Hall
from world_models.entries import AROUND_SIGMA_RAD, Contact, Hypothesis, MotorCommand, Obstacle, diagonal
from world_models.entries.obstacle import AHEAD_SIGMA_RAD
from world_models.frames import Pose2

SOURCE, ROUNDED_M = TouchFinder(), 2e-3


def touch(hall: Hall, contact: Contact, *motions: MotorCommand) -> list[str]:
    """Something is touched in a move, in one cycle, and other motions follow; the ids of contact and motions."""
    asked = Post(MotorCommand(0.0, 0.5))
    return [hall.apply(asked, Post(contact, (asked,)))[1].entry.id, *(hall.put(motion).id for motion in motions)]


def verify(hall: Hall, pose: Pose2 = HERE, sigma_m: float = 0.01, basis: str = "milestone") -> Revised:
    """The robot is found to be at a pose [world]; what wakes the source."""
    belief, world = hall.belief(), hall.robot.world
    known = Hypothesis.of_world(world, HALL, pose, belief.value.covariance_world(world), basis)
    known = replace(known, covariance=diagonal(sigma_m, 0.005))
    (change,) = hall.apply(Revise(belief, known, (belief,)))
    return Revised(change.entry)


@given(st.floats(-3.0, 3.0), st.lists(st.floats(-0.6, 0.6), max_size=3),
       st.floats(0.1, 1.2) | st.sampled_from((AHEAD_SIGMA_RAD, AROUND_SIGMA_RAD)), st.booleans())
@settings(max_examples=25, deadline=None)
def test_a_sure_touch_is_a_square_behind_the_point_however_the_robot_has_turned_since(
    direction_rad: float, turns: list[float], sigma_rad: float, has_moved: bool
) -> None:
    """One that is not so sure, as a stall is not, tells of nothing."""
    hall = Hall(())
    motions = [MotorCommand(turn, 0.0) for turn in turns] + [MotorCommand(0.1, 0.2)] * has_moved
    ids = touch(hall, Contact("bumper", direction_rad, sigma_rad, 3.0), *motions)
    trigger = verify(hall, Pose2(HERE.x_m, HERE.y_m, sum(turns)))
    effects = answer(SOURCE, hall.board.view, trigger)
    if sigma_rad > MAX_TOUCH_SIGMA_RAD or has_moved:
        assert effects is None
        return
    assert effects is not None
    effect, told = effects
    assert isinstance(effect, Post) and isinstance(told, Post) and told.value.about == effect.value.name
    found: Obstacle = effect.value
    assert {entry.id for entry in effect.because} == {*ids, trigger.entry.id}
    out, side_m = cmath.exp(1j * direction_rad), DEFAULT.action.obstacle_width_m
    at = complex(HERE.x_m, HERE.y_m) + hall.robot.radius_m * out
    corners = [at + (depth * side_m + 1j * across * side_m) * out
               for depth, across in ((0, -0.5), (1, -0.5), (1, 0.5), (0, 0.5))]
    square = shapely.Polygon([(c.real, c.imag) for c in corners])
    assert shapely.hausdorff_distance(shapely.Polygon(found.footprint), square) < ROUNDED_M
    assert shapely.Polygon(found.footprint).exterior.is_ccw
    assert (found.name, found.locale, found.status, found.by) == (f"{HALL}/obstacle-1", HALL, "there", "touch")
    assert (found.seen_s, found.touched_s) == (3.0, 3.0)
    assert found.certainty == pytest.approx(DEFAULT.action.max_obstacle_certainty) and found.width_m == side_m
    b = trigger.entry.value
    aside_m = hall.robot.radius_m * math.hypot(b.sigma_rad, sigma_rad)
    assert found.sigma_m == pytest.approx(math.hypot(b.sigma_m, aside_m))
    hall.apply(effect)
    assert answer(SOURCE, hall.board.view, trigger) is None  # a contact tells once


@pytest.mark.parametrize(("from_wall_m", "sigma_m", "is_told"), [
    (0.02, 0.01, False), (0.07, 0.01, False), (0.10, 0.01, True), (0.10, 0.03, False), (0.20, 0.03, True)])
def test_a_wall_explains_a_touch_within_a_margin_and_three_sigma(
    from_wall_m: float, sigma_m: float, is_told: bool
) -> None:
    hall = Hall(())
    south_m = float(hall.robot.world.outline(HALL)[:, 1].min())
    beside_bare_wall = HERE.x_m - 1.0, south_m + hall.robot.radius_m + from_wall_m
    pose = Pose2(*beside_bare_wall, -math.pi / 2.0)
    touch(hall, Contact("bumper", 0.0, 0.15, 3.0))
    assert (answer(SOURCE, hall.board.view, verify(hall, pose, sigma_m)) is not None) == is_told


@pytest.mark.parametrize(("gap_m", "is_same"), [(0.0, True), (0.1, True), (0.6, False)])
def test_what_was_known_there_reaches_to_where_it_was_touched(gap_m: float, is_same: bool) -> None:
    hall = Hall(())
    front_m = min(x for x, _ in CARTON)
    known = hall.put(Obstacle(f"{HALL}/obstacle-1", HALL, CARTON, 0.05, 4.0, 1.2, 0.5, certainty=0.6, by="camera",
                              status="suspected"))
    pose = Pose2(front_m - hall.robot.radius_m - gap_m, HERE.y_m, 0.0)
    ids = touch(hall, Contact("bumper", 0.0, 0.15, 3.0))
    trigger = verify(hall, pose)
    effect, told = answer(SOURCE, hall.board.view, trigger) or ()
    assert isinstance(effect, Revise) == is_same and told.value.about == effect.value.name
    weighed = weigh_rivals(effect.value.name, (told.value,))
    assert judge_thing(effect.value, weighed, DEFAULT.action) == effect.value
    if isinstance(effect, Revise):
        found: Obstacle = effect.value
        assert effect.entry is known and {entry.id for entry in effect.because} == {known.id, *ids, trigger.entry.id}
        assert min(x for x, _ in found.footprint) == pytest.approx(front_m - gap_m, abs=ROUNDED_M)
        assert shapely.Polygon(found.footprint).buffer(ROUNDED_M).contains(shapely.Polygon(CARTON))
        assert (found.name, found.is_there, found.touched_s) == (known.value.name, True, 3.0)
    else:
        assert effect.value.name == f"{HALL}/obstacle-2"


def test_it_keeps_the_laws_of_all_sources() -> None:
    hall = Hall(())
    contact, *_ = touch(hall, Contact("bumper", 0.0, 0.15, 3.0))
    check_source(SOURCE, hall.bench, verify(hall), without=(contact,))
