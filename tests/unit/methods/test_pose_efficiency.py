"""Efficiency of the pose solvers: their errors against the Cramér-Rao bound and against their own covariances."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2

from experiments.paper.pose_scenes import PoseScene, campus, corridor, draw_prior, end_noise, fragment
from experiments.paper.pose_solvers import r_and_t, r_then_t
from knowledge_sources.methods.pose import PoseEstimate, build_line_set, compute_image_jacobian, r_and_t_ml

SIGMA_PX = 0.5
TRIALS = 150
Array = NDArray[np.float64]


def build_scene(name: str, whole: bool) -> PoseScene:
    scene = campus() if name == "campus" else corridor()
    scene = scene.take(np.sort(np.random.default_rng(3).permutation(len(scene))[:12]))
    return scene if whole else fragment(scene, np.random.default_rng(7))


def compute_bound(scene: PoseScene) -> Array:
    """(6, 6) the Cramér-Rao bound: no unbiased estimate has a smaller covariance."""
    lines = build_line_set(scene.lines_world, scene.segments_px, scene.camera, SIGMA_PX)
    pose = scene.camera_from_world
    slopes = compute_image_jacobian(lines, pose.rotation, pose.translation)[1].reshape(-1, 6) / SIGMA_PX
    return np.asarray(np.linalg.inv(slopes.T @ slopes))


def run_trials(solver: Callable[..., PoseEstimate], scene: PoseScene) -> tuple[Array, Array]:
    """Errors (t, 6), and each one's squared size by its own covariance (t,)."""
    rng = np.random.default_rng(11)
    errors, sizes = [], []
    for _ in range(TRIALS):
        segments = end_noise(scene.segments_px, SIGMA_PX, rng)
        prior = draw_prior(scene.camera_from_world, 0.5, 0.03, rng)
        found = solver(scene.lines_world, segments, scene.camera, prior, sigma_px=SIGMA_PX)
        apart = found.camera_from_world @ scene.camera_from_world.inverse()
        error = np.concatenate([apart.rotation_vector, apart.translation])
        errors.append(error)
        sizes.append(error @ np.linalg.solve(found.covariance, error))
    return np.array(errors), np.array(sizes)


def compute_ratio(errors: Array, bound: Array) -> float:
    """RMS error over the bound, all six directions with equal weight."""
    return float(np.sqrt(np.mean(np.sum(errors * np.linalg.solve(bound, errors.T).T, axis=1)) / 6.0))


@pytest.mark.parametrize("whole", [True, False], ids=["whole", "fragments"])
@pytest.mark.parametrize("name", ["campus", "corridor"])
def test_maximum_likelihood_reaches_the_bound(name: str, whole: bool) -> None:
    """One standard deviation of the ratio over 150 trials is 0.024."""
    scene = build_scene(name, whole)
    errors, sizes = run_trials(r_and_t_ml, scene)
    assert 0.92 < compute_ratio(errors, compute_bound(scene)) < 1.08
    assert 0.89 < np.mean(sizes < chi2.ppf(0.95, 6)) < 0.995


@pytest.mark.parametrize("name", ["campus", "corridor"])
def test_the_order_of_the_methods_is_the_paper_s(name: str) -> None:
    """R then T is far off, R and T near, the likelihood nearest; E1's covariance is right, though no likelihood's."""
    scene = build_scene(name, False)
    bound = compute_bound(scene)
    first, _ = run_trials(r_then_t, scene)
    second, sizes = run_trials(r_and_t, scene)
    third, _ = run_trials(r_and_t_ml, scene)
    ratios = [compute_ratio(errors, bound) for errors in (first, second, third)]
    assert ratios[0] > 3.0 * ratios[1] and ratios[1] > 1.05 * ratios[2]
    assert 0.89 < np.mean(sizes < chi2.ppf(0.95, 6)) < 0.995


def test_e2_lies_between_e1_and_the_likelihood() -> None:
    scene = build_scene("campus", True)
    bound = compute_bound(scene)
    e1, _ = run_trials(r_and_t, scene)
    e2, _ = run_trials(lambda *a, **k: r_and_t(*a, objective="E2", **k), scene)
    assert 0.92 < compute_ratio(e2, bound) < compute_ratio(e1, bound)


def test_maximum_likelihood_agrees_with_scipy_s_least_squares() -> None:
    scene = build_scene("corridor", True)
    rng = np.random.default_rng(5)
    segments = end_noise(scene.segments_px, SIGMA_PX, rng)
    prior = draw_prior(scene.camera_from_world, 0.3, 0.03, rng)
    found = r_and_t_ml(scene.lines_world, segments, scene.camera, prior, sigma_px=SIGMA_PX)
    lines = build_line_set(scene.lines_world, segments, scene.camera, SIGMA_PX)

    def residuals(step: Array) -> Array:
        pose = scene.camera_from_world.perturbed(step[:3], step[3:])
        return compute_image_jacobian(lines, pose.rotation, pose.translation)[0].ravel() / SIGMA_PX

    oracle = least_squares(residuals, np.zeros(6), xtol=1e-13, ftol=1e-13, gtol=1e-13)
    expected = scene.camera_from_world.perturbed(oracle.x[:3], oracle.x[3:])
    assert found.camera_from_world.angle_to(expected) < 1e-6
    assert np.abs(found.camera_from_world.translation - expected.translation).max() < 1e-5
    assert found.cost == pytest.approx(2.0 * oracle.cost, rel=1e-6)


@pytest.mark.parametrize(
    "model, segments, more, complaint",
    [
        (np.zeros((2, 3)), np.zeros((2, 2, 2)), {}, "model_lines_world"),
        (np.ones((1, 2, 3)), np.zeros((1, 2, 2)), {}, "length"),
        (np.eye(3)[None, :2], np.zeros((2, 2, 2)), {}, "one segment a model line"),
        (np.eye(3)[None, :2], np.full((1, 2, 2), np.nan), {}, "finite segments_px"),
        (np.eye(3)[None, :2], np.zeros((1, 2, 2)), {"sigma_px": 0.0}, "sigma_px > 0"),
        (np.eye(3)[None, :2], np.zeros((1, 2, 2)), {"landmark_ids": ["a", "b"]}, "landmark ids"),
    ],
)
def test_wrong_arguments_are_named(model: Array, segments: Array, more: dict[str, Any], complaint: str) -> None:
    scene = corridor()
    with pytest.raises(ValueError, match=complaint):
        r_and_t_ml(model, segments, scene.camera, scene.camera_from_world, **more)
