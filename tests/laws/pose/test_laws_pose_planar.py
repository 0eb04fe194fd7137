"""Laws of the pose solvers on the floor, with scipy's least squares as an oracle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from consistency import build_hall, compute_error
from knowledge_sources.methods.pose import (
    build_line_set,
    compute_camera_poses,
    compute_image_jacobian,
    planar_from_lines,
    planar_from_points,
)
from knowledge_sources.methods.pose.planar import build_planar_prior
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(np.radians(65.0))
MOUNT = CameraMount(1.0, 0.1, 0.05).camera_from_robot
SIGMA_PX = 0.3
PRIOR = np.diag([0.2, 0.2, 0.05]) ** 2

seeds = st.integers(0, 2**32 - 1)
headings = st.floats(-3.14, 3.14)
quick = settings(max_examples=15, deadline=None)
Array = NDArray[np.float64]


def observe(truth: Pose2, seed: int) -> tuple[Array, Array, np.random.Generator]:
    """Lines and noisy segments of what is in view."""
    rng = np.random.default_rng(seed)
    lines = truth.lifted().apply(build_hall())
    segments, visible = CAMERA.project_segments(lines, MOUNT @ truth.lifted().inverse())
    lines, segments = lines[visible], segments[visible]
    return lines, segments + rng.normal(0.0, SIGMA_PX, segments.shape), rng


def draw_prior(truth: Pose2, rng: np.random.Generator, share: float = 1.0) -> Pose2:
    dx, dy, turn = share * rng.uniform(-1.0, 1.0, 3) * (0.3, 0.3, 0.1)
    return Pose2(truth.x_m + dx, truth.y_m + dy, truth.heading_rad + turn)


@given(heading=headings, seed=seeds)
@quick
def test_lines_agree_with_scipy_s_least_squares(heading: float, seed: int) -> None:
    truth = Pose2(4.0, -2.0, heading)
    lines, segments, rng = observe(truth, seed)
    prior = draw_prior(truth, rng)
    found = planar_from_lines(
        lines, segments, CAMERA, MOUNT, prior, prior_covariance=PRIOR, sigma_px=SIGMA_PX, robust=False
    )
    prepared = build_line_set(lines, segments, CAMERA, SIGMA_PX)
    root = np.linalg.cholesky(np.linalg.inv(PRIOR)).T

    def residuals(state: Any) -> Array:
        image = compute_image_jacobian(prepared, *compute_camera_poses(np.asarray(state), MOUNT))[0] / SIGMA_PX
        belief = root @ compute_error(Pose2(*state), prior)
        return np.concatenate([image.ravel(), belief])

    start = (truth.x_m, truth.y_m, truth.heading_rad)
    oracle = least_squares(residuals, start, x_scale=(1.0, 1.0, 0.1), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    assert np.abs(compute_error(found.world_from_robot, Pose2(*oracle.x))).max() < 1e-5


@given(heading=headings, seed=seeds)
@settings(max_examples=15, deadline=None, derandomize=True)
def test_gross_outliers_do_not_move_the_robot(heading: float, seed: int) -> None:
    """40 % of the lines anywhere: an error of millimetres and a tenth of a degree, and each of them is rejected."""
    truth = Pose2(4.0, -2.0, heading)
    lines, segments, rng = observe(truth, seed)
    wrong = rng.permutation(len(lines))[: int(0.4 * len(lines))]
    segments[wrong] = rng.uniform(0.0, 511.0, (len(wrong), 2, 2))
    prior = draw_prior(truth, rng)
    found = planar_from_lines(lines, segments, CAMERA, MOUNT, prior, prior_covariance=PRIOR, sigma_px=SIGMA_PX)
    error = np.abs(compute_error(found.world_from_robot, truth))
    assert error[:2].max() < 0.02 and error[2] < 0.002
    gross = np.abs(found.residuals_px).max(axis=1) > 10.0 * SIGMA_PX
    assert not np.any(found.inliers & gross) and all(found.rejected[i] for i in np.flatnonzero(gross))


@given(heading=headings, seed=seeds)
@quick
def test_order_and_ends_of_the_lines_do_not_matter(heading: float, seed: int) -> None:
    truth = Pose2(4.0, -2.0, heading)
    lines, segments, rng = observe(truth, seed)
    prior, order = draw_prior(truth, rng), rng.permutation(len(lines))
    first = planar_from_lines(lines, segments, CAMERA, MOUNT, prior, prior_covariance=PRIOR, sigma_px=SIGMA_PX)
    second = planar_from_lines(
        lines[order][:, ::-1], segments[order], CAMERA, MOUNT, prior, prior_covariance=PRIOR, sigma_px=SIGMA_PX
    )
    assert np.abs(compute_error(first.world_from_robot, second.world_from_robot)).max() < 1e-6
    assert np.array_equal(first.inliers[order], second.inliers)


@given(heading=headings, turn=headings, seed=seeds)
@quick
def test_moving_the_world_moves_the_robot_with_it(heading: float, turn: float, seed: int) -> None:
    truth = Pose2(4.0, -2.0, heading)
    lines, segments, rng = observe(truth, seed)
    prior, moved = draw_prior(truth, rng), Pose2(3.0, 5.0, turn)
    first = planar_from_lines(lines, segments, CAMERA, MOUNT, prior, sigma_px=SIGMA_PX)
    second = planar_from_lines(
        moved.lifted().apply(lines), segments, CAMERA, MOUNT, moved @ prior, sigma_px=SIGMA_PX
    )
    assert np.abs(compute_error(moved @ first.world_from_robot, second.world_from_robot)).max() < 1e-6


@given(heading=headings, count=st.integers(0, 2), seed=seeds)
@settings(max_examples=40, deadline=None)
def test_few_lines_never_make_a_prior_worse(heading: float, count: int, seed: int) -> None:
    """Exact lines, small errors, measured by the prior's information."""
    truth = Pose2(4.0, -2.0, heading)
    rng = np.random.default_rng(seed)
    lines = truth.lifted().apply(build_hall())
    segments, visible = CAMERA.project_segments(lines, MOUNT @ truth.lifted().inverse())
    rows = rng.permutation(np.flatnonzero(visible))[:count]
    prior = draw_prior(truth, rng, 0.1)
    for covariance in (PRIOR, None):
        information = build_planar_prior(prior, covariance).information
        found = planar_from_lines(
            lines[rows], segments[rows], CAMERA, MOUNT, prior, prior_covariance=covariance, sigma_px=SIGMA_PX
        )
        before, after = compute_error(prior, truth), compute_error(found.world_from_robot, truth)
        assert after @ information @ after <= before @ information @ before * 1.05 + 1e-9


@pytest.mark.parametrize("count", [1, 3])
@given(heading=headings, seed=seeds)
@settings(max_examples=15, deadline=None, derandomize=True)
def test_few_noisy_lines_never_make_a_prior_without_covariance_worse(count: int, heading: float, seed: int) -> None:
    """Measured by the information of a weak prior."""
    truth = Pose2(4.0, -2.0, heading)
    lines, segments, rng = observe(truth, seed)
    rows = rng.permutation(len(lines))[:count]
    prior = draw_prior(truth, rng)
    found = planar_from_lines(lines[rows], segments[rows], CAMERA, MOUNT, prior, sigma_px=SIGMA_PX)
    information = build_planar_prior(prior, None).information
    before, after = compute_error(prior, truth), compute_error(found.world_from_robot, truth)
    assert after @ information @ after <= before @ information @ before * 1.05 + 1e-9


@given(heading=headings, seed=seeds)
@quick
def test_points_with_outliers(heading: float, seed: int) -> None:
    truth = Pose2(4.0, -2.0, heading)
    rng = np.random.default_rng(seed)
    world = truth.lifted().apply(rng.uniform((3.0, -1.2, 0.0), (9.0, 1.2, 2.2), (24, 3)))
    camera_from_world = MOUNT @ truth.lifted().inverse()
    pixels = CAMERA.project(camera_from_world.apply(world)) + rng.normal(0.0, SIGMA_PX, (24, 2))
    pixels[:6] += rng.uniform(20.0, 60.0, (6, 2)) * rng.choice([-1.0, 1.0], (6, 2))
    found = planar_from_points(world, pixels, CAMERA, MOUNT, draw_prior(truth, rng, 0.5), PRIOR, sigma_px=SIGMA_PX)
    error = compute_error(found.world_from_robot, truth)
    assert error @ np.linalg.solve(found.covariance, error) < 40.0
    assert not found.inliers[:6].any() and found.inliers[6:].sum() >= 15
    assert all(found.rejected[:6])


@given(heading=headings, seed=seeds)
@quick
def test_camera_poses_of_states_are_those_of_pose2(heading: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    state = np.array([*rng.normal(0.0, 3.0, 2), heading])
    rotation, translation = compute_camera_poses(state, MOUNT)
    expected = MOUNT @ Pose2(*state).lifted().inverse()
    np.testing.assert_allclose(rotation, expected.rotation, atol=1e-12)
    np.testing.assert_allclose(translation, expected.translation, atol=1e-12)
