"""Laws of touch: a contact is felt where something is, once for each collision, and belongs to the motion it ended."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Blackboard, Effect, Entry, Post, Posted
from box_rooms import box_room
from harvey.runner.ports import BodyPort
from sim.body.faulty_body import FaultyBody
from sim.body.senses import Bumper
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.body.wheel_errors import ActuatorParameters
from world_models.camera import Camera, CameraMount
from world_models.entries import AROUND_SIGMA_RAD, BodyFault, Contact, Course, MotionReport, MotorCommand
from world_models.entries.obstacle import AHEAD_SIGMA_RAD
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 64, 64)
BUILDING = SimulatedBuilding.of_faces(box_room(), samples=1)
COMMANDS = st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(0.0, 2.0)), max_size=12)
SECTORS = st.integers(1, 36)
ANGLES = st.floats(-math.pi, math.pi)


def body(seed: int, sectors: int = 12) -> SimulatedBody:
    return SimulatedBody(BUILDING, Pose2(2.0, 2.2, 0.3), CAMERA, CameraMount(1.0, 0.1), seed=seed,
                         actuator=ActuatorParameters(), bumper=Bumper(sectors))


def answers(port: BodyPort, board: Blackboard, request: Any) -> list[Entry[Any]]:
    """What a port answers to a request, on the board."""
    (asked,) = board.apply([Post(request)], author="motor", cycle=1)
    effects: Iterable[Effect] = port.answer(Posted(asked.entry))
    return [change.entry for change in board.apply(effects, author="body", cycle=2)]


@given(ANGLES, SECTORS)
def test_a_bumper_tells_the_sector_that_was_touched(direction_rad: float, sectors: int) -> None:
    contact = Bumper(sectors).feel(direction_rad, 1.0)
    off_rad = abs(math.remainder(contact.direction_rad - direction_rad, math.tau))
    assert off_rad <= math.pi / sectors + 1e-9 and contact.by == "bumper"
    assert contact.sigma_rad == pytest.approx(math.tau / sectors / math.sqrt(12.0))


@given(ANGLES)
def test_without_a_bumper_only_the_direction_of_the_motion_is_known(direction_rad: float) -> None:
    contact = Bumper(0).feel(direction_rad, 1.0)
    assert (contact.by, contact.direction_rad, contact.sigma_rad) == ("stall", 0.0, AHEAD_SIGMA_RAD)
    assert Contact.of_stall(1.0, turning=True).sigma_rad == AROUND_SIGMA_RAD


@given(st.floats(0.5, 3.5), st.floats(0.5, 3.5), ANGLES)
def test_the_nearest_obstacle_lies_in_its_direction(x_m: float, y_m: float, heading_rad: float) -> None:
    obstacles, pose = BUILDING.obstacles, Pose2(x_m, y_m, heading_rad)
    away_m = obstacles.clearance_m(pose, 0.0)
    angle = heading_rad + obstacles.nearest_direction_rad(pose)
    there = Pose2(x_m + away_m * math.cos(angle), y_m + away_m * math.sin(angle), 0.0)
    assert obstacles.clearance_m(there, 0.0) == pytest.approx(0.0, abs=1e-6)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), SECTORS, COMMANDS)
def test_each_collision_is_felt_once_and_where_the_wall_is(
    seed: int, sectors: int, commands: list[tuple[float, float]]
) -> None:
    robot, board = body(seed, sectors), Blackboard()
    port = BodyPort(FaultyBody(robot))
    for command in commands:
        before = robot.truth.collisions
        entries = answers(port, board, MotorCommand(*command))
        contacts = [entry for entry in entries if isinstance(entry.value, Contact)]
        assert len(contacts) == robot.truth.collisions - before
        assert isinstance(entries[-1].value, MotionReport)
        for contact in contacts:
            assert contact.because == entries[-1].because and contact.because[0].id.startswith("MotorCommand")
            wall_rad = BUILDING.obstacles.nearest_direction_rad(robot.truth.world_from_robot)
            off_rad = abs(math.remainder(contact.value.direction_rad - wall_rad, math.tau))
            # one more step would have touched, of at most two centimetres
            assert off_rad <= math.pi / sectors + 0.1 or _is_in_a_corner(robot.truth.world_from_robot)


def _is_in_a_corner(pose: Pose2) -> bool:
    """Whether two walls are about as near, so that the nearest may be the other one."""
    gaps = np.hypot(*np.moveaxis(BUILDING.obstacles._gaps(pose), -1, 0))
    return int(np.sum(gaps < gaps.min() + 0.03)) > 1


def test_a_motion_on_the_move_that_ends_by_a_contact_is_a_fault_that_rests_on_it() -> None:
    robot, board = body(3), Blackboard()
    port = BodyPort(FaultyBody(robot))
    found: list[Entry[Any]] = []
    while not any(isinstance(entry.value, BodyFault) for entry in found):
        found = answers(port, board, Course("Leg-1", 0.4, 0.0))
    contact, fault = found
    assert isinstance(contact.value, Contact) and contact.ref in fault.because and fault.because[0] != contact.ref
    assert port._body.take_contact() is None
