"""Laws of the way since a known place: a yaw that is wrong turns the way that is expected, and nothing else does."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from world_models.actuator import arc
from world_models.entries import Travel, begin_travel, turn_about_camera
from world_models.frames import Pose2, wrap_angle

poses = st.builds(Pose2, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))
motions = st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(0.1, 1.0)), min_size=1, max_size=8)


def drive(start: Pose2, steps: list[tuple[float, float]], yaw_error: float, bend: float = 0.0) -> tuple[Travel, Pose2]:
    """The way by headings that are too large by a yaw error, and where the robot really came to."""
    off = Pose2(0.0, 0.0, yaw_error)
    travel, truth = begin_travel(start @ off, np.eye(3), 0.0, 1.0), start
    for turn, move in steps:
        straight = truth @ off @ Pose2(0.0, 0.0, turn) @ Pose2(move, 0.0, 0.0)
        believed, truth = truth @ off, truth @ Pose2(0.0, 0.0, turn) @ arc(move, bend)
        travel = travel.after_motion(believed, straight, 0.0)
    return travel.seen(truth.heading_rad + yaw_error), truth


@given(poses, motions, st.floats(-0.2, 0.2))
def test_the_way_is_turned_by_the_yaw_s_error_and_by_nothing_else(
    start: Pose2, steps: list[tuple[float, float]], yaw: float
) -> None:
    travel, end = drive(start, steps, yaw)
    came = end.position - start.position
    c, s = math.cos(yaw), math.sin(yaw)
    assert np.allclose((travel.x_m, travel.y_m), (c * came[0] - s * came[1], s * came[0] + c * came[1]), atol=1e-9)
    assert travel.gone_m == pytest.approx(sum(move for _, move in steps))
    assert travel.net_m <= travel.gone_m + 1e-9


@given(poses, st.floats(-0.1, 0.1), st.floats(0.2, 0.7))
@example(Pose2(0.0, 0.0, 0.0), 2.0**-24, 0.21875)  # the true arc's own rounding: 1 - cos of next to nothing
def test_what_the_wheels_drift_is_no_yaw(start: Pose2, bend: float, move: float) -> None:
    travel, end = drive(start, [(0.0, move)] * 4, 0.0, bend)
    came = end.position - start.position
    off = wrap_angle(math.atan2(travel.y_m, travel.x_m) - math.atan2(came[1], came[0]))
    assert abs(off) < 2e-3 * abs(bend) + 1e-8


@given(poses, st.floats(-0.2, 0.2), st.floats(-0.3, 0.3))
def test_turning_about_the_camera_leaves_it_where_it_is(pose: Pose2, turn: float, forward: float) -> None:
    ahead = Pose2(forward, 0.0, 0.0)
    assert np.allclose((turn_about_camera(pose, turn, forward) @ ahead).position, (pose @ ahead).position)
    assert wrap_angle(turn_about_camera(pose, turn, forward).heading_rad - pose.heading_rad) == pytest.approx(turn)


@given(poses, motions, st.floats(-0.2, 0.2))
def test_headings_that_are_turned_turn_the_way(start: Pose2, steps: list[tuple[float, float]], yaw: float) -> None:
    travel, end = drive(start, steps, yaw)
    mended = travel.turned(-yaw, 0.0)
    assert np.allclose((mended.x_m, mended.y_m), end.position - start.position, atol=1e-9)
    assert wrap_angle(mended.heading_rad - end.heading_rad) == pytest.approx(0.0, abs=1e-9)
    assert "of way" in mended.sentence()
