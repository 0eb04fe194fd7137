"""The body in miniworld: it bumps where something stands, errs as it says, is the same again, and drives a mission."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from one_room import CAMERA, MOUNT, needs_egl, plain_floor

import harvey
from harvey_miniworld.floor_missions import draw_mission
from harvey_miniworld.miniworld_body import MiniworldBody
from harvey_miniworld.textured_floor import StandingThing
from world_models.actuator import ActuatorModel
from world_models.entries import MotorCommand
from world_models.frames import Pose2
from world_models.robot import RobotModel

BOX = StandingThing("box", 4.0, 2.0, 0.3, (0.5, 0.5, 0.6))
WHEELS = ActuatorModel(reach=1.0)


def build_body(start: Pose2, seed: int = 0, kidnap: tuple[float, Pose2] | None = None) -> MiniworldBody:
    needs_egl()
    robot = RobotModel(harvey.build_world(plain_floor().plan), CAMERA, MOUNT, WHEELS, 0.3)
    return MiniworldBody(plain_floor(BOX), robot, start, seed, kidnap)


@pytest.mark.parametrize("heading", np.linspace(-3.0, 3.0, 9))
def test_it_stops_at_the_box_and_feels_from_which_side(heading: float) -> None:
    start = Pose2(4.0, 2.0, heading) @ Pose2(-1.2, 0.05, 0.0)
    body = build_body(start)
    report = body.execute(MotorCommand(0.0, 2.0, 0.09))
    contact = body.take_contact()
    body.close()
    assert contact is not None and body.contacts == [0.09] and body.take_contact() is None
    assert 0.4 < report.move_m < 1.2 and abs(contact.direction_rad) < 1.1
    gap = shapely.Point(body.pose.x_m, body.pose.y_m).distance(BOX.shape)
    assert 0.3 <= gap < 0.33
    away = body.execute(MotorCommand(math.pi, 0.3))
    assert away.move_m == pytest.approx(0.3) and body.take_contact() is None


def test_it_errs_as_its_actuator_says() -> None:
    ends = []
    for seed in range(40):
        body = build_body(Pose2(1.0, 3.0, 0.0), seed)
        report = body.execute(MotorCommand(-0.5, 2.0))
        body.close()
        assert (report.turn_rad, report.move_m) == (-0.5, 2.0)
        off = (Pose2(1.0, 3.0, 0.0) @ WHEELS.predict_motion(-0.5, 2.0)).inverse() @ body.pose
        ends.append((off.x_m, off.y_m, off.heading_rad))
    told = np.sqrt(np.diag(WHEELS.motion_covariance(-0.5, 2.0)))[2]
    assert 0.6 * told < np.std([heading for *_, heading in ends]) < 1.5 * told


def test_the_same_seed_moves_the_same_and_a_kidnap_comes_after_its_way() -> None:
    away = Pose2(5.0, 3.5, 1.0)
    bodies = [build_body(Pose2(1.0, 3.0, 0.0), 3, kidnap) for kidnap in (None, None, (1.2, away))]
    for body in bodies:
        body.execute(MotorCommand(0.0, 1.0))
    assert bodies[0].pose == bodies[1].pose == bodies[2].pose
    bodies[2].execute(MotorCommand(0.0, 0.4))
    assert bodies[2].pose == away
    for body in bodies:
        body.close()


@pytest.mark.parametrize("row", ["plain", "kidnap", "things"])
def test_missions_are_drawn_where_a_robot_can_stand(row: str) -> None:
    needs_egl()
    for seed in range(4):
        drawn = draw_mission(seed, row)
        free = drawn.floor.free
        places = [drawn.stands, *([drawn.kidnap[1]] if drawn.kidnap else [])]
        assert all(shapely.Point(place.x_m, place.y_m).distance(free.boundary) > 0.3 for place in places)
        assert drawn.start.distance_to(drawn.stands) == pytest.approx(0.03)
        assert (drawn.kidnap is not None) == (row == "kidnap") and len(drawn.floor.added) == 2 * (row == "things")
        assert drawn.rooms[0] != drawn.rooms[1]
