"""Laws of every pose solver, on any scene (§6.2)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.paper.pose_scenes import PoseScene, corridor, draw_prior, end_noise, wrong_landmarks
from experiments.paper.pose_solvers import r_and_t, r_then_t
from knowledge_sources.methods.pose import (
    build_line_set,
    compute_image_jacobian,
    compute_weak_information,
    measure_lines,
    r_and_t_ml,
)
from pose_laws import ROBUST, SIGMA_PX, SOLVERS, Solver, by_solver, measure_error, scenes, seeds, solve
from world_models.camera import Camera
from world_models.frames import Pose

quick = settings(max_examples=8, deadline=None)


def is_same(found: Pose, other: Pose) -> bool:
    turn, shift = measure_error(found, other)
    return turn < 1e-6 and shift < 1e-4


def take_some(scene: PoseScene, rng: np.random.Generator, count: int = 14) -> PoseScene:
    return scene.take(np.sort(rng.permutation(len(scene))[:count]))


def begin(scene: PoseScene, seed: int) -> tuple[np.random.Generator, PoseScene, Any, Pose]:
    """Some lines of a scene, their noisy segments, and a prior."""
    rng = np.random.default_rng(seed)
    scene = take_some(scene, rng)
    segments = end_noise(scene.segments_px, SIGMA_PX, rng)
    return rng, scene, segments, draw_prior(scene.camera_from_world, 0.3, 0.03, rng)


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds)
@quick
def test_exact_lines_give_the_truth(solver: Solver, scene: PoseScene, seed: int) -> None:
    rng = np.random.default_rng(seed)
    prior = draw_prior(scene.camera_from_world, 0.5, 0.05, rng)
    found = solve(solver, scene, scene.segments_px, prior)
    assert found.ok and is_same(found.camera_from_world, scene.camera_from_world)
    assert found.inliers.all() and np.abs(found.residuals_px).max() < 1e-3


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds)
@quick
def test_the_order_of_the_lines_does_not_matter(solver: Solver, scene: PoseScene, seed: int) -> None:
    rng, scene, segments, prior = begin(scene, seed)
    order = rng.permutation(len(scene))
    first = solve(solver, scene, segments, prior)
    second = solve(solver, scene.take(order), segments[order], prior)
    assert is_same(second.camera_from_world, first.camera_from_world)
    assert np.array_equal(second.inliers, first.inliers[order])


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds)
@quick
def test_which_end_comes_first_does_not_matter(solver: Solver, scene: PoseScene, seed: int) -> None:
    """Swapping the ends changes the sign of a normal or of a direction; neither sign has a meaning."""
    rng, scene, segments, prior = begin(scene, seed)
    first = solve(solver, scene, segments, prior)
    lines, flipped = scene.lines_world.copy(), segments.copy()
    a, b = rng.random(len(scene)) < 0.5, rng.random(len(scene)) < 0.5
    lines[a], flipped[b] = lines[a][:, ::-1], flipped[b][:, ::-1]
    other = PoseScene(lines, flipped, scene.landmark_ids, scene.camera, scene.camera_from_world)
    second = solve(solver, other, flipped, prior)
    assert is_same(second.camera_from_world, first.camera_from_world)


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds)
@quick
def test_moving_the_world_moves_the_pose_with_it(solver: Solver, scene: PoseScene, seed: int) -> None:
    rng, scene, segments, prior = begin(scene, seed)
    moved_from_world = Pose.from_rotation_vector(rng.normal(0.0, 1.0, 3), rng.uniform(-30.0, 30.0, 3))
    lines = moved_from_world.apply(scene.lines_world)
    moved = PoseScene(lines, segments, scene.landmark_ids, scene.camera, scene.camera_from_world)
    first = solve(solver, scene, segments, prior)
    second = solve(solver, moved, segments, prior @ moved_from_world.inverse())
    assert is_same(second.camera_from_world @ moved_from_world, first.camera_from_world)


@by_solver(ROBUST)
@pytest.mark.parametrize("version", ["lines", "landmarks"])
@given(scene=scenes, seed=seeds)
@settings(max_examples=8, deadline=None, derandomize=True)
def test_gross_outliers_do_not_move_a_robust_pose(
    solver: Solver, version: str, scene: PoseScene, seed: int
) -> None:
    """40 % of the lines wrong, each by itself or by landmarks: a pose as good as Table 3's, and they are rejected."""
    rng = np.random.default_rng(seed)
    segments = end_noise(scene.segments_px, SIGMA_PX, rng)
    count = int(0.4 * len(scene))
    more: dict[str, Any] = {}
    if version == "lines":
        segments[rng.permutation(len(scene))[:count]] = rng.uniform(0.0, 511.0, (count, 2, 2))
        more = {"landmark_ids": None, "probability": 0.9999999, "rng": rng}
    else:
        segments, _ = wrong_landmarks(scene, segments, count, rng)
    found = solve(solver, scene, segments, draw_prior(scene.camera_from_world, 0.3, 0.03, rng), **more)
    turn, shift = measure_error(found.camera_from_world, scene.camera_from_world)
    assert turn < 0.01 and shift < 0.33
    gross = np.abs(found.residuals_px).max(axis=1) > 25.0 * SIGMA_PX
    assert not np.any(found.inliers & gross)
    assert all(found.rejected[i] for i in np.flatnonzero(gross))


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds)
@quick
def test_a_pose_behind_the_camera_is_never_returned(solver: Solver, scene: PoseScene, seed: int) -> None:
    """From priors with any orientation: a pose that is ok has most of its lines in front."""
    rng = np.random.default_rng(seed)
    scene = take_some(scene, rng)
    prior = scene.camera_from_world.perturbed(rng.uniform(-3.1, 3.1, 3), rng.uniform(-5.0, 5.0, 3))
    found = solve(solver, scene, scene.segments_px, prior)
    lines = build_line_set(scene.lines_world, scene.segments_px, scene.camera, SIGMA_PX)
    pose = found.camera_from_world
    front = measure_lines(lines, pose.rotation, pose.translation)[1]
    assert not np.any(found.inliers & ~front)
    assert not found.ok or 2 * front.sum() > len(scene) or 2 * found.inliers.sum() <= len(scene)
    assert found.ok or found.reason


@pytest.mark.parametrize("count", [0, 1, 2, 3])
@given(scene=scenes, seed=seeds, sigma_px=st.sampled_from((0.0, SIGMA_PX)))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_few_lines_never_make_a_prior_worse(count: int, scene: PoseScene, seed: int, sigma_px: float) -> None:
    """By the information of a weak prior: noise does not move the pose far in directions of which they say little."""
    rng = np.random.default_rng(seed)
    scene = take_some(scene, rng, count)
    truth, segments = scene.camera_from_world, end_noise(scene.segments_px, sigma_px, rng)
    prior = draw_prior(truth, 0.1, 0.01, rng)
    for solver in (r_and_t_ml, *ROBUST):
        found = solve(solver, scene, segments, prior)
        assert weigh_error(found.camera_from_world, truth) <= weigh_error(prior, truth) * 1.02 + 1e-6


@by_solver([r_then_t, r_and_t])
@given(scene=scenes, count=st.integers(0, 2), seed=seeds)
@quick
def test_r_then_t_and_r_and_t_return_the_prior_below_three_lines(
    solver: Solver, scene: PoseScene, count: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    scene = take_some(scene, rng, count)
    prior = draw_prior(scene.camera_from_world, 0.1, 0.01, rng)
    found = solve(solver, scene, scene.segments_px, prior)
    assert is_same(found.camera_from_world, prior) and not found.ok


def weigh_error(found: Pose, truth: Pose) -> float:
    apart = found @ truth.inverse()
    move = np.concatenate([apart.rotation_vector, apart.translation])
    return float(np.sqrt(move @ compute_weak_information() @ move))


@given(scene=scenes, seed=seeds)
@quick
def test_derivatives_are_those_of_the_residuals(scene: PoseScene, seed: int) -> None:
    rng = np.random.default_rng(seed)
    lines = build_line_set(scene.lines_world, end_noise(scene.segments_px, 2.0, rng), scene.camera, 1.0)
    pose = draw_prior(scene.camera_from_world, 0.3, 0.03, rng)
    _, image = compute_image_jacobian(lines, pose.rotation, pose.translation)
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-6
        sides = [pose.perturbed(sign * step[:3], sign * step[3:]) for sign in (1.0, -1.0)]
        far, near = (compute_image_jacobian(lines, p.rotation, p.translation)[0] for p in sides)
        np.testing.assert_allclose((far - near) / 2e-6, image[..., k], rtol=1e-4, atol=1e-3)


@by_solver(SOLVERS)
@given(seed=seeds)
@quick
def test_lens_distortion_is_undone(solver: Solver, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = corridor()
    plain = scene.camera
    bent = Camera(plain.fx, plain.fy, plain.cx, plain.cy, plain.width, plain.height, (-0.08, 0.02, 1e-3, -1e-3, 0.0))
    through = bent.project(plain.rays(scene.segments_px))
    seen = PoseScene(scene.lines_world, through, scene.landmark_ids, bent, scene.camera_from_world)
    found = solve(solver, seen, through, draw_prior(scene.camera_from_world, 0.3, 0.03, rng))
    assert is_same(found.camera_from_world, scene.camera_from_world)
