"""Laws of the actuator model: where a motion ends, and that no motion makes the robot surer of where it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from world_models.actuator import ActuatorModel
from world_models.frames import Pose2

ACTUATOR = ActuatorModel()
PARTS = {"course": ACTUATOR.propagate_course, "move": ACTUATOR.propagate_move}

poses = st.builds(Pose2, st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-3.0, 3.0))
turns = st.floats(-0.5, 0.5) | st.just(0.0)
moves = st.floats(-1.0, 1.0) | st.just(0.0)
curvatures = st.floats(-0.05, 0.05)


@st.composite
def covariances(draw: st.DrawFn) -> NDArray[np.float64]:
    """(3, 3) of (x, y, heading) [m, m, rad], with any correlation."""
    root = np.array(draw(st.lists(st.floats(-0.3, 0.3), min_size=9, max_size=9))).reshape(3, 3)
    return np.asarray(root @ root.T)


def integrate(pose: Pose2, turn_rad: float, gone_m: float, steps: int = 2000) -> NDArray[np.float64]:
    """(x, y, heading) after turning and driving at constant rates, in small straight steps."""
    headings = pose.heading_rad + turn_rad * (np.arange(steps) + 0.5) / steps
    ahead = gone_m / steps
    return np.array([pose.x_m + ahead * np.cos(headings).sum(), pose.y_m + ahead * np.sin(headings).sum(),
                     pose.heading_rad + turn_rad])


def as_vector(pose: Pose2) -> NDArray[np.float64]:
    return np.array([pose.x_m, pose.y_m, pose.heading_rad])


def subtract(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """The difference of two poses, the headings' in -pi..pi."""
    gap = one - other
    gap[2] = math.remainder(gap[2], 2.0 * math.pi)
    return gap


@given(poses, turns, moves, curvatures)
@example(Pose2(0.0, 0.0, 0.0), 0.3, 0.0, 0.0)
@example(Pose2(0.0, 0.0, 0.0), 0.3, -0.5, 0.02)
@example(Pose2(0.0, 0.0, 0.0), 0.3, 5e-324, 0.0)
def test_a_course_ends_where_it_leads_in_small_steps(
    pose: Pose2, turn_rad: float, move_m: float, curvature_per_m: float
) -> None:
    gone_m = ACTUATOR.reach * move_m
    after, _ = ACTUATOR.propagate_course(pose, np.zeros((3, 3)), turn_rad, move_m, curvature_per_m)
    driven = integrate(pose, turn_rad + curvature_per_m * gone_m, gone_m)
    np.testing.assert_allclose(subtract(as_vector(after), driven), 0.0, atol=1e-6)


@given(poses, turns, moves, curvatures)
@example(Pose2(0.0, 0.0, 0.0), 0.3, -0.5, 0.02)
def test_a_move_ends_where_a_turn_and_then_a_drive_lead_in_small_steps(
    pose: Pose2, turn_rad: float, move_m: float, curvature_per_m: float
) -> None:
    gone_m = ACTUATOR.reach * move_m
    after, _ = ACTUATOR.propagate_move(pose, np.zeros((3, 3)), turn_rad, move_m, curvature_per_m)
    turned = Pose2(pose.x_m, pose.y_m, pose.heading_rad + turn_rad)
    driven = integrate(turned, curvature_per_m * gone_m, gone_m)
    np.testing.assert_allclose(subtract(as_vector(after), driven), 0.0, atol=1e-6)


@pytest.mark.parametrize("kind", PARTS)
@given(poses, covariances(), turns, moves, curvatures)
@example(Pose2(0.0, 0.0, 0.0), np.eye(3) * 1e-3, 0.0, -0.5, 0.0)
@example(Pose2(0.0, 0.0, 0.0), np.eye(3) * 1e-3, 0.3, 0.0, 0.0)
def test_no_motion_makes_the_robot_surer(
    kind: str, pose: Pose2, covariance: NDArray[np.float64], turn_rad: float, move_m: float, curvature_per_m: float
) -> None:
    """What is added to the covariance carried along has no negative direction.

    It is carried along by finite differences of the motion itself.
    """
    def drive(start: NDArray[np.float64]) -> NDArray[np.float64]:
        end, _ = PARTS[kind](Pose2(*start.tolist()), np.zeros((3, 3)), turn_rad, move_m, curvature_per_m)
        return as_vector(end)

    start, step = as_vector(pose), 1e-5
    carry = np.column_stack([subtract(drive(start + d), drive(start - d)) / (2 * step) for d in np.eye(3) * step])
    _, after = PARTS[kind](pose, covariance, turn_rad, move_m, curvature_per_m)
    added = after - carry @ covariance @ carry.T
    np.testing.assert_allclose(after, after.T, atol=1e-12)
    assert np.linalg.eigvalsh((added + added.T) / 2.0).min() > -1e-9


@pytest.mark.parametrize("kind", PARTS)
@given(turns, moves)
@example(0.0, -0.04)
def test_a_motion_backwards_is_as_uncertain_as_forwards(kind: str, turn_rad: float, move_m: float) -> None:
    start, none = Pose2(0.0, 0.0, 0.0), np.zeros((3, 3))
    _, ahead = PARTS[kind](start, none, turn_rad, move_m, 0.0)
    _, back = PARTS[kind](start, none, turn_rad, -move_m, 0.0)
    np.testing.assert_allclose(np.diag(back), np.diag(ahead), atol=1e-12)


@given(st.floats(0.05, 0.5), st.sampled_from([-1.0, 1.0]))
def test_a_turn_on_the_spot_in_a_course_makes_its_heading_less_sure(turn_rad: float, side: float) -> None:
    start, none = Pose2(0.0, 0.0, 0.0), np.zeros((3, 3))
    after, covariance = ACTUATOR.propagate_course(start, none, side * turn_rad, 0.0, 0.0)
    assert math.isclose(after.heading_rad, side * turn_rad)
    assert math.sqrt(covariance[2, 2]) >= 0.99 * ACTUATOR.turn_sigma * turn_rad
