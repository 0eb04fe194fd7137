"""Laws of the pose from lines of an inexact model, with brute force over displaced models as an oracle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from knowledge_sources.methods.pose import planar, planar_from_lines
from world_models.building.model_errors import LineErrors, exact
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2, wrap_angle

CAMERA = Camera.from_field_of_view(np.radians(65.0))
MOUNT = CameraMount(1.0, 0.1, 0.05).camera_from_robot
SIGMA_PX = 0.3
PRIOR = np.diag([0.2, 0.2, 0.05]) ** 2
TRUTH = Pose2(0.0, 0.0, 0.0)
seeds = st.integers(0, 2**32 - 1)
quick = settings(max_examples=15, deadline=None)
Array = NDArray[np.float64]


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planar, "MARGINAL_SPREAD", 1.0)
    monkeypatch.setattr(planar, "SHARED_PRIOR_FACTOR", 0.0)


def build_hall(sigma_m: float = 0.05) -> tuple[Array, LineErrors]:
    """Two walls of a hall with doors (n, 2, 3), and how well they are known: walls across, doors along."""
    lines: list[Any] = []
    modes: dict[str, list[tuple[int, Array]]] = {}
    for y in (-1.2, 1.2):
        for z in (0.0, 2.4):
            modes.setdefault(f"wall {y}", []).append((len(lines), np.array([0.0, sigma_m, 0.0])))
            lines.append([[2.5, y, z], [15.0, y, z]])
        for x in (3.0, 5.5, 8.0, 11.0):
            far = x + 0.9
            for line in ([[x, y, 0.0], [x, y, 2.1]], [[far, y, 0.0], [far, y, 2.1]], [[x, y, 2.1], [far, y, 2.1]]):
                modes.setdefault(f"wall {y}", []).append((len(lines), np.array([0.0, sigma_m, 0.0])))
                modes.setdefault(f"door {x} {y}", []).append((len(lines), np.array([sigma_m, 0.0, 0.0])))
                lines.append(line)
    shifts = np.zeros((len(modes), len(lines), 3))
    for k, rows in enumerate(modes.values()):
        for i, by in rows:
            shifts[k, i] = by
    return np.array(lines), LineErrors(tuple(modes), shifts)


def observe(lines: Array, rng: np.random.Generator) -> tuple[Array, NDArray[np.bool_]]:
    segments, visible = CAMERA.project_segments(lines, MOUNT @ TRUTH.lifted().inverse())
    return segments + rng.normal(0.0, SIGMA_PX, segments.shape), visible


def solve(seed: int, sigma_m: float = 0.05) -> tuple[Array, Array]:
    """Error (3,) and stated covariance (3, 3) where the true building is drawn from the model's errors."""
    rng = np.random.default_rng(seed)
    model, errors = build_hall(sigma_m)
    segments, visible = observe(errors.displace(model, rng.normal(size=len(errors.displacement_modes))), rng)
    away = rng.multivariate_normal(np.zeros(3), PRIOR)
    found = planar_from_lines(
        model[visible], segments[visible], CAMERA, MOUNT, Pose2(*away), prior_covariance=PRIOR, sigma_px=SIGMA_PX,
        errors=errors.take(np.flatnonzero(visible)))
    pose = found.world_from_robot
    return np.array([pose.x_m, pose.y_m, wrap_angle(pose.heading_rad)]), found.covariance


@given(seed=seeds)
@quick
def test_an_exact_model_is_solved_as_before_to_the_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, errors = build_hall()
    segments, visible = observe(errors.displace(model, rng.normal(size=len(errors.displacement_modes))), rng)
    args: tuple[Any, ...] = (model[visible], segments[visible], CAMERA, MOUNT, Pose2(0.1, 0.05, 0.02))
    one = planar_from_lines(*args, prior_covariance=PRIOR, sigma_px=SIGMA_PX)
    other = planar_from_lines(*args, prior_covariance=PRIOR, sigma_px=SIGMA_PX, errors=exact(len(args[0])))
    assert one.world_from_robot == other.world_from_robot and np.array_equal(one.covariance, other.covariance)


def test_ellipsoids_hold_as_often_as_they_say() -> None:
    held = []
    for seed in range(150):
        error, covariance = solve(seed)
        held.append(float(error @ np.linalg.solve(covariance, error)) < 7.815)
    assert 0.90 <= np.mean(held) <= 0.99


def test_what_lines_share_does_not_average_out() -> None:
    """Across the hall nothing is known better than by its two walls."""
    for sigma_m in (0.05, 0.02):
        assert np.sqrt(solve(1, sigma_m)[1][1, 1]) > sigma_m / np.sqrt(2.0) * 0.98


@given(seed=seeds, sigma_m=st.sampled_from([0.01, 0.03, 0.06]))
@quick
def test_a_worse_model_never_states_a_smaller_covariance(seed: int, sigma_m: float) -> None:
    rng = np.random.default_rng(seed)
    model, _ = build_hall()
    segments, visible = observe(model, rng)
    at = np.flatnonzero(visible)
    covariances = [planar_from_lines(
        model[at], segments[at], CAMERA, MOUNT, TRUTH, prior_covariance=PRIOR, sigma_px=SIGMA_PX, robust=False,
        errors=build_hall(size)[1].take(at)).covariance for size in (sigma_m, 2.0 * sigma_m)]
    assert np.linalg.eigvalsh(covariances[1] - covariances[0]).min() > -1e-9
