"""Laws of location and of the actuator model: nothing invents precision, and every frame is there and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from world_models.actuator import ActuatorModel
from world_models.commands import parse_ptrans
from world_models.entries import Hypothesis, Place, diagonal
from world_models.frames import Pose, Pose2, wrap_angle
from world_models.units import FOOT_M

angles = st.floats(-math.pi, math.pi)
lengths = st.floats(-20.0, 20.0)
poses = st.builds(Pose2, lengths, lengths, angles)


class OneRoom:
    """A world of one locale whose frame is wherever it is put."""

    def __init__(self, frame: Pose2) -> None:
        self._frame = frame.lifted()

    def world_from_locale(self, name: str, /) -> Pose:
        return self._frame


def same(a: Pose2, b: Pose2) -> bool:
    return a.distance_to(b) < 1e-9 and abs(wrap_angle(a.heading_rad - b.heading_rad)) < 1e-9


@settings(deadline=None)
@given(frame=poses, pose=poses, sigma=st.floats(0.001, 1.0), turn=st.floats(0.001, 0.5))
def test_a_hypothesis_is_the_same_in_the_world_and_in_its_locale(
    frame: Pose2, pose: Pose2, sigma: float, turn: float
) -> None:
    world, spread = OneRoom(frame), np.diag([sigma**2, 4.0 * sigma**2, turn**2])
    belief = Hypothesis.of_world(world, "room", pose, spread, "command")
    assert same(belief.world_from_robot(world), pose)
    assert np.allclose(belief.covariance_world(world), spread, atol=1e-9)
    assert belief.sigma_m == pytest.approx(2.0 * sigma) and belief.sigma_rad == pytest.approx(turn)


@settings(deadline=None)
@given(frame=poses, x=lengths, y=lengths, heading=angles)
def test_a_place_is_there_and_back(frame: Pose2, x: float, y: float, heading: float) -> None:
    world = OneRoom(frame)
    place = Place.of_world(world, "room", x, y, heading)
    assert same(place.in_world(world), Pose2(x, y, heading))
    assert Place.of_world(world, "room", x, y).heading_rad is None


@settings(deadline=None)
@given(pose=poses, turn=st.floats(-3.0, 3.0), move=st.floats(0.0, 2.0), sigma=st.floats(0.001, 0.3))
def test_moving_never_makes_surer(pose: Pose2, turn: float, move: float, sigma: float) -> None:
    before = np.array(diagonal(sigma, sigma))
    after, covariance = ActuatorModel().propagate_move(pose, before, turn, move)
    assert np.allclose(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0
    assert np.linalg.det(covariance) >= np.linalg.det(before)
    assert covariance[2, 2] >= before[2, 2]
    assert after.distance_to(pose) == pytest.approx(ActuatorModel().reach * move, abs=1e-9)


@settings(deadline=None)
@given(length=st.floats(0.0, 5.0))
def test_what_is_commanded_is_what_is_gone(length: float) -> None:
    model = ActuatorModel()
    assert model.predict_motion(0.0, model.compute_command_m(length)).x_m == pytest.approx(length)


@given(x=st.integers(-50, 50), y=st.integers(-50, 50))
def test_ptrans_is_read_in_feet(x: int, y: int) -> None:
    start, end = parse_ptrans(f"(ptrans (a ({x},{y},0)) (allen's-office (1.5,2,0)))")
    assert (start.locale, end.locale) == ("a", "allen's-office")
    assert (start.x_m, start.y_m) == pytest.approx((x * FOOT_M, y * FOOT_M))


@given(text=st.text(max_size=60))
def test_any_other_text_is_refused_in_words(text: str) -> None:
    with pytest.raises(ValueError, match="expected a goal like"):
        parse_ptrans(text)
