"""Laws of the two sets of pose unknowns, and of the compiled pairs that use them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from knowledge_sources.methods.matching import build_camera_parameters
from knowledge_sources.methods.matching.pose_matching import (
    GRID_PX,
    GRID_SIGMAS,
    MAX_GRID_STEPS,
    PoseParameters,
    build_floor_parameters,
    build_scene,
    linearise_pairs,
)
from knowledge_sources.methods.matching.search import POSE_STEP
from knowledge_sources.methods.pose import build_line_set, compute_image_jacobian
from knowledge_sources.methods.pose.planar import compute_line_jacobian
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose, Pose2

Array = NDArray[np.float64]
CAMERA = Camera.from_field_of_view(np.radians(65.0))
MOUNT = CameraMount(1.0, 0.1).camera_from_robot
seeds = st.integers(0, 2**32 - 1)
some = settings(max_examples=25, deadline=None)


def parametrise(rng: np.random.Generator) -> tuple[PoseParameters, PoseParameters, Pose2]:
    """One of each kind, with the same camera pose for a prior; and the robot's."""
    robot = Pose2(*rng.uniform(-3.0, 3.0, 2), rng.uniform(-3.1, 3.1))
    floor = build_floor_parameters(MOUNT, robot, np.diag(rng.uniform(0.05, 0.3, 3) ** 2))
    return floor, build_camera_parameters(floor.prior, np.diag(rng.uniform(0.02, 0.2, 6) ** 2)), robot


def measure_difference(a: Pose, b: Pose) -> float:
    return float(max(np.abs(a.rotation - b.rotation).max(), np.abs(a.translation - b.translation).max()))


@some
@given(seeds)
def test_the_step_to_a_moved_pose_is_the_step_that_moved_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for parameters in parametrise(rng)[:2]:
        step = rng.uniform(-0.4, 0.4, len(parameters.root))
        there = parameters.move(parameters.prior, step)
        np.testing.assert_allclose(parameters.compute_step(parameters.prior), 0.0, atol=1e-12)
        np.testing.assert_allclose(parameters.compute_step(there)[:3], step[:3], atol=1e-9)
        if len(step) == 3:
            assert measure_difference(parameters.move(parameters.prior, parameters.compute_step(there)), there) < 1e-9


@some
@given(seeds)
def test_the_basis_is_the_derivative_of_the_pose(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for parameters in parametrise(rng)[:2]:
        pose = parameters.move(parameters.prior, rng.uniform(-0.3, 0.3, len(parameters.root)))
        basis = parameters.compute_basis(pose)
        for unknown, step in enumerate(1e-6 * np.eye(len(parameters.root))):
            change = parameters.move(pose, step) @ pose.inverse()
            moved = np.concatenate([change.rotation_vector, change.translation]) / 1e-6
            np.testing.assert_allclose(moved, basis[:, unknown], atol=1e-5)


@some
@given(seeds)
def test_a_robot_on_the_floor_stays_on_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    floor, _, robot = parametrise(rng)
    step = rng.uniform(-1.0, 1.0, 3)
    seen = floor.move(floor.prior, step).inverse() @ MOUNT
    expected = Pose2(robot.x_m + step[0], robot.y_m + step[1], robot.heading_rad + step[2]).lifted()
    assert measure_difference(seen, expected) < 1e-9


@some
@given(seeds, st.tuples(*[st.floats(0.0, 200.0)] * 3))
def test_starts_on_a_floor_leave_no_gap_in_the_picture(seed: int, reach_px: tuple[float, float, float]) -> None:
    starts = parametrise(np.random.default_rng(seed))[0].list_starts(np.array(reach_px))
    assert len(np.unique(starts, axis=0)) == len(starts) <= (2 * MAX_GRID_STEPS + 1) ** 3
    assert 0.0 in np.abs(starts).sum(axis=1)
    for axis, reach in zip(starts.T, reach_px, strict=True):
        places_px = np.unique(axis) * reach
        np.testing.assert_allclose(places_px, -places_px[::-1])
        assert GRID_SIGMAS * reach - places_px[-1] <= 0.25 * GRID_PX
        if len(places_px) <= 2 * MAX_GRID_STEPS:
            assert np.all(np.diff(places_px) <= 1.25 * GRID_PX + 1e-9)


@some
@given(seeds)
def test_the_compiled_pairs_are_those_of_the_pose_solvers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    floor, space, robot = parametrise(rng)
    ahead = rng.uniform((-2.0, -1.5, 3.0), (2.0, 1.5, 9.0), (12, 2, 3))
    model = floor.prior.inverse().apply(ahead)
    data = rng.uniform(0.0, 511.0, (12, 2, 2))
    lines = build_line_set(model, data, CAMERA, 1.0)
    rows = np.arange(12)
    state = np.array([robot.x_m, robot.y_m, robot.heading_rad])
    by_floor = compute_line_jacobian(lines.points[:, 0], lines.directions, lines, state, MOUNT)
    by_space = compute_image_jacobian(lines, space.prior.rotation, space.prior.translation)
    for parameters, (distances, slopes) in ((floor, by_floor), (space, by_space)):
        pairs = linearise_pairs(build_scene(model, data, CAMERA, parameters), parameters.prior, rows, rows)
        np.testing.assert_allclose(pairs.distances, distances, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(pairs.slopes, slopes, rtol=1e-6, atol=1e-4)


@some
@given(seeds, st.sampled_from([3, 6]))
def test_the_closed_fit_is_the_least_squares_solution(seed: int, unknowns: int) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(5, 4 + unknowns, unknowns + 1))
    fits = POSE_STEP.fit(np.swapaxes(rows, 1, 2) @ rows)
    for k in range(5):
        step, rest, *_ = np.linalg.lstsq(rows[k, :, :-1], -rows[k, :, -1], rcond=None)
        np.testing.assert_allclose(fits.placements[k], step, rtol=1e-6, atol=1e-8)
        assert fits.errors[k] == pytest.approx(float(rest[0]), rel=1e-6)


def test_lens_distortion_is_taken_from_the_data_and_not_put_on_the_model() -> None:
    rng = np.random.default_rng(1)
    floor, _, _ = parametrise(rng)
    bent = replace(CAMERA, distortion=(-0.2, 0.05, 0.0, 0.0, 0.0))
    model = floor.prior.inverse().apply(rng.uniform((-1.0, -0.8, 3.0), (1.0, 0.8, 6.0), (8, 2, 3)))
    seen = bent.project(floor.prior.apply(model))
    rows = np.arange(8)
    pairs = linearise_pairs(build_scene(model, seen, bent, floor), floor.prior, rows, rows)
    np.testing.assert_allclose(pairs.distances, 0.0, atol=1e-3)
