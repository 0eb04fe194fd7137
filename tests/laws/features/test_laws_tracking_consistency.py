"""Laws of how sure a tracked pose is, after one picture and after a chain of them, and of the tolerance made from it.

The robot is put together without pictures: templates are cut where the belief has landmarks, so that what they show is
off by the belief's own error, and stays so until they are cut again.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from consistency import assert_consistent, compute_error, compute_nees
from harvey.simulation.simulated_run import build_robot_model
from knowledge_sources.methods.tracking import (
    TOLERANCE_SIGMAS,
    action_px,
    correct_pose,
    follow_landmarks,
    template_tracking,
)
from knowledge_sources.methods.tracking.template_tracking import (
    MAX_SCALE,
    MAX_SEARCH_PX,
    MIN_SCALE,
    MIN_SEARCH_PX,
    SEARCH_MARGIN_PX,
    SEARCH_SIGMAS,
)
from knowledge_sources.reads.questions import NOWHERE
from knowledge_sources.settings import DEFAULT
from sim.scenario import load_scenario
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.entries import Anchor, Hypothesis, Track, covariance_tuple, diagonal
from world_models.files.world_files import load_world
from world_models.frames import Pose2
from world_models.robot import RobotModel

CAMERA, MOUNT = Camera.from_field_of_view(np.radians(65.0)), CameraMount(1.0, 0.1, 0.05)
ROBOT = RobotModel(NOWHERE, CAMERA, MOUNT, ActuatorModel())
AT_FIRST, STEP = np.diag([0.01, 0.01, 0.02]) ** 2, np.diag([0.01, 0.01, 0.005]) ** 2
SIGMA_PX, LANDMARKS, PICTURES = 0.3, 12, 4
TEMPLATE: Any = None
Array = NDArray[np.float64]


def turn_into_world(heading_rad: float) -> Array:
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def drive(seed: int, legs: int, noise: float) -> list[float]:
    """NEES after each picture: each leg cuts templates where the robot believes to be, and tracks them."""
    rng = np.random.default_rng(seed)
    truth = Pose2(0.0, 0.0, rng.uniform(-3.0, 3.0))
    off = rng.multivariate_normal(np.zeros(3), AT_FIRST)
    belief, covariance = Pose2(off[0], off[1], truth.heading_rad + off[2]), AT_FIRST
    out = []
    for leg in range(legs):
        by_belief, by_truth = (MOUNT.camera_from_robot @ pose.lifted().inverse() for pose in (belief, truth))
        model = belief.lifted().apply(rng.uniform((4.5, -1.2, 0.0), (9.0, 1.2, 2.2), (LANDMARKS, 3)))
        shown = by_truth.inverse().apply(by_belief.apply(model))
        anchor = Anchor(f"frame {leg}", belief.x_m, belief.y_m, covariance_tuple(covariance))
        for _ in range(PICTURES):
            turn, move_m = rng.uniform(-0.05, 0.05), 0.5
            error = rng.multivariate_normal(np.zeros(3), STEP)
            truth = truth @ Pose2(move_m + error[0], error[1], turn + error[2])
            lever = np.eye(3)
            lever[:2, 2] = -move_m * math.sin(belief.heading_rad), move_m * math.cos(belief.heading_rad)
            into = turn_into_world(belief.heading_rad)
            covariance = lever @ covariance @ lever.T + into @ STEP @ into.T
            belief = belief @ Pose2(move_m, 0.0, turn)
            seen_px = CAMERA.project((MOUNT.camera_from_robot @ truth.lifted().inverse()).apply(shown))
            seen_px += rng.normal(0.0, noise * SIGMA_PX, seen_px.shape)
            tracks = [Track("landmark", (x, y, z), anchor.frame, (0.0, 0.0), 1.0, (0.0, 0.0), (u, v), 1.0, SIGMA_PX)
                      for (x, y, z), (u, v) in zip(model.tolist(), seen_px.tolist(), strict=True)]
            found = correct_pose(ROBOT, tracks, (anchor,), belief, covariance)
            belief, covariance = found.world_from_robot, found.covariance
            out.append(compute_nees(compute_error(belief, truth), covariance))
    return out


@pytest.mark.parametrize("noise", [1.0, 1.5, 2.0])
def test_a_tracked_pose_is_as_far_off_as_it_says_after_a_chain_of_pictures(noise: float) -> None:
    """It may say a little too much: the error of where templates were cut is a part of the belief's, and counts twice.
    """
    drives = np.array([drive(seed, 2, noise) for seed in range(100)])
    for column in drives.T:
        assert_consistent(column, 3, most_surplus=1.5)


@pytest.mark.parametrize("slid_px", [0.0, 3.0, 8.0])
def test_how_far_off_a_belief_was_lets_no_landmark_slide(slid_px: float) -> None:
    """Those far ahead tell little of the way, and of the near one something beside is taken for it."""
    belief, covariance = Pose2(0.5, 0.0, 0.0), 25.0 * AT_FIRST
    anchor = Anchor("frame", 0.5, 0.0, covariance_tuple(covariance))
    points = [(3.4, -1.2, 2.1), *((12.0, aside_m, up_m) for aside_m in (-1.0, -0.3, 0.4, 1.1) for up_m in (0.1, 2.6))]
    seen_px = CAMERA.project(ROBOT.camera_from_world(belief).apply(np.array(points))) + np.eye(9, 1) * slid_px * (-1, 1)
    tracks = [Track("landmark", point, "frame", (0.0, 0.0), 1.0, (0.0, 0.0), (u, v), 1.0, SIGMA_PX)
              for point, (u, v) in zip(points, seen_px.tolist(), strict=True)]
    found = correct_pose(ROBOT, tracks, (anchor,), belief, covariance + STEP)
    assert found.world_from_robot.distance_to(belief) < 0.03
    assert covariance[0, 0] < found.covariance[0, 0] < (covariance + 4.0 * STEP)[0, 0]


@cache
def build_robot() -> RobotModel:
    scenario = load_scenario("lab-to-allens-office")
    return build_robot_model(scenario, load_world(scenario.world))


def believe(sigma_m: float, sigma_rad: float) -> Hypothesis:
    return Hypothesis("allens-office", Pose2(2.0, 2.0, 0.7), diagonal(sigma_m, sigma_rad), "odometry")


def compute_tolerance_px(sigma_m: float, sigma_rad: float, ahead_m: float) -> float:
    """With one landmark so far ahead of the camera."""
    robot, belief = build_robot(), believe(sigma_m, sigma_rad)
    from_world = robot.on_floor_of(belief.locale).camera_from_world(belief.world_from_robot(robot.world))
    return action_px(robot, belief, from_world.inverse().apply(np.array([[0.1, 0.0, ahead_m]])))


@pytest.mark.parametrize(
    ("sigma_m", "sigma_rad"), [(0.0, 0.0), (0.01, 0.0), (0.0, 0.005), (0.02, 0.004), (0.03, 0.006), (0.0, 1.0)])
@pytest.mark.parametrize("ahead_m", [2.0, 5.0])
def test_the_tolerance_is_what_the_belief_leaves_open_up_to_the_plans_bound(
    sigma_m: float, sigma_rad: float, ahead_m: float
) -> None:
    """By moving the believed camera by so many deviations, and looking how far the landmark goes in the picture."""
    s, focal_px = DEFAULT.action, build_robot().camera.fx
    aside_px, turned_px = focal_px * sigma_m / ahead_m, focal_px * math.tan(sigma_rad)
    open_px = s.min_tolerance_px + TOLERANCE_SIGMAS * math.hypot(aside_px, turned_px)
    assert compute_tolerance_px(sigma_m, sigma_rad, ahead_m) == pytest.approx(
        min(open_px, DEFAULT.plan.max_deviation_px), rel=1e-3)


@pytest.mark.parametrize("now_m", [1.2, 2.0, 4.0, 6.0, 8.0, 0.5])
def test_what_is_nearer_than_when_its_template_was_cut_is_looked_for_as_much_larger(
    now_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And not at all where it looks too different by that, or where nothing of it is in view."""
    then_m, scales = 3.0, list[float]()
    monkeypatch.setattr(template_tracking, "correlate", lambda *_, scale: scales.append(scale))
    point = (now_m + MOUNT.forward_m, 0.0, 1.0)
    track = Track("a", point, "CameraPicture-1", (0.0, 0.0), then_m, (0.0, 0.0), (1.0, 1.0), 1.0, 0.3)
    image = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
    (update,) = follow_landmarks(ROBOT, (track,), lambda _: TEMPLATE, image, Pose2(0.0, 0.0, 0.0), AT_FIRST)
    depth_m = now_m * math.cos(MOUNT.tilt_rad)
    is_like = MIN_SCALE <= then_m / depth_m <= MAX_SCALE
    assert update.expected == is_like and scales == pytest.approx([then_m / depth_m] * is_like)
    assert update.track.found_px is None and update.track.misses == is_like


@pytest.mark.parametrize("size", [0.01, 0.3, 1.0, 30.0])
@pytest.mark.parametrize("aside_m", [0.0, 0.6, -0.6])
def test_it_is_looked_for_as_far_as_the_belief_may_be_off(
    size: float, aside_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some deviations of where it should be seen, along the picture's worse axis, and a little; derived by steps."""
    windows = list[tuple[float, float, float]]()
    monkeypatch.setattr(template_tracking, "correlate", lambda _, __, at, search, scale: windows.append((*at, search)))
    point, pose, covariance = (3.0, aside_m, 1.3), Pose2(0.1, -0.1, 0.05), size * AT_FIRST
    track = Track("a", point, "CameraPicture-1", (0.0, 0.0), 2.9, (0.0, 0.0), (1.0, 1.0), 1.0, 0.3)
    image = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
    follow_landmarks(ROBOT, (track,), lambda _: TEMPLATE, image, pose, covariance)

    def see(off: Array) -> Array:
        there = Pose2(pose.x_m + off[0], pose.y_m + off[1], pose.heading_rad + off[2])
        return np.asarray(CAMERA.project(ROBOT.camera_from_world(there).apply(np.array([point])))[0])

    slopes = np.stack([(see(step) - see(-step)) / 2e-5 for step in 1e-5 * np.eye(3)], axis=1)
    sigma_px = math.sqrt(max(np.diag(slopes @ covariance @ slopes.T)))
    wanted_px = min(max(SEARCH_SIGMAS * sigma_px + SEARCH_MARGIN_PX, MIN_SEARCH_PX), MAX_SEARCH_PX)
    ((u, v, window_px),) = windows
    assert (u, v) == pytest.approx(tuple(see(np.zeros(3)))) and window_px == pytest.approx(wanted_px, rel=1e-4)
