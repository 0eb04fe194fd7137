"""Laws of living through a run again: known pictures change nothing but who makes them; parts of motions are parts."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from box_rooms import box_room
from harvey.simulation.body_replay import part_of
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.body.wheel_errors import ActuatorParameters
from world_models.camera import Camera, CameraMount
from world_models.entries import CameraPicture, MotorCommand
from world_models.frames import Pose2

BUILDING = SimulatedBuilding.of_faces(box_room(), samples=1)
CAMERA = Camera.from_field_of_view(math.radians(65.0), 64, 64)
PARTS = st.floats(0.0, 1.0)
COMMANDS = st.builds(MotorCommand, st.floats(-3.0, 3.0), st.floats(0.0, 2.0))


@given(COMMANDS, PARTS, PARTS)
def test_a_part_of_a_motion_is_no_more_than_the_motion(command: MotorCommand, one: float, other: float) -> None:
    less, more = (part_of(command, part, ActuatorParameters()) for part in sorted((one, other)))
    assert 0.0 <= less.move_m <= more.move_m <= command.move_m
    assert 0.0 <= abs(less.turn_rad) <= abs(more.turn_rad) <= abs(command.turn_rad)
    assert less.turn_rad * command.turn_rad >= 0.0


@given(COMMANDS, PARTS)
def test_it_moves_only_when_it_has_turned(command: MotorCommand, part: float) -> None:
    done = part_of(command, part, ActuatorParameters())
    assert done.move_m == 0.0 or done.turn_rad == pytest.approx(command.turn_rad)


def body(seed: int) -> SimulatedBody:
    return SimulatedBody(BUILDING, Pose2(2.0, 2.2, 0.3), CAMERA, CameraMount(1.0, 0.1), seed=seed)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.lists(st.one_of(COMMANDS, st.none()), max_size=8), st.integers(0, 8))
def test_known_pictures_change_nothing_but_who_makes_them(
    seed: int, acts: list[MotorCommand | None], known: int
) -> None:
    """None is a look. The first pictures are known from the first body, the others are made."""
    first, second = body(seed), body(seed)
    answers = [first.look() if act is None else first.execute(act) for act in acts]
    pictures = {a.number: a.jpeg for a in answers if isinstance(a, CameraPicture) and a.number < known}
    second.use_recorded({number: jpeg[:-2] + b"!!" for number, jpeg in pictures.items()})
    again = [second.look() if act is None else second.execute(act) for act in acts]
    for one, other in zip(answers, again, strict=True):
        if isinstance(one, CameraPicture) and isinstance(other, CameraPicture) and one.number < known:
            assert other.jpeg == one.jpeg[:-2] + b"!!"  # it is the picture that was handed over
            assert (other.number, other.sim_time_s) == (one.number, one.sim_time_s)
        else:
            assert one == other
    assert first.track == second.track
