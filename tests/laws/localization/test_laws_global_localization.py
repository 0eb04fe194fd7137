"""Laws of a robot that is lost: what it keeps in mind, which view it chooses, and that it never guesses."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from box_rooms import find_hidden
from experiments.generated.floors import generated_floor
from knowledge_sources.methods.features import RIGHT_ANGLE_RAD, find_level_direction
from knowledge_sources.methods.localization import (
    CameraView,
    LocalizationStatus,
    are_distinct,
    get_visibility_map,
    refinement,
)
from knowledge_sources.methods.localization.global_localization import find_aliases, localize
from knowledge_sources.methods.localization.next_view import (
    PoseHypothesis,
    SensingAction,
    choose_sensing_action,
    compute_separation,
    compute_view_difference,
    find_widest_gap,
    make_safety_check,
    normalize_log_likelihoods,
)
from knowledge_sources.methods.localization.refinement import refine_pose, refine_view_motions
from knowledge_sources.methods.localization.views import align_headings
from knowledge_sources.methods.verification import predict_lines
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
CAMERA, MOUNT = Camera.from_field_of_view(math.radians(65.0)), CameraMount(1.0, 0.1)
HERE = Pose2(0.0, 0.0, 0.0)
seeds = st.integers(0, 2**32 - 1)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(Pose2, st.floats(-3, 3), st.floats(-3, 3), angles)


def robot_in(world_name: str) -> RobotModel:
    return RobotModel(load_world(WORLDS / f"{world_name}.toml"), CAMERA, MOUNT, ActuatorModel())


CENTRE = robot_in("research_center")
SYMMETRIC = generated_floor(11, 4, symmetric=True)
SYMMETRIC_ROBOT = RobotModel(SYMMETRIC.world, CAMERA, MOUNT, ActuatorModel())


def seen_from(robot: RobotModel, pose: Pose2, rng: np.random.Generator) -> Floats:
    """Segments as a line finder would find them: a tenth missing, ends cut, a third of a pixel off, and clutter."""
    lines = predict_lines(robot, pose).segments_px
    kept = lines[rng.random(len(lines)) > 0.1]
    cut = rng.uniform(0.0, 0.15, (len(kept), 2, 1))
    along = kept[:, 1] - kept[:, 0]
    ends = np.stack([kept[:, 0] + cut[:, 0] * along, kept[:, 1] - cut[:, 1] * along], axis=1)
    middle, angle = rng.uniform(20, 490, (6, 2)), rng.uniform(0, math.pi, 6)
    half = rng.uniform(8, 30, 6)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([ends + rng.normal(0.0, 0.3, ends.shape), np.stack([middle - half, middle + half], axis=1)])


# -- weights ---------------------------------------------------------------------------------------------------------


@given(values=st.lists(st.floats(-200, 200), min_size=1, max_size=12), seed=seeds)
def test_weights_sum_to_one_and_do_not_depend_on_the_order(values: list[float], seed: int) -> None:
    weights = normalize_log_likelihoods(values)
    assert math.fsum(weights) == pytest.approx(1.0)
    order = np.random.default_rng(seed).permutation(len(values))
    assert normalize_log_likelihoods([values[i] for i in order]) == pytest.approx([weights[i] for i in order])
    likeliest = max(range(len(values)), key=values.__getitem__)
    assert weights[likeliest] == max(weights)


# -- the choice of the next view -------------------------------------------------------------------------------------


def made_up_view(pose: Pose2) -> Floats:
    """Lines that depend on the pose, the same for the same one."""
    rng = np.random.default_rng([int(1e3 * (pose.x_m + 50)), int(1e3 * (pose.y_m + 50)),
                                 int(1e3 * (wrap_angle(pose.heading_rad) + 4))])
    a = rng.uniform(0, 400, (int(rng.integers(0, 12)), 2))
    return np.stack([a, a + rng.uniform(-90, 90, a.shape)], axis=1)


@settings(deadline=None, max_examples=25)
@given(where=st.lists(poses, min_size=1, max_size=4), looked=st.lists(angles, max_size=3), odd=st.booleans())
def test_the_next_view_is_the_one_that_separates_the_hypotheses_best(
    where: list[Pose2], looked: list[float], odd: bool
) -> None:
    places = [PoseHypothesis("room", pose, 1.0 / len(where)) for pose in where]
    looks = [HERE, *(Pose2(0.0, 0.0, a) for a in looked)]

    def is_safe(place: PoseHypothesis, probe: SensingAction) -> bool:
        return (place.world_from_robot.x_m > 0.0) is odd

    best = choose_sensing_action(places, looks, made_up_view, is_safe)
    assume(best is not None and best.expected_separation > 0.0)
    assert best is not None
    expected = []
    for degrees in (180, 90, -90, 135, -135, 45, -45):
        turn = math.radians(degrees)
        if all(abs(wrap_angle(turn - look.heading_rad)) >= math.radians(30) for look in looks):
            expected.append(oracle(places, turn, 0.0))
    if all(is_safe(place, best) for place in places):
        expected += [oracle(places, math.radians(degrees), 0.6) for degrees in (0, 90, -90, 180)]
    assert best.expected_separation == pytest.approx(max(expected))
    assert best.expected_separation == pytest.approx(oracle(places, best.turn_rad, best.move_m))


def oracle(places: list[PoseHypothesis], turn_rad: float, move_m: float) -> float:
    views = [made_up_view(p.world_from_robot @ Pose2(0.0, 0.0, turn_rad) @ Pose2(move_m, 0.0, 0.0)) for p in places]
    total = 0.0
    for i, one in enumerate(places):
        total += one.weight * 0.1 * min(20, len(views[i]))
        for j, other in enumerate(places[:i]):
            total += one.weight * other.weight * min(20.0, compute_view_difference(views[i], views[j]))
    return total


@given(seed=seeds)
def test_equal_views_do_not_separate_hypotheses(seed: int) -> None:
    pose = Pose2(*np.random.default_rng(seed).uniform(-3, 3, 3))
    view = made_up_view(pose)
    assert compute_view_difference(view, view) == pytest.approx(0.0)
    assert compute_view_difference(view, np.zeros((0, 2, 2))) == len(view)
    assert compute_separation([view, view], [0.5, 0.5]) == pytest.approx(0.1 * min(len(view), 20))


@given(looked=st.lists(angles, min_size=1, max_size=6))
def test_the_widest_gap_is_as_far_as_can_be_from_every_look(looked: list[float]) -> None:
    def nearest(turn: float) -> float:
        return min(abs(wrap_angle(turn - a)) for a in looked)

    chosen = nearest(find_widest_gap([Pose2(0.0, 0.0, a) for a in looked]))
    assert all(nearest(turn) <= chosen + 1e-9 for turn in np.linspace(-math.pi, math.pi, 73))


@settings(deadline=None, max_examples=40)
@given(seed=seeds)
def test_a_sensing_move_is_collision_free_from_every_hypothesis(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = []
    for room in rng.choice(CENTRE.world.rooms, 2):
        spots = get_visibility_map(CENTRE.world, str(room), 1.0).positions
        x, y = spots[int(rng.integers(len(spots)))]
        places.append(PoseHypothesis(str(room), Pose2(x, y, float(rng.uniform(-3, 3))), 0.5))
    looks = [Pose2(0.0, 0.0, a) for a in np.radians([0, 60, 120, 180, -60, -120])]  # no turn is left
    probe = choose_sensing_action(places, looks, made_up_view, make_safety_check(CENTRE))
    for place in places if probe is not None else ():
        assert probe.move_m > 0.0
        pose = place.world_from_robot
        way = shapely.LineString([pose.position, probe.apply_to(pose).position]).buffer(CENTRE.radius_m)
        assert shapely.Polygon(CENTRE.world.outline(place.room)).covers(way)
        assert not any(shapely.Polygon(o).intersects(way) for o in CENTRE.world.obstacles(place.room))


# -- views related by motions ----------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=40)
@given(seed=seeds)
def test_level_lines_measure_the_heading_modulo_right_angles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    spots = get_visibility_map(CENTRE.world, "conference-room", 1.0).positions
    x, y = spots[int(rng.integers(len(spots)))]
    pose = Pose2(x, y, float(rng.uniform(-math.pi, math.pi)))
    lines = predict_lines(CENTRE, pose)
    ends = lines.lines_world[..., 2]
    level = (np.ptp(ends, axis=1) < 0.01) & (np.abs(ends[:, 0] - 1.0) > 0.3)  # at the eye's height none tells
    assume(np.count_nonzero(level) >= 12)
    found = find_level_direction(lines.segments_px, CAMERA, MOUNT.camera_from_robot)
    assert found is not None
    assert abs(math.remainder(found + pose.heading_rad, RIGHT_ANGLE_RAD)) < math.radians(1.0)


def test_turns_between_views_are_corrected_by_level_lines() -> None:
    rng, pose, turn = np.random.default_rng(3), Pose2(12.0, 5.0, 0.4), math.radians(95.0)
    claimed = Pose2(0.0, 0.0, -turn + math.radians(6.0))
    second = CameraView(seen_from(CENTRE, pose @ Pose2(0.0, 0.0, turn), rng), HERE, np.zeros((3, 3)))
    for sigma_deg, expected in ((2.0, -turn), (1.0, claimed.heading_rad)):  # the wheels are not so far off
        spread = np.diag([0.0, 0.0, math.radians(sigma_deg)**2])
        first = CameraView(seen_from(CENTRE, pose, rng), claimed, spread)
        straight = align_headings([first, second], CAMERA, MOUNT.camera_from_robot)
        assert straight[0].now_from_then.heading_rad == pytest.approx(expected, abs=math.radians(0.5))


def test_marks_on_a_bare_wall_give_no_heading() -> None:
    rng, found = np.random.default_rng(4), 0
    for _ in range(200):
        middle, angle = rng.uniform(20, 490, (6, 2)), rng.uniform(0, math.pi, 6)
        half = 25.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        marks = np.stack([middle - half, middle + half], axis=1)
        found += find_level_direction(marks, CAMERA, MOUNT.camera_from_robot) is not None
    assert found <= 2


def test_views_are_aligned_with_one_another_where_the_last_shows_a_bare_wall() -> None:
    rng, pose, turn = np.random.default_rng(3), Pose2(12.0, 5.0, 0.4), math.radians(95.0)
    spread = np.diag([0.0, 0.0, 1e-3])
    off = CameraView(seen_from(CENTRE, pose, rng), Pose2(0.0, 0.0, -turn + math.radians(6.0)), spread)
    good = CameraView(seen_from(CENTRE, pose @ Pose2(0.0, 0.0, turn), rng), Pose2(0.0, 0.0, 0.0), spread)
    bare = CameraView(np.zeros((0, 2, 2)), HERE, np.zeros((3, 3)))
    straight = align_headings([off, good, bare], CAMERA, MOUNT.camera_from_robot)
    assert straight[0].now_from_then.heading_rad == pytest.approx(-turn, abs=math.radians(0.5))
    assert 0.0 < straight[0].covariance[2, 2] <= 1e-3
    assert straight[1].now_from_then.heading_rad == pytest.approx(0.0) and straight[2] is bare


@settings(deadline=None, max_examples=20)
@given(error=st.floats(-0.15, 0.15), turn=angles, move=st.floats(0.0, 0.7))
def test_a_corrected_turn_also_corrects_the_move_after_it(error: float, turn: float, move: float) -> None:
    rng, start = np.random.default_rng(3), Pose2(12.0, 5.0, 0.4)
    true = Pose2(0.0, 0.0, turn) @ Pose2(move, 0.0, 0.0)
    now = start @ true
    lines = [seen_from(CENTRE, start, rng), seen_from(CENTRE, now, rng)]
    assume(all(find_level_direction(seen, CAMERA, MOUNT.camera_from_robot) is not None for seen in lines))
    claimed = Pose2(0.0, 0.0, turn + error) @ Pose2(move, 0.0, 0.0)
    spread = np.diag([1e-3, 1e-3, 1e-2])
    views = [CameraView(lines[0], claimed.inverse(), spread), CameraView(lines[1], HERE, spread)]
    straight = align_headings(views, CAMERA, MOUNT.camera_from_robot)
    assert straight[0].now_from_then.distance_to(true.inverse()) < 0.01


@settings(deadline=None, max_examples=20)
@given(error=st.floats(-0.06, 0.06), turn=angles, heading=angles)
def test_an_uncertain_turn_is_corrected_and_not_the_pose(error: float, turn: float, heading: float) -> None:
    rng, before = np.random.default_rng(3), Pose2(12.0, 5.0, heading)
    pose = before @ Pose2(0.0, 0.0, turn)
    assume(all(len(predict_lines(CENTRE, there)) >= 20 for there in (before, pose)))
    looks = [CameraView(seen_from(CENTRE, before, rng), Pose2(0.0, 0.0, -turn + error), np.diag([1e-6, 1e-6, 0.05**2])),
             CameraView(seen_from(CENTRE, pose, rng), HERE, np.zeros((3, 3)))]
    there, covariance = refine_pose(CENTRE, looks, pose)
    assert there.distance_to(pose) < 0.02
    assert abs(wrap_angle(there.heading_rad - pose.heading_rad)) < math.radians(0.3)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0
    corrected = refine_view_motions(CENTRE, looks, there, covariance)[0].now_from_then.heading_rad
    assert abs(wrap_angle(corrected + turn)) < math.radians(0.5)


# -- what is visible -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("room", ["robot-laboratory", "hallway"])
def test_the_visibility_map_agrees_with_the_exact_computation(room: str) -> None:
    room_map = get_visibility_map(CENTRE.world, room, 1.0)
    agree = []
    for square in range(0, len(room_map.first) - 1, 12):
        eye = room_map.eyes[square]
        in_sight = np.zeros(len(room_map.points), bool)
        in_sight[room_map.visible[room_map.first[square]: room_map.first[square + 1]]] = True
        for heading in (0.0, 2.0, 4.0):
            camera_from_world = CENTRE.camera_from_world(Pose2(*eye, heading) @ Pose2(-0.1, 0.0, 0.0))
            ahead = camera_from_world.apply(room_map.points)
            shown = np.flatnonzero(in_sight & (ahead[:, 2] > 0.3))
            px = CAMERA.project(ahead[shown])
            shown = shown[CAMERA.inside(px)]
            agree.append(~find_hidden(CENTRE.world, CAMERA, camera_from_world, room_map.points[shown]))
    assert np.mean(np.concatenate(agree)) > 0.99


# -- never a guess ---------------------------------------------------------------------------------------------------


def views_from(robot: RobotModel, pose: Pose2, turns: tuple[float, ...], seed: int) -> list[CameraView]:
    rng = np.random.default_rng(seed)
    now = pose @ Pose2(0.0, 0.0, turns[-1])
    return [CameraView(seen_from(robot, there, rng), now.inverse() @ there, np.diag([1e-5, 1e-5, 1e-4]))
            for there in (pose @ Pose2(0.0, 0.0, turn) for turn in turns)]


@settings(deadline=None, max_examples=4)
@given(seed=st.integers(0, 10_000), part=st.floats(0.12, 0.88), heading=angles)
def test_in_a_corridor_that_looks_the_same_from_both_ends_it_never_says_where_it_is(
    seed: int, part: float, heading: float
) -> None:
    outline = SYMMETRIC.world.outline("corridor-0")
    low, high = outline.min(axis=0), outline.max(axis=0)
    pose = Pose2(low[0] + part * (high[0] - low[0]), 0.5 * (low[1] + high[1]) + 0.3, heading)
    rooms = list(SYMMETRIC.world.rooms)
    for turns in ((0.0, math.pi), (0.0, 1.5, 3.0, 4.5)):
        found = localize(SYMMETRIC_ROBOT, views_from(SYMMETRIC_ROBOT, pose, turns, seed), rooms)
        assert found.status is not LocalizationStatus.FOUND
    assert len(found.candidates) >= 2
    turned = Pose2(*(low + high - pose.position), wrap_angle(pose.heading_rad + turns[-1] + math.pi))
    assert any(c.world_from_robot.distance_to(turned) < 0.1 for c in found.candidates)


@settings(deadline=None, max_examples=6)
@example(part=0.05, heading=1.36, turn=math.pi)  # few lines are in sight
@given(part=st.floats(0.05, 0.95), heading=angles, turn=angles)
def test_the_alias_of_a_place_is_found_from_the_model_alone(part: float, heading: float, turn: float) -> None:
    outline = SYMMETRIC.world.outline("corridor-0")
    low, high = outline.min(axis=0), outline.max(axis=0)
    pose = Pose2(low[0] + part * (high[0] - low[0]), 0.5 * (low[1] + high[1]) + 0.3, heading)
    nothing = np.zeros((0, 2, 2))  # whatever was seen, it is not asked
    looks = [CameraView(nothing, Pose2(0.0, 0.0, a), np.diag([1e-5, 1e-5, 1e-4])) for a in (turn, turn + 1.0, 0.0)]
    turned = Pose2(*(low + high - pose.position), wrap_angle(heading + math.pi))
    assume(pose.distance_to(turned) > 0.5)
    found = find_aliases(SYMMETRIC_ROBOT, looks, pose, list(SYMMETRIC.world.rooms))
    assert any(c.world_from_robot.distance_to(turned) < 0.02 for c in found)


@settings(deadline=None, max_examples=4)
@given(seed=st.integers(0, 10_000), heading=angles)
def test_in_a_building_that_differs_everywhere_it_says_where_it_is(seed: int, heading: float) -> None:
    rng = np.random.default_rng(seed)
    spots = get_visibility_map(CENTRE.world, "robot-laboratory", 1.0).positions
    x, y = spots[int(rng.integers(len(spots)))]
    pose, turns = Pose2(x, y, heading), (0.0, math.pi, 0.5 * math.pi, -0.5 * math.pi)
    found = localize(CENTRE, views_from(CENTRE, pose, turns, seed), list(CENTRE.world.rooms))
    assert found.status is LocalizationStatus.FOUND and found.candidates[0].room == "robot-laboratory"
    assert found.candidates[0].world_from_robot.distance_to(pose) < 0.05


@settings(deadline=None, max_examples=8)
@given(seed=st.integers(0, 10_000), part=st.floats(0.2, 0.8), heading=angles, off=st.floats(-0.3, 0.3),
       turned=st.floats(-0.06, 0.06))
@example(seed=1, part=0.4, heading=0.0, off=0.13, turned=0.056)
def test_a_guess_beside_the_right_place_does_not_hide_it(
    seed: int, part: float, heading: float, off: float, turned: float
) -> None:
    """From a pose that is little off, refining may end at a wrong one near the right one."""
    corners = np.array(CENTRE.world.outline("hallway"))
    x_m, y_m = corners.min(axis=0) + np.array([part, 0.35]) * np.ptp(corners, axis=0)
    pose = Pose2(x_m, y_m, heading)
    views = views_from(CENTRE, pose, (math.pi / 2, 0.0), seed)
    guess = Pose2(x_m + off, y_m - off / 2, heading + turned)
    alone, told = (localize(CENTRE, views, ["hallway"], guess=by) for by in (None, ("hallway", guess)))
    assume(alone.candidates)
    best, told_best = alone.candidates[0], told.candidates[0]
    assert told_best.likelihood.log_likelihood >= best.likelihood.log_likelihood - 1e-6
    for i, one in enumerate(told.candidates):
        assert all(are_distinct(one.world_from_robot, other.world_from_robot) for other in told.candidates[:i])


def test_refining_that_makes_a_place_worse_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    pose, aside = Pose2(5.0, 1.0, 0.3), np.diag([1e-6, 1e-6, 1e-6])
    views = views_from(CENTRE, pose, (math.pi / 2, 0.0), 3)
    monkeypatch.setattr(refinement, "refine_pose", lambda r, v, p: (p @ Pose2(0.05, 0.0, 0.03), aside))
    told = localize(CENTRE, views, ["hallway"], guess=("hallway", pose))
    (kept,) = [c for c in told.candidates if c.world_from_robot == pose]
    assert kept.covariance[0, 0] > 0.04**2  # and known no better than to where it would move
