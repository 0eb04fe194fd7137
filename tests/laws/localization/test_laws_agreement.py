"""Laws of the evidence for a pose: what is accounted for, what that is worth, and how a view would tell."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from knowledge_sources.methods.localization.pose_candidates import (
    compute_chamfer_maps,
    compute_chamfer_scores,
    sample_lines,
)
from knowledge_sources.methods.verification import compute_agreement, compute_coverage, compute_view_quality
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.0, 0.1)
Floats = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)


def some_lines(seed: int, count: int) -> Floats:
    rng = np.random.default_rng(seed)
    middle, angle = rng.uniform(60, 450, (count, 2)), rng.uniform(0, math.pi, count)
    half = rng.uniform(10, 50, count)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.stack([middle - half, middle + half], axis=1)


def model_lines(seed: int, count: int = 30) -> Floats:
    """Upright and level lines in front of the robot at the origin."""
    rng = np.random.default_rng(seed)
    foot = np.stack([rng.uniform(2.0, 6.0, count), rng.uniform(-1.5, 1.5, count), rng.uniform(0.3, 1.5, count)], axis=1)
    way = np.where(rng.random((count, 1)) < 0.6, [[0.0, 0.0, 0.7]], [[0.0, 0.7, 0.0]])
    return np.stack([foot, foot + way], axis=1)


def projected(lines: Floats, pose: Pose2) -> Floats:
    return CAMERA.project_segments(lines, MOUNT.camera_from_robot @ pose.lifted().inverse())[0]


@settings(deadline=None, max_examples=40)
@given(seed=seeds, count=st.integers(1, 25))
def test_lines_cover_themselves_and_nothing_far(seed: int, count: int) -> None:
    lines = some_lines(seed, count)
    assert np.all(compute_coverage(lines, lines, 2.0, 0.05) == 1.0)
    assert np.all(compute_coverage(lines, lines + np.array([2000.0, 0.0]), 2.0, 0.05) == 0.0)
    assert np.all(compute_coverage(lines, np.zeros((0, 2, 2)), 2.0, 0.05) == 0.0)


@settings(deadline=None, max_examples=40)
@given(seed=seeds, count=st.integers(2, 20))
def test_coverage_does_not_depend_on_the_order_of_segments_or_of_their_ends(seed: int, count: int) -> None:
    lines, data = some_lines(seed, count), some_lines(seed + 1, 3 * count)
    rng = np.random.default_rng(seed)
    shuffled = data[rng.permutation(len(data))][:, :: int(rng.choice([-1, 1]))]
    assert np.array_equal(compute_coverage(lines, data, 4.0, 0.2), compute_coverage(lines, shuffled, 4.0, 0.2))


@settings(deadline=None, max_examples=30)
@given(seed=seeds)
def test_more_segments_never_cover_less(seed: int) -> None:
    lines, data = some_lines(seed, 10), some_lines(seed + 1, 30)
    assert np.all(compute_coverage(lines, data, 4.0, 0.2) >= compute_coverage(lines, data[:15], 4.0, 0.2))


@settings(deadline=None, max_examples=30)
@given(seed=seeds)
def test_the_right_pose_is_unlikely_by_chance_and_clutter_is_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lines, clutter = some_lines(seed, 20), some_lines(seed + 1, 60)
    displaced = np.array([lines + rng.uniform(20, 60, 2) for _ in range(12)])
    right = compute_agreement(lines, np.concatenate([lines, clutter]), displaced)
    wrong = compute_agreement(lines, clutter, displaced)
    assert right.matched == 20 and right.p_false < 1e-6
    assert wrong.p_false > 1e-3
    assert 0.0 <= right.p_false <= wrong.p_false <= 1.0


@settings(deadline=None, max_examples=20)
@given(seed=seeds, turn=st.floats(-0.5, 0.5))
def test_the_true_pose_scores_best_by_chamfer(seed: int, turn: float) -> None:
    lines, here = model_lines(seed), Pose2(0.0, 0.0, 0.0)
    seen = projected(lines, here)
    maps = compute_chamfer_maps(seen[~np.isnan(seen).any(axis=(1, 2))], CAMERA)
    points, directions, _ = sample_lines(lines)
    everything = np.array([0, len(points)]), np.arange(len(points)), np.zeros(1, np.int64)

    def score(pose: Pose2) -> float:
        at = np.array([[pose.x_m, pose.y_m, pose.heading_rad]])
        near, chance, count = compute_chamfer_scores(
            maps, CAMERA, MOUNT.camera_from_robot, at, points, directions, *everything)[0]
        return float((near - chance) / (count + 10.0))

    best = score(here)
    assert 0.0 <= best <= 1.0
    if abs(turn) > 0.08:
        assert score(Pose2(0.0, 0.0, turn)) < best
    assert score(Pose2(-0.6, 0.4, turn)) < best


@settings(deadline=None, max_examples=30)
@given(seed=seeds, count=st.integers(3, 25))
def test_more_lines_never_make_a_pose_less_precise(seed: int, count: int) -> None:
    lines = model_lines(seed)
    few = compute_view_quality(lines[:count], CAMERA, MOUNT.camera_from_robot, Pose2(0.0, 0.0, 0.0), 0.7)
    all_of_them = compute_view_quality(lines, CAMERA, MOUNT.camera_from_robot, Pose2(0.0, 0.0, 0.0), 0.7)
    assert all_of_them.sigma_m <= few.sigma_m * (1.0 + 1e-9)
    assert all_of_them.sigma_rad <= few.sigma_rad * (1.0 + 1e-9)
    none = compute_view_quality(lines[:0], CAMERA, MOUNT.camera_from_robot, Pose2(0.0, 0.0, 0.0), 0.7)
    assert none.sigma_m == math.inf
