"""Laws of telling a place from those at which its room repeats itself."""

import math
from dataclasses import replace
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from knowledge_sources.methods.localization import aliasing, find_repetitions, list_aliases, precompute_views
from knowledge_sources.methods.localization.aliasing import (
    VIEW_GRID_M,
    VIEW_GRID_RAD,
    AliasView,
    predict_views_on_grid,
    score_view,
)
from knowledge_sources.methods.verification import LINE_TOLERANCE_PX, compute_coverage, predict_lines
from towers import tower
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

Floats = NDArray[np.float64]

WORLD = load_world(WORLDS / "research_center.toml", details=[])
ROBOT = RobotModel(WORLD, Camera.from_field_of_view(math.radians(65.0)), CameraMount(1.0, 0.1), ActuatorModel())
NONE = np.zeros((0, 2, 2))
few = settings(max_examples=40, deadline=None)


def find_strongest(robot: RobotModel, segments_px: Floats, room: str, pose: Pose2) -> AliasView | None:
    """The other pose that the picture speaks least against; None if there is no other."""
    return min(list_aliases(robot, segments_px, room, pose), key=lambda alias: alias.margin, default=None)


def margin(one: Floats, other: Floats, seen: Floats) -> float:
    """Of two views, by what was seen."""
    return aliasing.compute_margin(*(
        score_view(view, np.full(len(view), LINE_TOLERANCE_PX), seen) for view in (one, other)))


@st.composite
def segments(draw: st.DrawFn) -> Floats:
    """(n, 2, 2) of 15 px and more."""
    n = draw(st.integers(0, 12))
    middles = draw(hnp.arrays(float, (n, 2), elements=st.floats(60.0, 450.0)))
    angles = draw(hnp.arrays(float, n, elements=st.floats(0.0, math.pi)))
    halves = draw(hnp.arrays(float, n, elements=st.floats(7.5, 50.0)))
    along = halves[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.stack([middles - along, middles + along], axis=1)


@few
@given(segments(), segments(), segments())
def test_the_margin_is_antisymmetric(one: Floats, other: Floats, seen: Floats) -> None:
    assert margin(one, other, seen) == pytest.approx(-margin(other, one, seen), abs=1e-9)


@few
@given(segments(), segments(), segments(), st.randoms(use_true_random=False))
def test_the_order_of_lines_and_segments_does_not_matter(
    one: Floats, other: Floats, seen: Floats, random: Random
) -> None:
    def mixed(lines: Floats) -> Floats:
        order = list(range(len(lines)))
        random.shuffle(order)
        return lines[order]

    assert margin(mixed(one), mixed(other), mixed(seen)) == pytest.approx(margin(one, other, seen), abs=1e-9)


@few
@given(segments(), segments())
def test_the_same_view_from_two_poses_has_no_margin(one: Floats, seen: Floats) -> None:
    assert margin(one, one, seen) == pytest.approx(0.0, abs=1e-9)


@few
@given(segments())
def test_lines_of_one_view_only_support_it_where_they_are_seen_and_oppose_it_where_not(one: Floats) -> None:
    half = 0.5 * float(np.sum(np.minimum(np.linalg.norm(one[:, 1] - one[:, 0], axis=1), 100.0) / 30.0))
    assert margin(one, NONE, one) == pytest.approx(half, abs=1e-9)
    assert margin(one, NONE, NONE) == pytest.approx(-half, abs=1e-9)


def test_in_the_middle_of_the_hallway_the_opposite_direction_is_told_apart() -> None:
    """What should be seen in one direction is not what should be seen from where the hallway repeats itself."""
    here = Pose2(*WORLD.world_from_locale("hallway").apply([6.0, 1.2, 0.0])[:2], 0.0)
    seen = predict_lines(ROBOT, here).segments_px
    found = find_strongest(ROBOT, seen, "hallway", here)
    assert found is not None and found.margin > 1.0
    from_there = find_strongest(ROBOT, predict_lines(ROBOT, found.world_from_robot).segments_px, "hallway", here)
    assert from_there is not None and from_there.margin < 0.0


def test_lines_visible_from_the_grid_are_projected_to_where_they_are_seen_from_the_pose() -> None:
    """Exactly on the grid; between its poses at least nine tenths of the length, but for one pose in twenty."""
    rng, shares = np.random.default_rng(0), []
    for _ in range(200):
        x, y = WORLD.world_from_locale("hallway").apply([rng.uniform(3.0, 18.0), 1.2, 0.0])[:2]
        pose = Pose2(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))
        steps = VIEW_GRID_M, VIEW_GRID_M, VIEW_GRID_RAD
        of_grid = Pose2(*(round(v / by) * by for v, by in zip(
            (pose.x_m, pose.y_m, pose.heading_rad), steps, strict=True)))
        (on_grid, _), (between, _) = predict_views_on_grid(ROBOT, [of_grid, pose])
        assert on_grid == pytest.approx(predict_lines(ROBOT, of_grid).segments_px, abs=1e-6)
        exact = predict_lines(ROBOT, pose).segments_px
        length = np.linalg.norm(exact[:, 1] - exact[:, 0], axis=1)
        covered = np.nan_to_num(compute_coverage(exact, between, 0.5, 0.06))
        shares.append(float(np.sum(length * covered) / np.sum(length)))
    assert np.quantile(shares, 0.05) >= 0.9
    assert np.quantile(shares, 0.01) >= 0.7
    assert min(shares) >= 0.5


def test_computing_views_beforehand_changes_no_answer() -> None:
    here = Pose2(*WORLD.world_from_locale("hallway").apply([7.31, 1.17, 0.0])[:2], 0.013)
    seen = predict_lines(ROBOT, here).segments_px
    world = load_world(WORLDS / "research_center.toml", details=[])
    asked = RobotModel(world, ROBOT.camera, ROBOT.mount, ROBOT.actuator)
    precompute_views(asked, "hallway", here @ Pose2(0.02, -0.01, 0.004))
    assert find_strongest(asked, seen, "hallway", here) == find_strongest(ROBOT, seen, "hallway", here)


@few
@given(st.sampled_from(WORLD.rooms), st.integers(0, 2**32 - 1))
def test_a_pose_at_a_door_is_repeated_at_each_other_door_of_its_room(room: str, seed: int) -> None:
    """A pose at one door is repeated at each other door of the room, as far from it and facing it alike."""
    doors = [doorway.pose_from(room) for doorway in WORLD.doorways_of(room)]
    rng = np.random.default_rng(seed)
    pose = doors[0] @ Pose2(-0.2, float(rng.uniform(-0.2, 0.2)), float(rng.uniform(-math.pi, math.pi)))
    offset = doors[0].inverse() @ pose
    repeated = [other for name, other in find_repetitions(WORLD, room, pose, (room,)) if name == room]
    for door in doors[1:]:
        there = door @ offset
        assert any(other.distance_to(there) < 1e-9 and abs(wrap_angle(other.heading_rad - there.heading_rad)) < 1e-9
                   for other in repeated)


def test_the_same_place_on_another_floor_or_with_another_camera_is_another_view() -> None:
    """Each question has its own answer, whatever was asked before: floor, and lens."""
    tall = read_world(Source.parse(tower(2), "tower.toml"))
    robot = RobotModel(tall, Camera.from_field_of_view(math.radians(65.0)), CameraMount(1.0, 0.1), ActuatorModel())
    wide = Camera.from_field_of_view(math.radians(80.0))
    asked = [robot.on_floor_of("hall-1"), robot.on_floor_of("hall-2"),
             RobotModel(tall, wide, robot.mount, ActuatorModel()).on_floor_of("hall-1")]
    pose = Pose2(9.0, -0.7, 2.9)
    plain = []
    for one in asked:
        fresh = replace(one, world=read_world(Source.parse(tower(2), "tower.toml")))
        plain.append(predict_views_on_grid(fresh, [pose])[0][0])
    for one, wanted in (*zip(asked, plain, strict=True), *zip(asked[::-1], plain[::-1], strict=True)):
        ((found, _),) = predict_views_on_grid(one, [pose])
        assert found.shape == wanted.shape and np.allclose(found, wanted)
    assert all(a.shape != b.shape or not np.allclose(a, b) for k, a in enumerate(plain) for b in plain[:k])
