"""A lost robot makes no move into what it has just touched, wherever it is (§2, §4)."""

from __future__ import annotations

import cmath
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.generated.floors import generated_floor
from knowledge_sources.methods.localization.next_view import (
    MOVE_CLEARANCE_M,
    PoseHypothesis,
    SensingAction,
    make_safety_check,
)
from knowledge_sources.reads import list_contacts, locate_contact
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.entries import AROUND_SIGMA_RAD, Contact, MotionReport
from world_models.frames import Pose2
from world_models.robot import RobotModel

ROBOT = RobotModel(generated_floor(11, 4).world, Camera.from_field_of_view(1.1), CameraMount(1.0, 0.1), ActuatorModel())
CLEARANCE_M = ROBOT.radius_m + MOVE_CLEARANCE_M
angles = st.floats(-math.pi, math.pi)
moves = st.floats(0.05, 1.2)


def middle_of_a_room() -> PoseHypothesis:
    room = ROBOT.world.rooms[0]
    x_m, y_m = np.mean(ROBOT.world.outline(room), axis=0).tolist()
    return PoseHypothesis(room, Pose2(x_m, y_m, 0.3), 1.0)


@given(angles, angles, moves, st.floats(0.2, 1.5))
def test_a_move_into_what_was_touched_is_not_safe(bearing: float, turn: float, move_m: float, away_m: float) -> None:
    """By the way itself, in small steps: it comes too near to a point that is not behind the robot."""
    here, point = middle_of_a_room(), away_m * np.array([math.cos(bearing), math.sin(bearing)])
    along = np.array([math.cos(turn), math.sin(turn)])
    ahead_m = float(point @ along)
    nearest_m = min(float(np.linalg.norm(point - s * along)) for s in np.linspace(0.0, move_m, 241))
    action = SensingAction(turn, move_m, 0.0)
    plain, touching = make_safety_check(ROBOT), make_safety_check(ROBOT, [point])
    if ahead_m > 1e-6 and nearest_m < CLEARANCE_M - 1e-6:
        assert not touching(here, action)
    if ahead_m < -1e-6 or abs(float(point @ [-along[1], along[0]])) > CLEARANCE_M + 1e-6:
        assert touching(here, action) == plain(here, action)


@given(angles, angles, moves)
def test_left_and_right_are_the_same(bearing: float, turn: float, move_m: float) -> None:
    def is_safe(sign: int) -> tuple[bool, bool]:
        point = ROBOT.radius_m * np.array([math.cos(bearing), sign * math.sin(bearing)])
        here, action = middle_of_a_room(), SensingAction(sign * turn, move_m, 0.0)
        return make_safety_check(ROBOT)(here, action), make_safety_check(ROBOT, [point])(here, action)

    (plain, touching), (mirrored, mirrored_touching) = is_safe(1), is_safe(-1)
    if plain and mirrored:
        assert touching is mirrored_touching


def entry(name: str, value: object, cycle: int, request: str) -> Any:
    return SimpleNamespace(id=name, value=value, cycle=cycle, because=(SimpleNamespace(id=request),))


def board(contacts: list[Any], reports: list[Any]) -> Any:
    """A view of a board with these contacts and motion reports."""
    return SimpleNamespace(
        latest=lambda kind, *_: contacts[-1] if contacts and kind is Contact else None,
        where=lambda kind, which: [c for c in contacts if which(c.value)],
        since=lambda kind, cycle: [r for r in reports if r.cycle >= cycle])


@given(angles, st.lists(st.tuples(angles, st.floats(0.0, 1.0)), max_size=4))
def test_a_contact_stays_where_it_was_felt_as_the_robot_moves(
    direction: float, motions: list[tuple[float, float]]
) -> None:
    """Recomputed with complex numbers; the motion that ended in it is not counted twice."""
    touch = entry("Contact-1", Contact("bumper", direction, 0.2, 1.0), 5, "MotorCommand-1")
    own = entry("MotionReport-1", MotionReport(0.3, 0.4, 1.0, 1.0), 5, "MotorCommand-1")
    later = [entry(f"MotionReport-{k}", MotionReport(turn, move, 1.0, 1.0), 6 + k, f"MotorCommand-{k}")
             for k, (turn, move) in enumerate(motions, 2)]
    at = cmath.rect(ROBOT.radius_m, direction)
    for turn, move in motions:
        step = ROBOT.actuator.predict_motion(turn, move)
        at = (at - complex(step.x_m, step.y_m)) * cmath.exp(-1j * step.heading_rad)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("knowledge_sources.reads.lost.find_robot", lambda view: ROBOT)
        found = locate_contact(board([touch], [own, *later]), touch)
    assert found == pytest.approx(np.array([at.real, at.imag]), abs=1e-9)


@pytest.mark.parametrize(("cycles", "sigmas", "named"), [
    ((8, 12), (0.2, 0.2), 1), ((12, 13), (0.2, 0.2), 2), ((8,), (0.2,), 1), ((7, 8), (0.2, 0.2), 1),
    ((12,), (AROUND_SIGMA_RAD,), 0), ((), (), 0)])
def test_what_was_touched_since_it_is_lost_counts_and_the_last_before(
    cycles: tuple[int, ...], sigmas: tuple[float, ...], named: int
) -> None:
    contacts = [entry(f"Contact-{k}", Contact("bumper", 0.0, sigma, 1.0), cycle, f"MotorCommand-{k}")
                for k, (cycle, sigma) in enumerate(zip(cycles, sigmas, strict=True))]
    found = list_contacts(board(contacts, []), entry("Discrepancy-1", None, 10, "Discrepancy-0"))
    assert len(found) == named
    assert all(c.cycle >= 10 or c is contacts[-1] for c in found)
