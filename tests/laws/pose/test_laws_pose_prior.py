"""Laws of a prior with a covariance: one more measurement, for every solver that takes it."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.paper.pose_scenes import PoseScene, draw_prior, end_noise, wrong_landmarks
from knowledge_sources.methods.pose import PoseEstimate, r_and_t_ml
from pose_laws import ROBUST, SCENES, SIGMA_PX, Solver, by_solver, measure_error, scenes, seeds
from world_models.frames import Pose

PRIOR_M, PRIOR_RAD = 0.1, 0.01
quick = settings(max_examples=12, deadline=None, derandomize=True)


def solve(solver: Solver, scene: PoseScene, segments: Any, prior: Pose, factor: float | None) -> PoseEstimate:
    """``factor``: of the prior's variances, those of :func:`draw_prior`; ``None``: without a covariance."""
    spread = np.diag([PRIOR_RAD**2 / 3.0] * 3 + [PRIOR_M**2 / 3.0] * 3)
    return solver(
        scene.lines_world, segments, scene.camera, prior, landmark_ids=scene.landmark_ids, sigma_px=SIGMA_PX,
        prior_covariance=None if factor is None else factor * spread,
    )


@by_solver(ROBUST)
@given(scene=scenes, seed=seeds)
@quick
def test_without_outliers_it_is_the_likeliest_pose(solver: Solver, scene: PoseScene, seed: int) -> None:
    """That of :func:`r_and_t_ml`. The noise is below what is stated, so that no line is left out."""
    rng = np.random.default_rng(seed)
    segments = end_noise(scene.segments_px, 0.25 * SIGMA_PX, rng)
    prior = draw_prior(scene.camera_from_world, PRIOR_M, PRIOR_RAD, rng)
    found, likeliest = (solve(f, scene, segments, prior, 1.0) for f in (solver, r_and_t_ml))
    assert found.inliers.all() and found.ok and likeliest.ok
    turn, shift = measure_error(found.camera_from_world, likeliest.camera_from_world)
    assert turn < 1e-6 and shift < 1e-5


@by_solver([*ROBUST, r_and_t_ml])
@given(scene=scenes, seed=seeds)
@quick
def test_a_wide_prior_changes_nothing(solver: Solver, scene: PoseScene, seed: int) -> None:
    rng = np.random.default_rng(seed)
    segments = end_noise(scene.segments_px, SIGMA_PX, rng)
    if solver is not r_and_t_ml:
        segments, _ = wrong_landmarks(scene, segments, len(scene) // 4, rng)
    prior = draw_prior(scene.camera_from_world, PRIOR_M, PRIOR_RAD, rng)
    found, free = (solve(solver, scene, segments, prior, factor) for factor in (1e9, None))
    turn, shift = measure_error(found.camera_from_world, free.camera_from_world)
    assert turn < 1e-5 and shift < 1e-3 and np.array_equal(found.inliers, free.inliers)
    np.testing.assert_allclose(found.covariance, free.covariance, rtol=1e-2, atol=1e-9)


@by_solver([*ROBUST, r_and_t_ml])
@given(scene=scenes, seed=seeds, wrong=st.booleans())
@quick
def test_a_tight_prior_dominates(solver: Solver, scene: PoseScene, seed: int, wrong: bool) -> None:
    """Whatever the lines say, also where most of them are wrong."""
    rng = np.random.default_rng(seed)
    segments = end_noise(scene.segments_px, SIGMA_PX, rng)
    if wrong:
        segments, _ = wrong_landmarks(scene, segments, (2 * len(scene)) // 3, rng)
    prior = draw_prior(scene.camera_from_world, PRIOR_M, PRIOR_RAD, rng)
    found = solve(solver, scene, segments, prior, 1e-12)
    turn, shift = measure_error(found.camera_from_world, prior)
    assert turn < 1e-5 and shift < 1e-5
    assert np.sqrt(np.trace(found.covariance[3:, 3:])) < 1e-5


@by_solver(ROBUST)
def test_a_prior_helps_where_most_lines_are_wrong(solver: Solver) -> None:
    """60 % of the lines: with a prior of a known covariance more poses are right than without."""
    right = {None: 0, 1.0: 0}
    for seed in range(30):
        rng = np.random.default_rng(seed)
        scene = SCENES[0]
        segments, _ = wrong_landmarks(scene, end_noise(scene.segments_px, SIGMA_PX, rng), 18, rng)
        prior = draw_prior(scene.camera_from_world, PRIOR_M, PRIOR_RAD, rng)
        for factor in right:
            found = solve(solver, scene, segments, prior, factor)
            right[factor] += measure_error(found.camera_from_world, scene.camera_from_world)[1] < 0.33
    assert right[1.0] >= right[None]
