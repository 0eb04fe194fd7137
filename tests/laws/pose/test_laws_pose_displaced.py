"""Law of displaced model lines: their fit is the minimum that scipy finds of the loss as it is written down."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import minimize

from knowledge_sources.methods.pose import displacements, fit_displacements
from knowledge_sources.methods.pose.displacements import DISPLACED_PAIR_PX, DISPLACED_UNIT_PX, DISPLACED_WIDTHS_PX
from world_models.building.model_errors import LineErrors
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(np.radians(65.0))
MOUNT = CameraMount(1.0, 0.1, 0.05).camera_from_robot
Array = NDArray[np.float64]


def draw_posts(rng: np.random.Generator) -> Array:
    """(8, 2, 3) upright lines far from each other in the picture, some so short that they weigh less [m]."""
    x = rng.uniform(4.0, 6.0, 8)
    foot = np.stack([x, x * np.linspace(-0.4, 0.4, 8), rng.uniform(0.6, 1.0, 8)], axis=1)
    heights = np.where(np.arange(8) % 3 == 0, 0.12, 0.8)[:, None] * [0.0, 0.0, 1.0]
    return np.stack([foot, foot + heights], axis=1)


def project(lines: Array, state: Array) -> Array:
    return CAMERA.project((MOUNT @ Pose2(*state).lifted().inverse()).apply(lines))


def measure_across(segments: Array, lines_px: Array) -> Array:
    """(n, 2) distances of both ends of segments from infinite lines [px]."""
    along = lines_px[:, 1] - lines_px[:, 0]
    by = segments - lines_px[:, :1]
    return (along[:, None, 0] * by[..., 1] - along[:, None, 1] * by[..., 0]) / np.linalg.norm(along, axis=1)[:, None]


@given(seed=st.integers(0, 2**32 - 1), is_pose_known=st.booleans())
@settings(max_examples=25, deadline=None)
def test_the_fit_is_the_minimum_of_its_loss(seed: int, is_pose_known: bool) -> None:
    """Welsch's loss of the mean squared distance of each pair, by its length, and squared deviations of the prior."""
    rng = np.random.default_rng(seed)
    lines = draw_posts(rng)
    errors = LineErrors(("one", "two", "three"), rng.normal(0.0, 0.01, (3, len(lines), 3)))
    covariance = None if is_pose_known else np.diag([0.02, 0.02, 0.002]) ** 2
    free = 0 if covariance is None else 3
    away = np.zeros(3) if covariance is None else rng.multivariate_normal(np.zeros(3), covariance)
    segments = project(errors.displace(lines, rng.uniform(-1.5, 1.5, 3)), away)
    segments += rng.normal(0.0, 0.2, segments.shape)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(displacements, "DISPLACED_STEPS", 60)  # so many that the fit has come to rest
        found = fit_displacements(lines, errors, segments, CAMERA, MOUNT, Pose2(0.0, 0.0, 0.0), covariance)
    width = min(DISPLACED_WIDTHS_PX)
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    weights = np.minimum(1.0, lengths / DISPLACED_UNIT_PX)
    assert weights.min() < 1.0

    def compute_loss(unknowns: Array) -> float:
        state, amplitudes = np.pad(unknowns[:free], (0, 3 - free)), unknowns[free:]
        squared = measure_across(segments, project(errors.displace(lines, amplitudes), state)) ** 2
        welsch = 2.0 * np.sum(weights * (1.0 - np.exp(-0.5 * squared.mean(axis=1) / width**2)))
        prior = amplitudes @ amplitudes
        if covariance is not None:
            prior += state @ np.linalg.solve(covariance, state)
        return float(welsch + 0.5 * prior)

    scale = np.concatenate([[0.02, 0.02, 0.002][:free], np.ones(3)])
    own = np.concatenate([found.state[:free], found.amplitudes])
    best = minimize(lambda u: compute_loss(u * scale), own / scale, method="BFGS", options={"gtol": 1e-7})
    assert compute_loss(own) - best.fun < 1e-6
    assert np.array_equal(found.lines_world, errors.displace(lines, found.amplitudes))
    near = np.abs(measure_across(segments, project(found.lines_world, found.state))).max(axis=1)
    assert found.pairs.tolist() == [[i, i] for i in np.flatnonzero(near <= DISPLACED_PAIR_PX)]
