"""Laws of which landmarks are taken to be followed, and of what their templates' beliefs leave open."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime

from knowledge_sources.methods.features import read_picture
from knowledge_sources.methods.tracking import (
    MAX_LANDMARK_DISTANCE_M,
    MAX_TRACKS,
    MIN_SPACING_PX,
    select_landmarks,
    template_tracking,
)
from knowledge_sources.methods.tracking.template_tracking import _compute_anchor_covariance
from lab_pictures import photograph, robot
from world_models.entries import Anchor, Track
from world_models.frames import Pose2

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds, part=st.floats(0.0, 1.0), most=st.integers(1, 12))
@settings(max_examples=12, deadline=None)
def test_new_landmarks_are_apart_from_each_other_and_from_those_kept(seed: int, part: float, most: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.array(robot().world.outline("robot-laboratory"))
    pose = Pose2(*rng.uniform(corners.min(axis=0) + 1.0, corners.max(axis=0) - 1.0), rng.uniform(-math.pi, math.pi))
    image = read_picture(photograph(pose, rng)).grey
    first = select_landmarks(robot(), (), "CameraPicture-1", image, pose)
    assume(len(first) >= 2)
    kept = tuple(replace(track, found_px=None) if rng.random() < 0.3 else track
                 for track in first if rng.random() < part)
    for taken, limit in (((), MAX_TRACKS), (kept, MAX_TRACKS), (kept, most)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(template_tracking, "MAX_TRACKS", limit)
            new = select_landmarks(robot(), taken, "CameraPicture-2", image, pose)
        assert len(new) <= max(0, limit - len(taken))
        at = [track.found_px or track.predicted_px for track in (*taken, *new)]
        for i, here in enumerate(at[len(taken):], len(taken)):
            assert all(math.dist(here, other) >= MIN_SPACING_PX for other in at[:i])
        for track in new:
            point = robot().camera_from_world(pose).apply(np.array(track.point_world))
            assert track.found_px is not None and track.template_frame == "CameraPicture-2"
            np.testing.assert_allclose(robot().camera.project(point), track.found_px, atol=1e-6)
            assert math.isclose(track.template_depth_m, point[2], rel_tol=1e-9)
            assert track.template_depth_m <= 1.001 * MAX_LANDMARK_DISTANCE_M


@given(seed=seeds, count=st.integers(1, 5))
@settings(max_examples=60, deadline=None)
def test_a_pose_is_no_surer_than_the_beliefs_at_which_templates_were_cut(seed: int, count: int) -> None:
    """The mean of each belief's covariance, carried over as a rigid motion of where the belief was: by differences."""
    rng = np.random.default_rng(seed)
    pose = Pose2(*rng.uniform(-5.0, 5.0, 2), rng.uniform(-1.0, 1.0))
    anchors, parts = [], []
    for k in range(count):
        root = rng.normal(0.0, 0.05, (3, 3))
        covariance, at = root @ root.T, Pose2(*rng.uniform(-5.0, 5.0, 2), rng.uniform(-1.0, 1.0))

        def move(error: np.ndarray, at: Pose2 = at) -> np.ndarray:
            there = Pose2(at.x_m + error[0], at.y_m + error[1], at.heading_rad + error[2]) @ at.inverse() @ pose
            return np.array([there.x_m, there.y_m, there.heading_rad])

        lever = approx_fprime(np.zeros(3), move, 1e-6)
        anchors.append(Anchor(f"CameraPicture-{k}", at.x_m, at.y_m, tuple(map(tuple, covariance))))
        parts.append(lever @ covariance @ lever.T)
    which = rng.integers(0, count, 8)
    at_px = (0.0, 0.0)
    seen = [Track("mark", (0.0, 0.0, 1.0), f"CameraPicture-{k}", at_px, 1.0, at_px, at_px, 1.0, 0.5) for k in which]
    np.testing.assert_allclose(
        _compute_anchor_covariance(pose, seen, tuple(anchors)), np.mean([parts[k] for k in which], axis=0), atol=1e-5)
