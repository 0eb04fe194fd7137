"""Laws of the simulated body: nothing drives through a wall, and the same seed is the same run."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from box_rooms import box_room
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.body.wheel_errors import ActuatorParameters, arc_steps
from world_models.actuator import arc
from world_models.camera import Camera, CameraMount
from world_models.entries import MotorCommand
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 64, 64)
BUILDING = SimulatedBuilding.of_faces(box_room(), samples=1)
COMMANDS = st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(0.0, 2.0)), max_size=12)
SPEED_M_PER_S = ActuatorParameters().speed_m_per_s


def body(seed: int, put_down_sigma: float = 0.0) -> SimulatedBody:
    return SimulatedBody(BUILDING, Pose2(2.0, 2.2, 0.3), CAMERA, CameraMount(1.0, 0.1), seed=seed,
                         put_down_sigma_m=put_down_sigma, put_down_sigma_rad=put_down_sigma)


@given(st.integers(0, 10**6), st.floats(0.0, 2.0))
def test_nobody_puts_it_down_in_a_wall(seed: int, sigma: float) -> None:
    assert BUILDING.obstacles.clearance_m(body(seed, sigma).truth.world_from_robot) >= 0.0


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), COMMANDS)
def test_no_wall_is_entered_and_a_contact_cuts_the_claim(seed: int, commands: list[tuple[float, float]]) -> None:
    robot = body(seed)
    for turn, move in commands:
        before = robot.truth.collisions
        report = robot.execute(MotorCommand(turn, move))
        assert BUILDING.obstacles.clearance_m(robot.truth.world_from_robot) >= 0.0
        assert (robot.truth.collisions > before) == (report.move_m < move - 0.0011)
        if robot.truth.collisions > before:
            assert 0.9 * SPEED_M_PER_S < robot.truth.contact_m_per_s < SPEED_M_PER_S


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), COMMANDS)
def test_time_and_path_only_grow(seed: int, commands: list[tuple[float, float]]) -> None:
    robot = body(seed)
    for command in commands:
        robot.execute(MotorCommand(*command))
    track = robot.track
    assert all(a.time_s <= b.time_s and a.path_m <= b.path_m for a, b in pairwise(track))
    gaps = [a.world_from_robot.distance_to(b.world_from_robot) for a, b in pairwise(track)]
    assert max(gaps, default=0.0) < 0.03


@given(st.floats(-3.0, 3.0), st.floats(-0.3, 0.3))
def test_the_steps_of_an_arc_make_the_arc(length_m: float, curvature_per_m: float) -> None:
    end = Pose2(0.0, 0.0, 0.0)
    for step in arc_steps(length_m, curvature_per_m):
        end = end @ step
    whole = arc(length_m, curvature_per_m)
    assert np.allclose([end.x_m, end.y_m, end.heading_rad], [whole.x_m, whole.y_m, whole.heading_rad], atol=1e-7)


@given(st.integers(0, 10**6))
def test_without_errors_the_body_does_what_it_is_told(seed: int) -> None:
    exact = ActuatorParameters(turn_scale_sigma=0, turn_sigma_rad=0, skitter_sigma_m=0, curvature_low_per_m=0,
                               curvature_high_per_m=0, curvature_sigma_per_m=0, shortfall_low=0, shortfall_high=0,
                               distance_sigma=0)
    robot = SimulatedBody(BUILDING, Pose2(1.0, 2.0, 0.0), CAMERA, CameraMount(1.0), seed=seed, actuator=exact)
    robot.execute(MotorCommand(0.5, 0.8))
    there = robot.truth.world_from_robot
    assert np.allclose([there.x_m, there.y_m], [1.0 + 0.8 * math.cos(0.5), 2.0 + 0.8 * math.sin(0.5)])
