"""Laws of what every solver reports: residuals, reasons and a covariance, each of them true."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.paper.pose_scenes import PoseScene, draw_prior, end_noise, wrong_landmarks
from knowledge_sources.methods.pose import (
    MAX_BESIDE_PX,
    MAX_CHI2_SIGMAS,
    MAX_RESIDUAL_SIGMAS,
    SHARED_PX,
    PoseEstimate,
    build_line_set,
    compute_image_jacobian,
    measure_lines,
)
from knowledge_sources.methods.pose.estimate import BEHIND, DISTANCE, NO_LENGTH, NO_OVERLAP
from pose_laws import ROBUST, SIGMA_PX, SOLVERS, Solver, by_solver, scenes, seeds

quick = settings(max_examples=8, deadline=None, derandomize=True)


def solve(solver: Solver, scene: PoseScene, segments: Any, rng: np.random.Generator) -> PoseEstimate:
    prior = draw_prior(scene.camera_from_world, 0.3, 0.03, rng)
    return solver(
        scene.lines_world, segments, scene.camera, prior, landmark_ids=scene.landmark_ids, sigma_px=SIGMA_PX
    )


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds)
@quick
def test_residuals_are_those_of_the_pose(solver: Solver, scene: PoseScene, seed: int) -> None:
    rng = np.random.default_rng(seed)
    segments, _ = wrong_landmarks(scene, end_noise(scene.segments_px, SIGMA_PX, rng), 6, rng)
    found = solve(solver, scene, segments, rng)
    lines, pose = build_line_set(scene.lines_world, segments, scene.camera, SIGMA_PX), found.camera_from_world
    expected = compute_image_jacobian(lines, pose.rotation, pose.translation)[0]
    np.testing.assert_allclose(np.abs(found.residuals_px), np.abs(expected), atol=1e-6, rtol=1e-6)


@by_solver(ROBUST)
@given(scene=scenes, seed=seeds)
@quick
def test_each_rejected_line_has_a_reason_that_is_true(solver: Solver, scene: PoseScene, seed: int) -> None:
    rng = np.random.default_rng(seed)
    segments, _ = wrong_landmarks(scene, end_noise(scene.segments_px, SIGMA_PX, rng), 6, rng)
    segments[0, 1] = segments[0, 0]
    along = segments[1, 1] - segments[1, 0]
    segments[1] += 3.0 * along
    found = solve(solver, scene, segments, rng)
    lines, pose = build_line_set(scene.lines_world, segments, scene.camera, SIGMA_PX), found.camera_from_world
    _, front, over = measure_lines(lines, pose.rotation, pose.translation, MAX_BESIDE_PX)
    far = np.sum((found.residuals_px / SIGMA_PX) ** 2, axis=1)
    assert found.rejected[0] == NO_LENGTH and found.rejected[1] is not None
    for i, reason in enumerate(found.rejected):
        assert found.inliers[i] == (reason is None)
        if reason is None:
            assert front[i] and over[i]
        elif reason == BEHIND:
            assert not front[i]
        elif reason == NO_OVERLAP:
            assert not over[i]
        elif reason == DISTANCE:
            assert far[i] > 9.0
        else:
            assert reason == NO_LENGTH and np.ptp(segments[i], axis=0).max() == 0.0


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds)
@quick
def test_the_covariance_says_how_far_off_the_pose_is(solver: Solver, scene: PoseScene, seed: int) -> None:
    """40 is beyond chi-squared's 99.9999 % with six degrees of freedom."""
    rng = np.random.default_rng(seed)
    found = solve(solver, scene, end_noise(scene.segments_px, SIGMA_PX, rng), rng)
    np.testing.assert_allclose(found.covariance, found.covariance.T)
    assert np.linalg.eigvalsh(found.covariance)[0] > 0.0
    apart = found.camera_from_world @ scene.camera_from_world.inverse()
    error = np.concatenate([apart.rotation_vector, apart.translation])
    assert error @ np.linalg.solve(found.covariance, error) < 40.0


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds, factor=st.floats(1.5, 4.0))
@quick
def test_the_covariance_scales_with_the_variance_of_the_lines(
    solver: Solver, scene: PoseScene, seed: int, factor: float
) -> None:
    """With exact lines and ``factor`` times the deviations, the covariance is ``factor`` squared times as large."""
    rng = np.random.default_rng(seed)
    prior = draw_prior(scene.camera_from_world, 0.1, 0.01, rng)
    first, second = (
        solver(scene.lines_world, scene.segments_px, scene.camera, prior, landmark_ids=scene.landmark_ids,
               sigma_px=by * SIGMA_PX, shared_px=by * SHARED_PX)
        for by in (1.0, factor)
    )
    np.testing.assert_allclose(second.covariance, factor**2 * first.covariance, rtol=1e-3, atol=1e-12)


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds)
@quick
def test_the_error_that_all_lines_share_is_a_floor_of_the_covariance(
    solver: Solver, scene: PoseScene, seed: int
) -> None:
    """However small the noise of the lines and however many they are."""
    rng = np.random.default_rng(seed)
    prior = draw_prior(scene.camera_from_world, 0.1, 0.01, rng)
    data = scene.lines_world, scene.segments_px, scene.camera, prior
    none, some, small = (
        solver(*data, sigma_px=sigma, landmark_ids=scene.landmark_ids, shared_px=shared)
        for sigma, shared in ((SIGMA_PX, 0.0), (SIGMA_PX, 0.5), (0.01 * SIGMA_PX, 0.5))
    )
    floor = some.covariance - none.covariance
    assert np.linalg.eigvalsh(floor)[0] > -1e-9 * np.linalg.eigvalsh(floor)[-1] and np.trace(floor) > 0.0
    expected = floor + 1e-4 * none.covariance
    np.testing.assert_allclose(small.covariance, expected, rtol=0.02, atol=1e-3 * np.abs(floor).max())


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds, count=st.integers(2, 5))
@quick
def test_fragments_of_a_line_count_once(solver: Solver, scene: PoseScene, seed: int, count: int) -> None:
    """A line in ``count`` pieces, which together are as long, says no more than the line."""
    rng = np.random.default_rng(seed)
    prior = draw_prior(scene.camera_from_world, 0.1, 0.01, rng)
    cuts = np.linspace(0.0, 1.0, count + 1)
    a, span = scene.segments_px[:, None, 0], np.diff(scene.segments_px, axis=1)
    ends = a + cuts[None, :, None] * span
    pieces = np.stack([ends[:, :-1], ends[:, 1:]], axis=2).reshape(-1, 2, 2)
    whole = solver(
        scene.lines_world, scene.segments_px, scene.camera, prior, landmark_ids=scene.landmark_ids, sigma_px=SIGMA_PX)
    cut = solver(
        np.repeat(scene.lines_world, count, axis=0), pieces, scene.camera, prior,
        landmark_ids=np.repeat(scene.landmark_ids, count), sigma_px=SIGMA_PX)
    sizes = [np.linalg.slogdet(found.covariance)[1] / 12.0 for found in (whole, cut)]
    assert sizes[1] > sizes[0] - 0.2, "log of the mean deviation"


@by_solver(SOLVERS)
@given(scene=scenes, seed=seeds, part=st.floats(0.0, 0.95))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_ok_is_earned(solver: Solver, scene: PoseScene, seed: int, part: float) -> None:
    """Never with fewer than 3 inliers, a minority of the lines, or residuals far above their deviation."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, len(scene) + 1))
    scene = scene.take(np.sort(rng.permutation(len(scene))[:count]))
    segments, _ = wrong_landmarks(scene, end_noise(scene.segments_px, SIGMA_PX, rng), int(part * count), rng)
    found = solve(solver, scene, segments, rng)
    kept = int(found.inliers.sum())
    mean_square = float(np.sum((found.residuals_px[found.inliers] / SIGMA_PX) ** 2)) / max(2 * kept, 1)
    if found.ok:
        assert kept >= 3 and 2 * kept >= count
        limit = MAX_RESIDUAL_SIGMAS**2 * (1.0 + MAX_CHI2_SIGMAS * (2.0 / (2.0 * kept)) ** 0.5)
        assert mean_square <= limit * 1.001
