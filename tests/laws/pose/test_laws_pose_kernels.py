"""Laws of the compiled inner loops of the pose solvers: plain numpy and finite differences give the same, each value.

A Hessian with a wrong sign still leads to the same minimum, so that only its values tell; the covariance rests on it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from experiments.paper.pose_solvers import TruncatedLoss
from knowledge_sources.methods.pose import (
    LineSet,
    build_line_set,
    compute_camera_poses,
    compute_image_jacobian,
    compute_point_jacobian,
    kernels,
)
from knowledge_sources.methods.pose.estimate import compute_gain
from knowledge_sources.methods.pose.planar import compute_line_jacobian, to_rigid_motion
from world_models.camera import Camera
from world_models.frames import Pose, Pose2

CAMERA = Camera(480.0, 455.0, 250.0, 262.0, 512, 512)
Array = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=10, deadline=None)
NO_PRIOR = np.zeros((6, 6))


class Scene:
    """Random lines and points before a robot whose camera stands aside of its axis, turned and tilted."""

    def __init__(self, seed: int) -> None:
        self.rng = rng = np.random.default_rng(seed)
        level = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
        tilt = Pose.from_rotation_vector(rng.normal(0.0, 0.1, 3), rng.uniform(-0.6, 0.6, 3))
        self.mount = tilt @ Pose(level, np.array([0.0, 1.1, 0.0]))
        self.state = np.array([*rng.uniform(-5.0, 5.0, 2), rng.uniform(-np.pi, np.pi)])
        here = Pose2(*self.state).lifted()
        self.points = here.apply(rng.uniform((3.0, -1.0, 0.2), (9.0, 1.0, 2.0), (12, 3)))
        self.model = here.apply(rng.uniform((3.0, -1.0, 0.2), (9.0, 1.0, 2.0), (12, 2, 3)))
        self.camera_from_world = self.mount @ here.inverse()
        seen = CAMERA.project(self.camera_from_world.apply(self.model.reshape(-1, 3))).reshape(-1, 2, 2)
        self.segments = seen + rng.normal(0.0, 2.0, seen.shape)
        self.sigma = rng.uniform(0.3, 2.0, 12)
        self.weights = rng.choice([0.0, 1.0, 0.4], 12)
        self.lines: LineSet = build_line_set(self.model, self.segments, CAMERA, self.sigma)
        root = rng.normal(0.0, 1.0, (3, 3)) + 3.0 * np.eye(3)
        self.information, self.mean = root @ root.T, self.state + rng.normal(0.0, 0.2, 3)
        self.floor = self.lines.arrays, self.mean, self.information, to_rigid_motion(self.mount)

    def weigh_pose(self, distances: Array) -> Array:
        return distances * np.sqrt(self.weights)[:, None] / self.sigma[:, None]


def perturb(pose: Pose, step: Array) -> Pose:
    """The left perturbation (rotation [rad], translation [m]) (6,)."""
    return pose.perturbed(step[:3], step[3:])


def differentiate(function: Any, at: Array, step: float = 1e-6) -> Array:
    """Central differences of a function of a vector: (..., d)."""
    sides = [[np.asarray(function(at + sign * one)) for sign in (1.0, -1.0)] for one in np.eye(len(at)) * step]
    return np.stack([(a - b) / (2.0 * step) for a, b in sides], axis=-1)


@few
@given(seed=seeds)
def test_normal_equations_of_lines_on_the_floor(seed: int) -> None:
    """Hessian, gradient and cost are those of the residuals' finite differences, the prior's share included."""
    s = Scene(seed)

    def residuals(state: Array) -> Array:
        return s.weigh_pose(compute_image_jacobian(s.lines, *compute_camera_poses(state, s.mount))[0])

    at = s.state + s.rng.normal(0.0, 0.03, 3)
    _, hessian, cost, _ = kernels.minimise_floor_pose(s.floor, s.weights, at, 0)
    slopes, apart = differentiate(residuals, at).reshape(-1, 3), at - s.mean
    np.testing.assert_allclose(hessian, slopes.T @ slopes + s.information, rtol=1e-4)
    assert cost == pytest.approx(np.sum(residuals(at) ** 2) + apart @ s.information @ apart)
    filled, gradient = np.zeros((3, 3)), np.zeros(3)
    kernels._linearise_floor((s.floor, s.weights), at, filled, gradient)
    np.testing.assert_allclose(filled, hessian)
    expected = slopes.T @ residuals(at).ravel() + s.information @ apart
    np.testing.assert_allclose(gradient, expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())


@few
@given(seed=seeds)
def test_normal_equations_of_points_on_the_floor(seed: int) -> None:
    """The same of tracked points; Huber's loss has the cost whose slope the gradient is."""
    s = Scene(seed)
    huber, chosen = 1.5, s.rng.random(12) < 0.8
    observed = CAMERA.project(s.camera_from_world.apply(s.points)) - (CAMERA.cx, CAMERA.cy)
    observed += s.rng.normal(0.0, 2.0, observed.shape)
    focal = np.array([CAMERA.fx, CAMERA.fy])
    points = s.points, observed, s.sigma, focal, s.mean, s.information, to_rigid_motion(s.mount)

    def residuals(state: Array) -> Array:
        px = CAMERA.project((s.mount @ Pose2(*state).lifted().inverse()).apply(s.points)) - (CAMERA.cx, CAMERA.cy)
        return (px - observed) / s.sigma[:, None]

    def loss(state: Array) -> float:
        size, apart = np.linalg.norm(residuals(state)[chosen], axis=1), state - s.mean
        share = np.where(size <= huber, size**2, 2.0 * huber * size - huber**2)
        return float(share.sum() + apart @ s.information @ apart)

    at = s.state + s.rng.normal(0.0, 0.01, 3)
    depths, found, slopes = kernels.project_points(points, at)
    np.testing.assert_allclose(found, residuals(at), atol=1e-9)
    np.testing.assert_allclose(slopes, differentiate(residuals, at), rtol=1e-4, atol=1e-3)
    camera, image, by_numpy = compute_point_jacobian(s.points, CAMERA, Pose2(*at), s.mount)
    np.testing.assert_allclose(depths, camera[:, 2])
    np.testing.assert_allclose((image - observed) / s.sigma[:, None], found, atol=1e-9)
    np.testing.assert_allclose(by_numpy / s.sigma[:, None, None], slopes, rtol=1e-9, atol=1e-9)
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    cost = kernels._linearise_points((points, chosen, huber, 0.05), at, hessian, gradient)
    assert cost == pytest.approx(loss(at))
    expected = differentiate(loss, at) / 2.0
    np.testing.assert_allclose(gradient, expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())
    weight = chosen * huber / np.maximum(np.linalg.norm(found, axis=1), huber)
    np.testing.assert_allclose(hessian, np.einsum("n,nea,neb->ab", weight, slopes, slopes) + s.information)


@pytest.mark.parametrize("kind", [kernels.PLANES, kernels.IMAGE])
@few
@given(seed=seeds)
def test_normal_equations_of_a_camera(kind: int, seed: int) -> None:
    """Six unknowns, each objective: finite differences over the left perturbation, and numpy."""
    s = Scene(seed)
    pose = perturb(s.camera_from_world, s.rng.normal(0.0, 0.02, 6))
    root = s.rng.normal(0.0, 1.0, (6, 6)) + 3.0 * np.eye(6)
    information, prior = root @ root.T, s.camera_from_world

    def residuals(step: Array) -> Array:
        moved = perturb(pose, step)
        if kind == kernels.IMAGE:
            return s.weigh_pose(compute_image_jacobian(s.lines, moved.rotation, moved.translation)[0])
        return np.sqrt(s.weights)[:, None] * np.einsum("nek,nk->ne", moved.apply(s.model), s.lines.normals)

    def find_prior_cost(step: Array) -> float:
        apart = perturb(pose, step) @ prior.inverse()
        away = np.concatenate([apart.rotation_vector, apart.translation])
        return float(away @ information @ away)

    hessian, gradient = np.zeros((6, 6)), np.zeros(6)
    problem = kind, s.lines.arrays, s.weights, to_rigid_motion(prior), NO_PRIOR
    cost = kernels._linearise_pose(problem, to_rigid_motion(pose), hessian, gradient)
    here, slopes = residuals(np.zeros(6)).ravel(), differentiate(residuals, np.zeros(6)).reshape(-1, 6)
    scale = np.abs(slopes.T @ slopes).max()
    np.testing.assert_allclose(hessian, slopes.T @ slopes, rtol=1e-4, atol=1e-6 * scale)
    np.testing.assert_allclose(gradient, slopes.T @ here, rtol=1e-4, atol=1e-4 * np.abs(slopes.T @ here).max())
    assert cost == pytest.approx(np.sum(here**2))
    if kind == kernels.IMAGE:
        distances, by_numpy = compute_image_jacobian(s.lines, pose.rotation, pose.translation)
        np.testing.assert_allclose(s.weigh_pose(distances).ravel(), here)
        weighed = s.weigh_pose(by_numpy.reshape(12, -1)).reshape(-1, 6)
        np.testing.assert_allclose(hessian, weighed.T @ weighed, rtol=1e-9, atol=1e-9 * scale)
    with_prior, pulled = np.zeros((6, 6)), np.zeros(6)
    problem = kind, s.lines.arrays, s.weights, to_rigid_motion(prior), information
    total = kernels._linearise_pose(problem, to_rigid_motion(pose), with_prior, pulled)
    np.testing.assert_allclose(with_prior - hessian, information, rtol=1e-6, atol=1e-9 * scale)
    assert total - cost == pytest.approx(find_prior_cost(np.zeros(6)), rel=1e-6)
    expected = differentiate(find_prior_cost, np.zeros(6)) / 2.0
    np.testing.assert_allclose(pulled - gradient, expected, rtol=0.05, atol=0.05 * np.abs(expected).max())


@few
@given(seed=seeds)
def test_the_numpy_derivatives_on_the_floor(seed: int) -> None:
    """With a camera aside of the robot's axis, so that the lever arm of a turn counts."""
    s = Scene(seed)
    distances, slopes = compute_line_jacobian(s.lines.points[:, 0], s.lines.directions, s.lines, s.state, s.mount)

    def measure(state: Array) -> Array:
        return compute_image_jacobian(s.lines, *compute_camera_poses(state, s.mount))[0]

    np.testing.assert_allclose(distances, measure(s.state), atol=1e-6)
    expected = differentiate(measure, s.state)
    np.testing.assert_allclose(slopes, expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())


@few
@given(seed=seeds)
def test_costs_and_squares_of_lines(seed: int) -> None:
    """Squared distances, truncated costs and those on the floor, one by one."""
    s = Scene(seed)
    pose = s.camera_from_world
    distances = compute_image_jacobian(s.lines, pose.rotation, pose.translation)[0]
    squares = np.sum(distances**2, axis=1) / s.sigma**2
    found = kernels.compute_squared_distances(s.lines.arrays, pose.rotation[None], pose.translation[None])
    np.testing.assert_allclose(found[0], squares)
    np.testing.assert_allclose(kernels.compute_floor_squares(s.floor, s.state), squares, atol=1e-9)
    bound = float(np.median(squares))
    loss = TruncatedLoss(s.lines, pose, None, bound, 5.0)
    np.testing.assert_allclose(loss.measure(to_rigid_motion(pose), bound), np.minimum(squares, bound))
    behind = Pose(np.diag([-1.0, 1.0, -1.0]) @ pose.rotation, np.diag([-1.0, 1.0, -1.0]) @ pose.translation)
    assert np.all(loss.measure(to_rigid_motion(behind), bound) == bound)
    apart = s.state - s.mean
    cost = np.minimum(squares, bound).sum() + apart @ s.information @ apart
    np.testing.assert_allclose(kernels.compute_floor_costs(s.floor, s.state[None], bound), [cost])


@few
@given(seed=seeds)
def test_gain_is_how_the_minimum_moves(seed: int) -> None:
    """By moving each observed end along its line's normal, and minimising again (residuals small: Gauss-Newton)."""
    s = Scene(seed)
    exact = CAMERA.project(s.camera_from_world.apply(s.model.reshape(-1, 3))).reshape(-1, 2, 2)
    lines, weights = build_line_set(s.model, exact, CAMERA, s.sigma), np.ones(12)
    start = to_rigid_motion(s.camera_from_world)
    _, _, hessian, _, _ = kernels.minimise_pose(kernels.IMAGE, lines.arrays, weights, start, start, NO_PRIOR, 0)
    gain, normals = compute_gain(lines, weights, start, np.linalg.inv(hessian))
    row, end, step_px = int(s.rng.integers(12)), int(s.rng.integers(2)), 1e-4
    moved = exact.copy()
    moved[row, end] += step_px * normals[row]
    again = build_line_set(s.model, moved, CAMERA, s.sigma)
    rotation, translation, _, _, _ = kernels.minimise_pose(
        kernels.IMAGE, again.arrays, weights, start, start, NO_PRIOR, 20)
    away = Pose(rotation, translation) @ s.camera_from_world.inverse()
    turn = np.array([away.rotation[2, 1], away.rotation[0, 2], away.rotation[1, 0]])
    found = np.array([*turn, *(translation - away.rotation @ s.camera_from_world.translation)]) / step_px
    np.testing.assert_allclose(found, gain[row, end], rtol=1e-2, atol=1e-3 * np.abs(gain[row]).max())
