"""Laws of the alignment of a belief to the model's edges, on rendered pictures of the research center."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from consistency import compute_error
from knowledge_sources.methods.arrays import Floats, Image
from knowledge_sources.methods.features import read_picture
from knowledge_sources.methods.motion import compute_free_space
from knowledge_sources.methods.tracking import align_to_edges
from knowledge_sources.methods.tracking.edge_alignment import INFLATION, EdgeAlignment, _intersect_lines
from lab_pictures import photograph, robot
from world_models.camera import move_camera
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_lines

KNOWN, TILT = np.zeros((7, 7)), np.array([1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
few = settings(max_examples=30, deadline=None)
seeds = st.integers(0, 2**32 - 1)
ROOMS = ("hallway", "robot-laboratory", "library", "allens-office", "conference-room", "machine-room")


def draw_pose(rng: np.random.Generator) -> Pose2:
    """A pose at which the robot is clear of walls and obstacles, in some room."""
    world, room = robot().world, str(rng.choice(ROOMS))
    free = compute_free_space(world.outline(room), world.obstacles(room), robot().radius_m)
    low, high = np.array(free.bounds).reshape(2, 2)
    while not free.covers(shapely.Point(at := rng.uniform(low, high))):
        pass
    return Pose2(float(at[0]), float(at[1]), float(rng.uniform(-math.pi, math.pi)))


def render(pose: Pose2, rng: np.random.Generator) -> Image:
    return read_picture(photograph(pose, rng)).grey


def draw_belief(pose: Pose2, sigmas: tuple[float, float, float], rng: np.random.Generator) -> tuple[Pose2, Floats]:
    """A belief whose error is drawn from its covariance, three deviations at the most.

    The deviations are along a direction, across it, and of heading.
    """
    angle = rng.uniform(0.0, math.pi)
    turn = np.array([[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0, 0, 1.0]])
    covariance = turn @ np.diag(np.square(sigmas)) @ turn.T
    away = rng.multivariate_normal(np.zeros(3), covariance)
    away *= min(1.0, 3.0 / math.sqrt(away @ np.linalg.solve(covariance, away)))
    return Pose2(pose.x_m + away[0], pose.y_m + away[1], wrap_angle(pose.heading_rad + away[2])), covariance


def align(belief: Pose2, covariance: Floats, image: Image, camera: Floats = KNOWN, of: RobotModel | None = None
          ) -> EdgeAlignment | None:
    seen = of or robot()
    lines = visible_lines(seen.world, seen.camera, seen.camera_from_world(belief), min_length_px=16.0,
                          min_contrast=0.05, max_distance_m=15.0)
    return align_to_edges(seen, image, lines.lines_world, belief, covariance, camera)


def test_however_loose_the_belief_was_it_is_no_further_off_than_it_says() -> None:
    """In 95 of 100 cases within three deviations. Where the next edge need not be a line's own it says nothing."""
    rng = np.random.default_rng(11)
    off_by = []
    for loose in np.linspace(0.0, 1.0, 300) ** 3:
        true = draw_pose(rng)
        sigmas = (0.003 + 0.02 * loose, 0.003 + 0.01 * loose, math.radians(0.15 + 1.7 * loose))
        belief, covariance = draw_belief(true, sigmas, rng)
        found = align(belief, covariance, render(true, rng))
        if found is not None:
            error = compute_error(found.world_from_robot, true)
            assert np.linalg.eigvalsh(found.covariance).min() > 0.0
            off_by.append(math.sqrt(error @ np.linalg.solve(found.covariance, error)))
    assert len(off_by) >= 30
    assert np.mean(np.array(off_by) <= 3.0) >= 0.95


def test_a_nearly_right_belief_is_corrected_to_a_millimetre_or_so() -> None:
    """In most rooms and directions; half of all errors are below a millimetre, and headings below 0.03 degrees."""
    rng = np.random.default_rng(7)
    errors = []
    for _ in range(60):
        true = draw_pose(rng)
        belief, covariance = draw_belief(true, (0.003, 0.003, math.radians(0.15)), rng)
        found = align(belief, covariance, render(true, rng))
        if found is not None:
            errors.append(np.abs(compute_error(found.world_from_robot, true)))
    assert len(errors) >= 20
    x_m, y_m, heading_rad = np.median(errors, axis=0)
    assert math.hypot(x_m, y_m) < 0.001 and heading_rad < math.radians(0.03)


def test_what_is_not_known_of_the_camera_is_not_known_of_the_pose() -> None:
    """With another tilt it would be elsewhere, and the covariance grows by about as much, never beyond the belief's."""
    rng = np.random.default_rng(3)
    true = draw_pose(rng)
    image, sure = render(true, rng), 0.003**2 * np.eye(3)
    here, unsure = align(true, sure, image), align(true, sure, image, np.diag(np.square(TILT)))
    other = align(true, sure, image, of=replace(robot(), mount=move_camera(robot().camera, robot().mount, TILT)[1]))
    assert here is not None and unsure is not None and other is not None
    off, grown = compute_error(other.world_from_robot, here.world_from_robot), unsure.covariance - here.covariance
    assert 0.3 < math.sqrt(np.trace(grown[:2, :2])) / math.hypot(*off[:2]) < 2.0
    assert np.all(np.linalg.eigvalsh(sure + INFLATION - unsure.covariance) > 0.0)


@few
@given(seed=seeds)
def test_a_blank_picture_gives_no_alignment(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief, covariance = draw_belief(draw_pose(rng), (0.003, 0.003, math.radians(0.15)), rng)
    assert align(belief, covariance, np.full((512, 512), int(rng.integers(256)), np.uint8)) is None


@pytest.mark.parametrize("loose", [0.05, 0.2])
def test_a_belief_far_too_loose_is_left_alone(loose: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        true = draw_pose(rng)
        assert align(true, np.diag(np.square([loose, loose, loose])), render(true, rng)) is None


@few
@given(seeds, st.floats(0.0, 1.0))
def test_a_part_of_a_line_in_the_picture_is_that_part_of_it_in_space(seed: int, part: float) -> None:
    """By perspective: the point that is meant is seen where it should be between the ends, and lies on the line."""
    rng = np.random.default_rng(seed)
    pose = Pose2(rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0))
    ahead = rng.uniform((1.0, -0.8, 0.0), (9.0, 0.8, 2.0), (6, 2, 3))
    lines = pose.lifted().apply(ahead.reshape(-1, 3)).reshape(-1, 2, 3)
    points = _intersect_lines(robot(), lines, pose, np.full(6, part))
    sees = robot().camera_from_world(pose)
    ends_px = robot().camera.project(sees.apply(lines.reshape(-1, 3))).reshape(-1, 2, 2)
    seen = robot().camera.project(sees.apply(points))
    assert np.allclose(seen, (1.0 - part) * ends_px[:, 0] + part * ends_px[:, 1], atol=1e-6)
    along, to = lines[:, 1] - lines[:, 0], points - lines[:, 0]
    assert np.allclose(np.cross(along, to), 0.0, atol=1e-6)
