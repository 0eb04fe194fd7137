"""Laws of the pose with the camera's own state: consistent, no surer than its lines, true in a known camera."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2

from consistency import build_hall, compute_error, compute_nees
from knowledge_sources.methods.calibration import widen
from knowledge_sources.methods.calibration.camera_state import FOCAL, HEIGHT, compute_scale_sigma
from knowledge_sources.methods.localization.camera_matching import compute_space_covariance
from knowledge_sources.methods.pose import CameraEstimate, estimate_camera_and_pose
from world_models.camera import YAW, Camera, CameraMount, move_camera, subtract_cameras
from world_models.entries import CameraState
from world_models.frames import Pose2

CAMERA, MOUNT = Camera.from_field_of_view(np.radians(65.0)), CameraMount(1.0, 0.1, 0.02, 0.01, -0.02)
SIGMA_PX = 0.3
POSE_SIGMA = np.array([0.08, 0.08, 0.05])
CAMERA_SIGMA = np.array([0.026, 0.026, 0.026, 0.04, 0.02, 0.5, 0.5])
SEEN = np.array([i for i in range(7) if i != YAW])
HERE = Pose2(0.3, -0.2, 0.1)
Array = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)
quick = settings(max_examples=15, deadline=None)


def observe(step: Any, seed: int, sigma_px: float = SIGMA_PX) -> tuple[Array, Array, Pose2]:
    """Lines, noisy segments as the true camera shows them, and the true pose."""
    rng = np.random.default_rng(seed)
    off = rng.normal(0.0, POSE_SIGMA)
    truth = Pose2(HERE.x_m + off[0], HERE.y_m + off[1], HERE.heading_rad + off[2])
    camera, mount = move_camera(CAMERA, MOUNT, step)
    lines = build_hall()
    segments, visible = camera.project_segments(lines, mount.camera_from_robot @ truth.lifted().inverse())
    return lines[visible], segments[visible] + rng.normal(0.0, sigma_px, segments[visible].shape), truth


def draw_step(seed: int) -> Array:
    step = np.random.default_rng([seed, 1]).normal(0.0, CAMERA_SIGMA)
    step[YAW] = 0.0
    return step


def estimate(lines: Array, segments: Array, **changed: Any) -> CameraEstimate:
    given = {"sigma_px": SIGMA_PX, "camera_covariance": np.diag(CAMERA_SIGMA**2)} | changed
    covariance = given.pop("camera_covariance")
    return estimate_camera_and_pose(lines, segments, CAMERA, MOUNT, HERE, np.diag(POSE_SIGMA**2), covariance, **given)


def test_camera_and_pose_are_within_their_covariance_as_often_as_it_says() -> None:
    camera, pose = [], []
    for seed in range(120):
        step = draw_step(seed)
        lines, segments, truth = observe(step, seed)
        found = estimate(lines, segments)
        off = (found.step - step)[SEEN]
        camera.append(off @ np.linalg.solve(found.covariance[np.ix_(SEEN, SEEN)], off))
        pose.append(compute_nees(compute_error(found.world_from_robot, truth), found.pose_covariance))
    for squares, unknowns in ((camera, len(SEEN)), (pose, 3)):
        low, high = chi2.ppf((0.0005, 0.9995), unknowns * len(squares)) / len(squares)
        assert low < np.mean(squares) < high


@quick
@given(seeds, st.sampled_from((1e-3, 0.1, 1.0)))
def test_it_is_the_maximum_a_posteriori_of_scipy(seed: int, part: float) -> None:
    """Also of a camera that is known better: it stays nearer to what was believed."""
    sigmas = part * CAMERA_SIGMA
    lines, segments, _ = observe(0.5 * part * draw_step(seed), seed)
    found = estimate(lines, segments, camera_covariance=np.diag(sigmas**2))
    free = np.r_[0:3, 3 + SEEN]

    def residuals(values: Array) -> Array:
        full = np.zeros(10)
        full[free] = values
        camera, mount = move_camera(CAMERA, MOUNT, full[3:])
        pose = Pose2(full[0], full[1], full[2])
        ends = (mount.camera_from_robot @ pose.lifted().inverse()).apply(lines[found.inliers])
        px = camera.project(ends)
        along = px[:, 1] - px[:, 0]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
        apart = np.einsum("nj,nej->ne", normal, segments[found.inliers] - px[:, :1]) / SIGMA_PX
        prior = (values - np.r_[HERE.x_m, HERE.y_m, HERE.heading_rad, np.zeros(len(SEEN))]) / np.r_[
            POSE_SIGMA, sigmas[SEEN]]
        return np.concatenate([apart.ravel(), prior])

    here = found.world_from_robot
    start = np.r_[here.x_m, here.y_m, here.heading_rad, found.step[SEEN]]
    oracle = least_squares(residuals, start, x_scale=np.r_[POSE_SIGMA, sigmas[SEEN]], xtol=1e-12, ftol=1e-12).x
    spread = np.sqrt(np.r_[np.diag(found.pose_covariance), np.diag(found.covariance)[SEEN]])
    assert np.all(np.abs(oracle - start) < 0.02 * spread)


@quick
@given(seeds)
def test_wrong_pairs_are_outliers_and_change_nothing_much(seed: int) -> None:
    lines, segments, _ = observe(draw_step(seed), seed)
    clean = estimate(lines, segments)
    wrong = segments.copy()
    spoilt = np.random.default_rng(seed).choice(len(lines), 3, replace=False)
    along = wrong[spoilt, 1] - wrong[spoilt, 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    wrong[spoilt] += 15.0 * across[:, None]
    found = estimate(lines, wrong)
    assert not found.inliers[spoilt].any()
    sigmas = np.sqrt(np.diag(clean.covariance)[SEEN])
    assert np.all(np.abs(found.step - clean.step)[SEEN] < 4.0 * sigmas)


def test_a_camera_is_no_surer_than_the_shift_that_comes_with_it_and_that_the_belief_does_not_leave_open() -> None:
    """Pairs that are wrong alike show a place further on, and with it another focal length."""
    found = estimate(*observe(np.zeros(7), 5)[:2])
    here = found.world_from_robot
    grown = [widen(found, Pose2(here.x_m - off_m, here.y_m, here.heading_rad), sigma**2 * np.eye(3))[4, 4]
             for off_m, sigma in ((0.0, 0.005), (0.05, 0.2), (0.05, 0.005), (-0.05, 0.005))]
    plain = found.covariance[4, 4]
    assert grown[:2] == pytest.approx([plain, plain]) and min(grown[2:]) > 2.0 * plain, np.array(grown) / plain


def test_the_yaw_is_left_as_it_was() -> None:
    lines, segments, _ = observe(draw_step(3), 3)
    found = estimate(lines, segments)
    assert found.step[YAW] == 0.0 and found.covariance[YAW, YAW] == pytest.approx(CAMERA_SIGMA[YAW] ** 2)
    assert not np.delete(found.covariance[YAW], YAW).any()


@quick
@given(seeds)
def test_a_step_of_the_camera_is_what_its_difference_says(seed: int) -> None:
    step = np.random.default_rng(seed).normal(0.0, CAMERA_SIGMA)
    moved = move_camera(CAMERA, MOUNT, step)
    assert np.allclose(subtract_cameras(*moved, CAMERA, MOUNT), step, atol=1e-12)
    back = np.zeros(7)
    back[4] = -step[4] ** 2  # the focal length grows by a factor: (1 + s)(1 - s)
    assert np.allclose(subtract_cameras(*move_camera(*moved, -step), CAMERA, MOUNT), back, atol=1e-9)


@given(st.floats(0.3, 2.0), st.floats(0.001, 0.1), st.floats(0.001, 0.1))
def test_scale_is_known_by_the_focal_length_and_by_the_height_as_a_part_of_it(
    height_m: float, sigma_m: float, focal: float
) -> None:
    known = np.diag(CAMERA_SIGMA**2)
    known[FOCAL, FOCAL], known[HEIGHT, HEIGHT] = focal**2, sigma_m**2
    camera = CameraState(CAMERA, replace(MOUNT, height_m=height_m), covariance=tuple(map(tuple, known.tolist())))
    assert compute_scale_sigma(camera) ** 2 == pytest.approx(focal**2 + (sigma_m / height_m) ** 2)


def test_the_covariance_in_space_is_that_of_drawn_cameras() -> None:
    rng = np.random.default_rng(4)
    small = 0.1 * CAMERA_SIGMA
    covariance = compute_space_covariance(MOUNT, HERE, np.diag((0.1 * POSE_SIGMA) ** 2), np.diag(small**2))
    expected = MOUNT.camera_from_robot @ HERE.lifted().inverse()
    drawn = []
    for _ in range(4000):
        x, y, turn = rng.normal(0.0, 0.1 * POSE_SIGMA)
        _, mount = move_camera(CAMERA, MOUNT, rng.normal(0.0, small))
        pose = Pose2(HERE.x_m + x, HERE.y_m + y, HERE.heading_rad + turn)
        apart = mount.camera_from_robot @ pose.lifted().inverse() @ expected.inverse()
        drawn.append(np.concatenate([apart.rotation_vector, apart.translation]))
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    assert np.allclose(root @ np.cov(np.array(drawn).T) @ root.T, np.eye(6), atol=0.12)


def test_a_covariance_of_another_shape_is_refused() -> None:
    lines, segments, _ = observe(np.zeros(7), 0)
    with pytest.raises(ValueError, match=r"camera_covariance of shape \(7, 7\)"):
        estimate(lines, segments, camera_covariance=np.eye(6))
    assert replace(MOUNT, roll_rad=0.0, yaw_rad=0.0) == CameraMount(1.0, 0.1, 0.02)
