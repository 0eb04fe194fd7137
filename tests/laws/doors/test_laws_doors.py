"""Laws of doors: what a picture says of an opening, and what pictures together say of a door."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from archive_door import DOORWAY, HALL, ROBOT, WORLD, before_door, photograph
from knowledge_sources.methods.doors import (
    MIN_LOG_RATIO,
    describe,
    is_in_view,
    is_near,
    measure_opening,
    predict_opening,
    update_door,
    weigh_leaf,
)
from knowledge_sources.methods.doors.belief import MAX_DOUBTED_SIGMAS
from knowledge_sources.methods.doors.leaf import (
    FOOT_STEP_M,
    JAMB_MARGIN_M,
    MAX_DISTANCE_M,
    MAX_LOG_RATIO,
    MAX_RIVAL_BETTER,
    MIN_LEAF_SINE,
    LeafEvidence,
    find_largest_share,
)
from knowledge_sources.methods.doors.rival_views import Views
from knowledge_sources.methods.features import read_picture
from sim.body.simulated_building import SimulatedBuilding
from sim.ground_truth.things import build_thing
from sim.render.sensor import SensorParameters, expose
from world_models.entries import DoorPicture, DoorState, Hypothesis, diagonal
from world_models.frames import Pose, Pose2, wrap_angle

SURE = np.diag([0.01**2, 0.01**2, 0.005**2])
RATIOS = st.floats(-MAX_LOG_RATIO, MAX_LOG_RATIO)


def weigh(pose: Pose2, is_shut: bool, gain: float = 1.0) -> float | None:
    """What a picture of the door says."""
    opening = predict_opening(ROBOT, pose, SURE, DOORWAY, HALL, WORLD)
    if opening is None:
        return None
    evidence = measure_opening(ROBOT, opening, read_picture(photograph(pose, is_shut, gain=gain)).half)
    return None if evidence is None else weigh_leaf(evidence)


@pytest.mark.parametrize("gain", [0.5, 1.0])
@pytest.mark.parametrize(("away_m", "aside_m"), [(1.6, 0.2), (2.5, -0.3), (4.0, 0.4), (4.8, 0.0)])
def test_a_leaf_is_told_from_what_is_beyond_in_any_light(away_m: float, aside_m: float, gain: float) -> None:
    pose = before_door(away_m, aside_m)
    shut, opened = (weigh(pose, is_shut, gain) for is_shut in (True, False))
    assert shut is not None and shut >= MIN_LOG_RATIO
    assert opened is not None and opened <= -MIN_LOG_RATIO


@pytest.mark.parametrize("sigma_m", [0.001, 0.02, 0.06])
@pytest.mark.parametrize("sigma_rad", [0.001, 0.03])
@pytest.mark.parametrize("aside_m", [-0.5, 0.0, 0.5])
def test_samples_keep_off_the_jambs_by_what_the_pose_leaves_open(
    sigma_m: float, sigma_rad: float, aside_m: float
) -> None:
    """Two deviations of the place and of the heading at that distance; and every sample passes both thresholds so."""
    pose, doorway = before_door(2.5, aside_m), DOORWAY
    opening = predict_opening(ROBOT, pose, np.diag([sigma_m, sigma_m, sigma_rad]) ** 2, doorway, HALL, WORLD)
    assert opening is not None
    margin_m = JAMB_MARGIN_M + 2.0 * math.hypot(sigma_m, sigma_rad * opening.distance_m)
    center = ROBOT.camera_from_world(pose).inverse()
    rays = ROBOT.camera.rays(opening.pixels) @ center.rotation.T
    for k, room in enumerate((HALL, doorway.other(HALL))):
        left, right = doorway.threshold_of(room)
        outward = doorway.outward_from(HALL)
        deep = ((left - center.translation[:2]) @ outward) / (rays[:, :2] @ outward)
        hit = center.translation + deep[:, None] * rays
        across, height = (hit[:, :2] - left) @ (right - left) / doorway.width_m, hit[:, 2]
        for off in (across, doorway.width_m - across, height, doorway.height_m - height):
            assert off.min() > margin_m - 1e-6
        if k == 0:
            assert np.allclose(across / doorway.width_m, opening.across) and np.allclose(height, opening.height_m)


@pytest.mark.parametrize(("aside_m", "is_hidden"), [(0.0, True), (3.0, False)])
def test_what_stands_before_an_opening_is_no_leaf_of_it(aside_m: float, is_hidden: bool) -> None:
    pose, plain = before_door(2.5, 0.0), predict_opening(ROBOT, before_door(2.5, 0.0), SURE, DOORWAY, HALL, WORLD)
    middle = pose @ Pose2(1.2, aside_m, 0.0)
    before = shapely.Point(middle.x_m, middle.y_m).buffer(0.5)
    opening = predict_opening(ROBOT, pose, SURE, DOORWAY, HALL, WORLD, before)
    assert opening is None if is_hidden else np.array_equal(opening.pixels, plain.pixels)  # type: ignore[union-attr]


@pytest.mark.parametrize("before_m", [0.0, 0.25, 0.7, -0.5])
def test_a_leaf_that_stands_before_an_opening_or_behind_it_is_none_of_its_door(before_m: float) -> None:
    """Its foot is seen on the floor elsewhere than in the wall, where that of the door's own leaf is."""
    pose, at = before_door(2.6, 0.3), DOORWAY.pose_from(HALL) @ Pose2(-before_m, 0.0, 0.5 * math.pi)
    stands = Pose.from_rotation_vector(np.array([0.0, 0.0, at.heading_rad]), np.array([at.x_m, at.y_m, 0.0]))
    leaf = build_thing("door-leaf", "loose", HALL, stands)
    renderer = SimulatedBuilding.of_faces([*WORLD.faces, *leaf]).renderer
    seen = renderer.radiance(ROBOT.lens, ROBOT.camera_from_world(pose))
    image = expose(seen, SensorParameters(), np.random.default_rng(1), lights_on=True)
    opening = predict_opening(ROBOT, pose, SURE, DOORWAY, HALL, WORLD)
    evidence = None if opening is None else measure_opening(ROBOT, opening, image[::2, ::2])
    assert evidence is not None and (weigh_leaf(evidence) > 0.0) is (before_m == 0.0)
    off_m = 0.0 if before_m == 0.0 else -before_m - math.copysign(0.1, -before_m)  # but for the wall, and the pose
    assert evidence.foot_off_m == pytest.approx(off_m, abs=0.1)


def test_a_wall_where_the_door_should_be_is_no_leaf() -> None:
    """A robot that is elsewhere sees no frame where it expects it."""
    pose = before_door(2.5, 0.0)
    opening = predict_opening(ROBOT, pose, SURE, DOORWAY, HALL, WORLD)
    assert opening is not None
    elsewhere = Pose2(pose.x_m, pose.y_m, pose.heading_rad + 0.5 * math.pi)
    evidence = measure_opening(ROBOT, opening, read_picture(photograph(elsewhere, is_shut=False)).half)
    assert evidence is None or weigh_leaf(evidence) <= 0.0


def test_a_door_that_is_far_behind_or_seen_from_the_side_is_not_looked_at() -> None:
    middle = DOORWAY.pose_from(HALL)
    assert is_in_view(ROBOT, before_door(3.0, 0.0), DOORWAY, HALL)
    for pose in (before_door(MAX_DISTANCE_M + 0.5, 0.0), middle @ Pose2(-3.0, 0.0, math.pi),
                 middle @ Pose2(-0.3, 1.0, -1.3)):
        assert not is_in_view(ROBOT, pose, DOORWAY, HALL)


@given(st.lists(st.tuples(*[st.floats(0.0, 6.0)] * 3), min_size=1, max_size=30), st.floats(-2.0, 2.0))
def test_the_largest_share_is_at_least_one_sample_and_the_same_in_any_light(
    colors: list[tuple[float, float, float]], gain: float
) -> None:
    logs = np.round(np.array(colors), 3)
    share = find_largest_share(logs, 0.2, 0.08)
    assert 1.0 / len(logs) <= share <= 1.0
    assert find_largest_share(np.repeat(logs[:1], 5, axis=0) + gain, 0.2, 0.08) == 1.0


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 2.0) | st.just(math.nan),
       st.floats(0.0, 2.0) | st.just(math.nan), st.floats(0.0, 1.0) | st.just(math.nan), st.floats(0.0, 1.0))
def test_one_picture_says_no_more_than_it_may_and_nothing_for_a_leaf_without_a_frame(
    uniform: float, expected: float, agreeing: float, foot: float, expected_foot: float, frame: float, own: float
) -> None:
    evidence = LeafEvidence(uniform, expected, agreeing, foot, expected_foot, frame, own)
    ratio = weigh_leaf(evidence)
    assert abs(ratio) <= MAX_LOG_RATIO
    assert weigh_leaf(replace(evidence, frame=math.nan)) <= 0.0
    assert weigh_leaf(replace(evidence, frame_leaf=1.0)) <= 0.0
    assert describe(evidence, ratio)


def picture(ratio: float, x_m: float = 0.0) -> DoorPicture:
    return DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), x_m, 0.0, 0.0, ratio, "something")


def look(ratios: list[tuple[float, float]], *, is_shut: bool = False) -> list[DoorState | None]:
    """The states of a door after pictures (ratio, place)."""
    known: DoorState | None = None
    states = []
    for ratio, x_m in ratios:
        now = update_door(known, "d", ("a", "b"), picture(ratio, x_m), 1.0, is_believed_shut=is_shut)
        known = now or known
        states.append(known)
    return states


def test_a_state_says_what_is_seen() -> None:
    state = look([(4.5, 0.0), (4.5, 1.0)])[-1]
    assert state is not None and not state.is_passable
    assert state.sentence() == (
        "d is shut, with a probability of 99.3% by 2 pictures: the last showed something in its opening, at 1.0 s")


@pytest.mark.parametrize("is_shut", [False, True])
def test_an_overexposed_opening_says_nothing(is_shut: bool) -> None:
    assert weigh(before_door(2.0, 0.0), is_shut, gain=9.0) is None


LEAF = LeafEvidence(1.0, 0.5, 0.0, 0.0, 1.0, 1.0, 0.0)
"""All of one color where several and the floor are expected, in its frame, from the front."""


@pytest.mark.parametrize(("changed", "tells"), [
    ({}, True), ({"sine": MIN_LEAF_SINE}, True), ({"sine": MIN_LEAF_SINE - 1e-6}, False)])
def test_nothing_speaks_for_a_leaf_that_is_seen_aslant(
    changed: dict[str, float], tells: bool
) -> None:
    """For an open door such a picture speaks as ever."""
    ratio = weigh_leaf(replace(LEAF, **changed))
    assert (ratio > 0.0) is tells and ratio >= 0.0
    assert weigh_leaf(replace(SEEN_OPEN, **changed)) < 0.0


SEEN_OPEN = replace(LEAF, uniform=0.5, agreeing=1.0, foot=1.0)


@pytest.mark.parametrize("off", [1e-6, -1e-6])
def test_what_a_rival_explains_better_says_nothing(off: float) -> None:
    """For a leaf, where what is beyond explains it better, or its foot is not seen in its wall."""
    better, told = MAX_RIVAL_BETTER + off, off < 0.0
    assert (weigh_leaf(replace(LEAF, views=Views(0.0, -better))) > 0.0) is told
    assert all((weigh_leaf(replace(LEAF, foot_off_m=side * (FOOT_STEP_M + off))) > 0.0) is told for side in (-1, 1))
    assert weigh_leaf(replace(SEEN_OPEN, views=Views(0.0, -better), foot_off_m=1.0)) < 0.0


def see(known: DoorState | None, ratio: float, x_m: float, heading_rad: float = 0.0) -> DoorState | None:
    shown = replace(picture(ratio, x_m), heading_rad=heading_rad)
    return update_door(known, "d", ("a", "b"), shown, 1.0, is_believed_shut=False) or known


@given(st.floats(0.0, 0.6), st.floats(2.0, 4.5))
def test_of_two_pictures_the_second_adds_what_is_new(way_m: float, ratio: float) -> None:
    """Half-way to an independent place it is kept beside the first; nearer it is the same view."""
    known = see(see(None, ratio, 0.0), ratio, way_m)
    assert known is not None
    part = way_m / 0.6
    if abs(part - 0.5) > 1e-6:
        assert known.log_odds == pytest.approx(-4.0 + ratio * (1.0 + (part if part >= 0.5 else 0.0)), abs=1e-6)


@pytest.mark.parametrize("sigma_m", [0.01, 0.2])
@pytest.mark.parametrize("sigma_rad", [0.003, 0.1])
@pytest.mark.parametrize("direction", [0.0, 2.0, -1.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_pose_is_where_it_was_believed_up_to_each_bound_by_itself(
    sigma_m: float, sigma_rad: float, direction: float, side: float
) -> None:
    before = Pose2(1.0, 2.0, 3.0)  # a small turn leads past half a turn
    belief = Hypothesis(HALL, before, diagonal(sigma_m, sigma_rad), "tracks")
    for more_m, more_rad, near in ((-1e-6, -1e-6, True), (1e-6, -1e-6, False), (-1e-6, 1e-6, False)):
        far_m = MAX_DOUBTED_SIGMAS * belief.sigma_m + 0.05 + more_m
        turn = side * (MAX_DOUBTED_SIGMAS * belief.sigma_rad + 0.02 + more_rad)
        after = Pose2(1.0 + far_m * math.cos(direction), 2.0 + far_m * math.sin(direction), wrap_angle(3.0 + turn))
        assert is_near(before, after, belief) == near
