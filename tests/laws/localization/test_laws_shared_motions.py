"""Laws of views that share motions: their joint covariance, and the covariance of a pose that rests on all of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import chi2

from consistency import compute_error
from knowledge_sources.methods.localization import CameraView, get_visibility_map, propagate_pose
from knowledge_sources.methods.localization.refinement import refine_pose
from knowledge_sources.methods.localization.views import align_headings, join_covariances
from knowledge_sources.methods.verification import predict_lines
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
Steps = list[tuple[float, float]]
ACTUATOR = ActuatorModel()
CAMERA, MOUNT = Camera.from_field_of_view(math.radians(65.0)), CameraMount(1.0, 0.1)
CENTRE = RobotModel(load_world(WORLDS / "research_center.toml"), CAMERA, MOUNT, ACTUATOR)
NOTHING = np.zeros((0, 2, 2))
TURN_AROUND: Steps = [(math.radians(60.0), 0.3), (math.radians(100.0), 0.0), (math.radians(-75.0), 0.5)]
DRAWS = 24


def views_after(steps: Steps, segments: list[Floats]) -> list[CameraView]:
    """One view before every step, and one after the last, as the panorama builder keeps them."""
    views = [CameraView(segments[0], Pose2(0.0, 0.0, 0.0), np.zeros((3, 3)))]
    for k, (turn, move) in enumerate(steps):
        step, spread = ACTUATOR.predict_motion(turn, move), ACTUATOR.motion_covariance(turn, move)
        views = [CameraView(v.segments_px, *propagate_pose(v.now_from_then, v.covariance, step, spread)) for v in views]
        views.append(CameraView(segments[k + 1], Pose2(0.0, 0.0, 0.0), np.zeros((3, 3))))
    return views


def draw_step(turn: float, move: float, rng: np.random.Generator, scale: float = 1.0) -> Pose2:
    """A step as it may have been driven."""
    claimed = ACTUATOR.predict_motion(turn, move)
    off = rng.multivariate_normal(np.zeros(3), scale**2 * ACTUATOR.motion_covariance(turn, move))
    return Pose2(claimed.x_m + off[0], claimed.y_m + off[1], claimed.heading_rad + off[2])


def find_motions(steps: list[Pose2]) -> list[Pose2]:
    """Where the robot was before each step, as seen from where the last one led."""
    back, out = Pose2(0.0, 0.0, 0.0), list[Pose2]()
    for step in reversed(steps):
        back = back @ step.inverse()
        out.append(back)
    return out[::-1]


@settings(deadline=None, max_examples=6)
@given(seed=st.integers(0, 2**32 - 1),
       steps=st.lists(st.tuples(st.floats(-2.5, 2.5), st.floats(0.2, 1.5)), min_size=2, max_size=4))
def test_the_joint_covariance_is_that_of_motions_drawn_at_random(seed: int, steps: Steps) -> None:
    rng, count, scale = np.random.default_rng(seed), 3000, 0.01  # so small that all is linear
    claimed = find_motions([ACTUATOR.predict_motion(*step) for step in steps])
    drawn = []
    for _ in range(count):
        motions = find_motions([draw_step(*step, rng, scale) for step in steps])
        drawn.append(np.concatenate([compute_error(a, b) for a, b in zip(motions, claimed, strict=True)]) / scale)
    measured = np.cov(np.array(drawn).T)
    stated = join_covariances(views_after(steps, [NOTHING] * (len(steps) + 1)))[:-3, :-3]
    sigmas = np.sqrt(np.diag(stated))
    assert np.abs(np.sqrt(np.diag(measured)) / sigmas - 1.0).max() < 0.08
    assert np.abs((measured - stated) / np.outer(sigmas, sigmas)).max() < 0.15


def test_views_that_a_measured_turn_made_surer_still_have_a_joint_covariance() -> None:
    views = views_after(TURN_AROUND, [NOTHING] * 4)
    sure = CameraView(NOTHING, views[0].now_from_then, 0.25 * views[0].covariance)
    joint = join_covariances([sure, *views[1:]])
    assert np.linalg.eigvalsh(joint)[0] > -1e-12
    assert np.linalg.eigvalsh(joint[:3, :3] - sure.covariance)[0] > -1e-12  # never surer than it was told


def lines_from(pose: Pose2, rng: np.random.Generator) -> Floats:
    """The model's lines as they are seen, with the noise across them that is stated."""
    lines = predict_lines(CENTRE, pose).segments_px
    lines = lines[rng.random(len(lines)) > 0.1]
    along = lines[:, 1] - lines[:, 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(lines + 0.3 * rng.standard_normal((len(lines), 2, 1)) * across[:, None])


@pytest.mark.parametrize("blank", [(), (3,), (1, 3)])
def test_the_covariance_of_a_refined_pose_holds_its_error(blank: tuple[int, ...]) -> None:
    """Also where the last views show nothing, and the pose now rests on the motions since the others."""
    spots, squares = get_visibility_map(CENTRE.world, "conference-room", 1.0).positions, []
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed)
        x, y = spots[int(rng.integers(len(spots)))]
        driven = [draw_step(*step, rng) for step in TURN_AROUND]
        true = [Pose2(float(x), float(y), float(rng.uniform(-3.0, 3.0)))]
        for step in driven:
            true.append(true[-1] @ step)
        shown = [NOTHING if k in blank else lines_from(pose, rng) for k, pose in enumerate(true)]
        shown = [lines if len(lines) >= 15 else NOTHING for lines in shown]  # few may be paired wrongly
        rough = Pose2(true[-1].x_m + rng.normal(0.0, 0.05), true[-1].y_m + rng.normal(0.0, 0.05),
                      true[-1].heading_rad + rng.normal(0.0, 0.02))
        views = align_headings(views_after(TURN_AROUND, shown), CAMERA, MOUNT.camera_from_robot)
        pose, covariance = refine_pose(CENTRE, views, rough)
        off = np.array(compute_error(pose, true[-1]))
        squares.append(float(off @ np.linalg.solve(covariance, off)))
    within = sum(s <= chi2.ppf(0.99, 3) for s in squares)
    assert within >= DRAWS - 1, squares
    assert np.mean(np.sort(squares)[:-1]) < chi2.ppf(0.9995, 3 * (DRAWS - 1)) / (DRAWS - 1)
    if blank == (1, 3):  # nor is it far too large where the pose rests on odometry
        assert np.mean(squares) > 0.1


def test_views_that_contradict_one_another_make_the_covariance_larger() -> None:
    rng, pose = np.random.default_rng(5), Pose2(12.0, 5.0, 0.4)
    sure = np.diag([1e-6, 1e-6, 1e-6])
    before = pose @ Pose2(0.0, 0.0, -1.0)
    shown = [lines_from(before, rng), lines_from(pose, rng)]
    agreeing, apart = (
        refine_pose(CENTRE, [CameraView(shown[0], before_now, sure), CameraView(shown[1], Pose2(0, 0, 0), sure)], pose)
        for before_now in (Pose2(0.0, 0.0, -1.0), Pose2(0.04, 0.03, -1.01)))
    assert np.trace(apart[1]) > 2.0 * np.trace(agreeing[1])
