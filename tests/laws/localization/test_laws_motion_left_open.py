"""Laws of what a motion leaves open: second moments of what may have been driven, against draws of it."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.action.dead_reckoner import _compute_aside_covariance, _compute_partial_covariance
from world_models.frames import Pose2

DRAWS = 20_000
headings = st.floats(-math.pi, math.pi)
some = settings(max_examples=40, deadline=None)


@given(
    heading=headings,
    turn_rad=st.floats(-3.0, 3.0).filter(lambda t: abs(t) > 0.01),
    move_m=st.floats(-5.0, 5.0).filter(lambda m: abs(m) > 0.01),
    seed=st.integers(0, 2**32 - 1),
)
@some
def test_any_part_of_a_motion_that_is_missing(heading: float, turn_rad: float, move_m: float, seed: int) -> None:
    """Any part of the MOVE along the heading and, independently of it, any part of the TURN."""
    rng = np.random.default_rng(seed)
    ahead, turned = move_m * rng.random(DRAWS), turn_rad * rng.random(DRAWS)
    found = _compute_partial_covariance(Pose2(1.0, -2.0, heading), turn_rad, move_m)
    cells = np.stack([ahead * math.cos(heading), ahead * math.sin(heading), turned])
    drawn = cells @ cells.T / DRAWS
    scale = np.array([abs(move_m), abs(move_m), abs(turn_rad)])
    expected = np.where(np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], bool), drawn, 0.0)
    np.testing.assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale), atol=0.02)


@given(start=headings, along=headings, way_m=st.floats(0.1, 5.0), sigma=st.floats(1e-3, 0.02),
       seed=st.integers(0, 2**32 - 1))
@some
def test_a_yaw_that_is_not_known_leaves_open_where_a_move_ended(
    start: float, along: float, way_m: float, sigma: float, seed: int
) -> None:
    """A MOVE whose direction is off by a small angle ends on a circle about where it began."""
    yaw = np.random.default_rng(seed).normal(0.0, sigma, DRAWS)
    before = Pose2(3.0, 4.0, start)
    after = Pose2(3.0 + way_m * math.cos(along), 4.0 + way_m * math.sin(along), start)
    ends = way_m * np.stack([np.cos(along + yaw), np.sin(along + yaw)])
    found = _compute_aside_covariance(before, after, sigma**2) / (way_m * sigma) ** 2
    np.testing.assert_allclose(found[:2, :2], np.cov(ends) / (way_m * sigma) ** 2, atol=0.05)
    assert not found[2].any() and not found[:, 2].any()
