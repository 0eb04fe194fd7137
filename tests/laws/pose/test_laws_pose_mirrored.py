"""Law of model lines behind the camera: they lie on their segments as well as those in front do, and are left out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.paper.pose_scenes import campus, corridor, draw_prior, end_noise
from knowledge_sources.methods.pose import r_and_t_ml
from knowledge_sources.methods.pose.estimate import BEHIND

SCENES = {"campus": campus(), "corridor": corridor()}
SIGMA_PX = 0.4


@pytest.mark.parametrize("name", list(SCENES))
@given(seed=st.integers(0, 2**32 - 1), part=st.floats(0.0, 0.8))
@settings(max_examples=20, deadline=None)
def test_lines_mirrored_at_the_camera_are_said_to_be_behind(name: str, seed: int, part: float) -> None:
    """A line and its mirror image span the same plane with the camera: distances in the picture cannot tell them."""
    rng, scene = np.random.default_rng(seed), SCENES[name]
    is_mirrored = rng.random(len(scene)) < part
    truth = scene.camera_from_world
    lines = scene.lines_world.copy()
    lines[is_mirrored] = truth.inverse().apply(-truth.apply(lines[is_mirrored]))
    segments = end_noise(scene.segments_px, 0.5 * SIGMA_PX, rng)
    prior = draw_prior(truth, 0.02, 0.002, rng)
    found = r_and_t_ml(lines, segments, scene.camera, prior, landmark_ids=scene.landmark_ids, sigma_px=SIGMA_PX)
    if 2 * np.count_nonzero(is_mirrored) >= len(scene):
        assert not found.ok
        return
    assert found.rejected == tuple(BEHIND if mirrored else None for mirrored in is_mirrored)
    assert np.array_equal(found.inliers, ~is_mirrored)
    assert found.ok
    apart = found.camera_from_world @ truth.inverse()
    error = np.concatenate([apart.rotation_vector, apart.translation])
    assert error @ np.linalg.solve(found.covariance, error) < 40.0
