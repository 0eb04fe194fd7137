"""Laws of the floor that is free without being seen: under the robot, where it drove, and where it was put down."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry
from generated_boards import Bench, to_world
from harvey.testing import HALL, HOUSE, STUDY, house, plain_robot
from knowledge_sources.methods.floor import Lookout, find_floor
from knowledge_sources.reads import SEEN_MARGIN_M, FloorAhead, find_robot, floor_ahead
from knowledge_sources.reads.floor_ahead import (
    LOOK_BEFORE_M,
    LOOK_FROM_M,
    MAX_DRIVEN_GAP_M,
    PUT_DOWN_FREE_M,
    _find_scans,
    _find_way_beyond,
    list_free_discs,
)
from knowledge_sources.settings import DEFAULT
from perfect_eye import scan_floor
from world_models.building.locales import EXTRA_KIND
from world_models.entries import (
    DoorPicture,
    DoorState,
    FreeFloor,
    Hypothesis,
    Impasse,
    Leg,
    MotionReport,
    MotorCommand,
    Place,
    PlaceSearch,
    RideReport,
    Subgoal,
)
from world_models.entries.floor import FloorSense
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2, wrap_angle

ROBOT = plain_robot()
SMALL = 1e-6
FAR = Pose2(50.0, 50.0, 0.0)


def see(bench: Bench, x: float, y: float, sense: FloorSense = "camera", heading: float = 0.0) -> Entry[FreeFloor]:
    """A look at the floor that shows none of it."""
    ahead = (heading - 0.1, heading, heading + 0.1)
    return bench.put(FreeFloor(sense, HALL, x, y, ahead, (1.0,) * 3, (1.0,) * 3, ("sight",) * 3, (0.02,) * 3, (), 1.0))


def covered(discs: list[tuple[float, float, float]]) -> shapely.Geometry:
    return shapely.union_all([shapely.Point(x, y).buffer(r, quad_segs=64) for x, y, r in discs])


@settings(max_examples=40, deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(0.3 * ROBOT.radius_m + SMALL, MAX_DRIVEN_GAP_M - SMALL))
def test_between_two_looks_that_are_near_it_drove_straight(direction: float, gap_m: float) -> None:
    """Whatever the direction: what it swept is free, and nothing beside it."""
    bench = Bench(ROBOT)
    a = see(bench, 20.0, -7.0)
    b = see(bench, 20.0 + gap_m * math.cos(direction), -7.0 + gap_m * math.sin(direction))
    under, *driven = list_free_discs(bench.view, ROBOT, FAR, [a, b])
    assert under.circle == (FAR.x_m, FAR.y_m, ROBOT.radius_m + SEEN_MARGIN_M) and under.because == ()
    line = shapely.LineString([(20.0, -7.0), (b.value.x_m, b.value.y_m)])
    free = covered([disc.circle for disc in driven])
    assert free.within(line.buffer(1.001 * ROBOT.radius_m, quad_segs=64))
    assert line.buffer(0.97 * ROBOT.radius_m).within(free)
    steps = [math.dist(one.circle[:2], other.circle[:2]) for one, other in pairwise(driven)]
    assert sum(steps) == pytest.approx(gap_m) and max(steps) <= 0.3 * ROBOT.radius_m + SMALL
    assert all(disc.because == (a, b) for disc in driven)


@pytest.mark.parametrize(("gap_m", "sense", "drove"), [
    (MAX_DRIVEN_GAP_M - SMALL, "camera", True), (MAX_DRIVEN_GAP_M + SMALL, "camera", False),
    (0.3 * ROBOT.radius_m - SMALL, "camera", False), (0.5, "ranges", False)])
def test_looks_that_are_further_apart_tell_no_way(gap_m: float, sense: FloorSense, drove: bool) -> None:
    bench = Bench(ROBOT)
    looks = [see(bench, 20.0, -7.0, sense), see(bench, 20.0 + gap_m, -7.0, sense)]
    assert (len(list_free_discs(bench.view, ROBOT, FAR, looks)) > 1) == drove


@pytest.mark.parametrize("heading", [0.0, 1.3, -2.4])
@pytest.mark.parametrize("sense", ["camera", "ranges"])
@pytest.mark.parametrize("off_m", [0.0, 0.5, MAX_DRIVEN_GAP_M + 0.2])
def test_where_it_was_put_down_is_behind_the_first_picture_if_that_is_near(
    heading: float, sense: FloorSense, off_m: float
) -> None:
    """The robot's axis is behind its camera; ranges are told from the axis."""
    bench = Bench(ROBOT)
    bench.pursue(Place(HALL, 6.0, 2.0))
    start = Place(HALL, 1.0, 2.0).in_world(ROBOT.world)
    axis = Pose2(start.x_m + off_m, start.y_m, heading)
    eye = axis @ Pose2(ROBOT.mount.forward_m if sense == "camera" else 0.0, 0.0, 0.0)
    first = see(bench, eye.x_m, eye.y_m, sense, heading)
    *_, put = list_free_discs(bench.view, ROBOT, FAR, [])
    there = start if off_m > MAX_DRIVEN_GAP_M else axis
    assert put.circle == pytest.approx((there.x_m, there.y_m, PUT_DOWN_FREE_M)) and put.because == (first,)
    bench.pursue()  # a later goal begins elsewhere
    bench.revise(bench.view["Goal-1"], status="reached")
    assert len(list_free_discs(bench.view, ROBOT, FAR, [])) == 1


@settings(max_examples=20, deadline=None)
@given(st.floats(0.2, 4.0), st.floats(-1.0, 1.0))
def test_pictures_will_be_taken_every_increment_up_to_the_end_and_there_to_where_it_goes_on(
    to_go_m: float, aside: float
) -> None:
    bench = Bench(ROBOT)
    here = Pose2(1.5, 2.0, 0.2)
    belief = bench.believe(here)
    end = Place(HALL, 1.5 + to_go_m * math.cos(0.3), 2.0 + to_go_m * math.sin(0.3) * 0.3)
    beyond = Place(HALL, end.x_m + 1.0, end.y_m + aside)
    sketch = bench.sketch(Place(HALL, 1.0, 2.0), end, beyond, path=(0,))
    floor = FloorAhead(bench.view, bench.leg(sketch).value, belief, DEFAULT)
    start, stop, on = to_world(here), end.in_world(ROBOT.world), beyond.in_world(ROBOT.world)
    way_m = start.distance_to(stop)
    *ahead, last = floor._list_poses_ahead(way_m)
    step_m = ROBOT.actuator.increment_m
    assert [start.distance_to(p) for p in ahead] == pytest.approx(
        [min(way_m, step_m * (k + 1)) for k in range(len(ahead))])
    assert way_m - step_m * 0.1 - SMALL <= start.distance_to(ahead[-1]) <= way_m + SMALL
    heading = math.atan2(stop.y_m - start.y_m, stop.x_m - start.x_m)
    assert all(wrap_angle(p.heading_rad - heading) == pytest.approx(0.0) for p in ahead)
    assert all(abs(p.minus(start) @ np.array([-math.sin(heading), math.cos(heading), 0.0])) < SMALL for p in ahead)
    assert last.distance_to(stop) < SMALL
    assert wrap_angle(last.heading_rad - math.atan2(on.y_m - stop.y_m, on.x_m - stop.x_m)) == pytest.approx(0.0)


@pytest.mark.parametrize(("to_go_m", "looked", "goes_on", "asks"), [
    (LOOK_FROM_M - SMALL, 0, True, True), (LOOK_FROM_M + SMALL, 0, True, False), (1.0, 0, False, False),
    (1.0, DEFAULT.action.max_looks - 1, True, True), (1.0, DEFAULT.action.max_looks, True, False)])
def test_from_so_near_it_looks_at_what_is_behind_the_end_so_often(
    to_go_m: float, looked: int, goes_on: bool, asks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Never again where it has looked from about here."""
    bench = Bench(ROBOT)
    here = Pose2(1.5, 2.0, 0.0)
    belief = bench.believe(here)
    end, beyond = Place(HALL, 1.5 + to_go_m, 2.0), Place(HALL, 1.5 + to_go_m, 3.0)
    sketch = bench.sketch(Place(HALL, 1.0, 2.0), end, *([beyond] if goes_on else []), path=(0,))
    at = to_world(here)
    for turn_rad, is_new in ((0.0, True), (0.39, False), (0.41, True)):
        look = Lookout(at.heading_rad + turn_rad, 0.1)
        asked: list[object] = []
        monkeypatch.setattr(floor_ahead, "choose_look", lambda *given, _l=look, _a=asked: _a.append(given) or _l)
        was = ((at.x_m + 0.29, at.y_m, at.heading_rad),) if turn_rad else ((at.x_m + 0.31, at.y_m, at.heading_rad),)
        leg = bench.leg(sketch, looked_at=was * looked).value
        found = FloorAhead(bench.view, leg, belief, DEFAULT).choose_look()
        assert bool(asked) == asks
        assert (found is look) == (asks and (is_new or looked == 0))


@pytest.mark.parametrize(("status", "is_free"), [("probe", True), ("found", False)])
def test_floor_that_was_seen_before_it_was_found_elsewhere_tells_nothing(status: Any, is_free: bool) -> None:
    bench, here = Bench(ROBOT), Pose2(3.0, 2.0, 0.0)
    belief, leg = bench.believe(here), bench.leg(bench.sketch(Place(HALL, 1.0, 2.0), Place(HALL, 6.0, 2.0)))
    scan = scan_floor(find_floor(house(), [HALL]), to_world(here), HALL, near_m=0.05, forward_m=0.0, half_rad=1.5)
    for value, free in ((scan, True), (PlaceSearch(status, ""), is_free), (scan, True)):
        bench.put(value, belief)
        assert (FloorAhead(bench.view, leg.value, belief, DEFAULT).measure_clearance(1.0).free_m == 1.0) == free


@pytest.mark.parametrize(("ahead_m", "is_free"), [(-0.45, True), (-0.1, True), (0.7, False)])
def test_what_was_seen_where_it_stands_or_leaves_behind_holds_it_up_no_more(ahead_m: float, is_free: bool) -> None:
    bench, here = Bench(ROBOT), Pose2(3.0, 2.0, 0.0)
    belief, leg = bench.believe(here), bench.leg(bench.sketch(Place(HALL, 1.0, 2.0), Place(HALL, 6.0, 2.0)))
    floor, thing = find_floor(house(), [HALL]), shapely.Point(to_world(Pose2(3.0 + ahead_m, 2.0, 0.0)).position)
    bench.put(scan_floor(floor, to_world(here), HALL, near_m=0.05, forward_m=0.0, half_rad=3.1), belief)
    bench.put(scan_floor(floor, to_world(Pose2(1.0, 2.0, 0.0)), HALL, 1.0, things=[thing.buffer(0.1)]), belief)
    assert (len(FloorAhead(bench.view, leg.value, belief, DEFAULT).measure_clearance(1.0).p) == 0) == is_free


RIDE = Subgoal(Place(HALL, 5.0, 2.0), Place(STUDY, 3.0, 2.0), primitive=False, passage="lift")


@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("at", [0, 1, 2])
@pytest.mark.parametrize("rides", [False, True])
def test_the_way_goes_on_as_the_sketches_say_so_far_and_no_further_than_a_ride(
    levels: int, at: int, rides: bool
) -> None:
    """What follows the current leg, then what follows the subgoal of which that is a part; three places at most."""
    bench = Bench(ROBOT)
    way = [Place(HALL, 1.0 + k, 2.0) for k in range(4)]
    above = [Place(HALL, 6.0, 2.0), Place(HALL, 6.5, 2.0), Place(STUDY, 1.0, 2.0), Place(STUDY, 2.0, 2.0)]
    goal = bench.pursue(above[-1])
    if levels == 2:
        first = bench.sketch(*above, goal=goal)
        if rides:
            steps = first.value.subgoals
            bench.revise(first, subgoals=(steps[0], RIDE, *steps[2:]))
    bench.sketch(*way, goal=goal, path=(0,) if levels == 2 else (), at=at)
    points, locales = _find_way_beyond(bench.view, ROBOT)
    wanted = way[at + 2:]
    if levels == 2 and not rides:
        wanted = [*wanted, *above[2:]][:3]
    assert np.allclose(points or np.zeros((0, 2)), np.array([p.in_world(ROBOT.world).position for p in wanted]).reshape(
        -1, 2))
    assert locales == {HALL, *(p.locale for p in wanted)}


def test_what_the_file_lacks_stands_on_floor_that_is_asked_after_and_what_it_has_on_none() -> None:
    text = HOUSE.replace("size = [8, 4]", 'size = [8, 4]\nthings = [["desk", [5.0, 1.0]], ["table", [2.5, 3.0]]]')
    bench = Bench(plain_robot(read_world(Source.parse(text, "house.toml"))))
    belief = bench.believe(Pose2(1.5, 2.0, 0.0))
    bench.stand(3.5, 2.0, 0.3, 0.3)
    sketch = bench.sketch(Place(HALL, 1.0, 2.0), Place(HALL, 6.0, 2.0), path=(0,))
    asked = FloorAhead(bench.view, bench.leg(sketch).value, belief, DEFAULT)._tested
    things = [t for t in find_robot(bench.view).world.things_of(HALL) if t.is_obstacle]
    assert len(things) == 3
    for thing in things:
        middle = shapely.Polygon(thing.footprint_world).centroid
        assert asked.contains(middle) == (thing.kind == EXTRA_KIND)


@pytest.mark.parametrize(("log_odds", "touched_s", "stops"), [
    (0.5, None, True), (-0.5, None, False), (0.5, 9.0, False)])
def test_before_a_door_that_may_be_shut_it_stops_for_a_picture_then_to_look_from_elsewhere_and_then_goes_on(
    log_odds: float, touched_s: float | None, stops: bool
) -> None:
    bench = Bench(ROBOT)
    bench.sketch()
    (door,) = house().doorways_of(HALL)
    inward, middle = -door.outward_from(HALL), door.threshold_of(HALL).mean(axis=0)
    picture = DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), 0.0, 0.0, 0.0, 4.5, "a leaf")
    state = bench.put(DoorState(
        door.name, door.between, "unknown", 0.6, log_odds, 1, picture, 1.0, touched_s=touched_s))

    def go(gap_m: float) -> MotorCommand | None:
        at = Pose2(*(middle + (ROBOT.radius_m + gap_m) * inward), math.atan2(*(-inward)[::-1]))
        belief = bench.put(Hypothesis.of_world(house(), HALL, at, np.diag([1e-6] * 3), "milestone"))
        floor = shapely.Point(at.position).buffer(4.0)
        bench.put(scan_floor(floor, at, HALL, near_m=0.05, forward_m=0.0, half_rad=1.5))
        leg = Leg("PlanSketch-1", 0, at.x_m, at.y_m, *(middle - 0.3 * inward), 0.1)
        return FloorAhead(bench.view, leg, belief, DEFAULT).keep_to_seen(MotorCommand(0.0, 1.0))[1]

    far, near = go(1.0), go(LOOK_BEFORE_M)
    assert far is not None and (near is None) == stops
    assert (ROBOT.actuator.reach * far.move_m < 1.0 - LOOK_BEFORE_M + 0.06) == stops
    bench.put(Impasse("blocked", "it may be shut", behind=(state.id,), is_open=False))
    assert (go(1.0) == far) and (again := go(LOOK_BEFORE_M)) is not None and again.move_m > LOOK_BEFORE_M


AGE_S = DEFAULT.action.max_seen_age_s


@pytest.mark.parametrize(("ago_s", "ride_ago_s", "counts"), [
    (AGE_S - SMALL, None, True), (AGE_S + SMALL, None, False), (1.0, 1.0 + SMALL, True), (1.0, 1.0 - SMALL, False)])
def test_what_was_seen_tells_of_the_floor_until_it_is_old_or_the_robot_rides(
    ago_s: float, ride_ago_s: float | None, counts: bool
) -> None:
    bench, now_s = Bench(ROBOT), 100.0
    scan, belief = see(bench, 2.0, 2.0), bench.believe()
    scan = bench.revise(scan, seen_s=now_s - ago_s)
    if ride_ago_s is not None:
        bench.put(RideReport("lift", HALL, 1.0, now_s - ride_ago_s))
    bench.put(MotionReport(0.0, 0.1, 1.0, now_s))
    assert _find_scans(bench.view, belief, DEFAULT.action) == ((scan,) if counts else ())
