"""Bumps, kidnaps and lights: once, at their moment, and never into a wall."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from blackboard import Blackboard, Post
from box_rooms import box_room
from harvey.runner.ports import MUST_CHANGE_M, STANDS_STILL, BodyPort, StillCamera
from sim.body.faulty_body import FaultyBody
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.faults.built_in_faults import Bump, CameraFrozen, Kidnap, LightsOff, Stall
from sim.faults.fault import Fault, FaultSchedule
from world_models.camera import Camera, CameraMount
from world_models.entries import BodyFault, CameraPicture, Course, MotorCommand, PictureRequest, Recovery
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 64, 64)


def locale_at(pose: Pose2) -> str:
    return "east" if pose.x_m > 2.0 else "west"


BUILDING = SimulatedBuilding.of_faces(box_room(), locale_at, samples=1)


def body(*faults: Fault) -> SimulatedBody:
    return SimulatedBody(BUILDING, Pose2(1.0, 2.0, 0.0), CAMERA, CameraMount(1.0), seed=4, faults=faults)


def test_a_fault_in_a_locale_counts_from_the_first_entry_and_strikes_once() -> None:
    bump = Bump("hall", after_m=1.0)
    schedule = FaultSchedule.of((bump,)).advance(9.0, 5.0, "lab").advance(1.0, 0.6, "hall")
    assert schedule.take_due("hall")[0] == ()
    schedule = schedule.advance(1.0, 0.6, "hall")
    assert schedule.take_due("lab")[0] == ()
    due, rest = schedule.take_due("hall")
    assert due == (bump,) and rest.take_due("hall")[0] == ()


def test_a_bump_moves_the_robot_but_not_its_encoders() -> None:
    plain, bumped = body(), body(Bump("east", after_m=0.2, left_m=0.3, turn_rad=0.2))
    reports = [[robot.execute(MotorCommand(0.0, 0.5)) for _ in range(4)] for robot in (plain, bumped)]
    assert reports[0] == reports[1]
    a, b = plain.truth.world_from_robot, bumped.truth.world_from_robot
    assert b.heading_rad - a.heading_rad == pytest.approx(0.2, abs=1e-9)
    assert b.y_m - a.y_m > 0.3
    assert plain.truth.path_m == pytest.approx(bumped.truth.path_m)


def test_a_kidnap_ends_in_a_free_place_of_the_same_locale() -> None:
    kidnap = Kidnap(distance_m=1.0, turn_rad=0.35)
    free = [kidnap.find_free_pose(Pose2(1.0, 1.0, 0.0), np.random.default_rng(seed),
                                  lambda p: p.x_m > 0.5 and p.y_m > 0.5) for seed in range(40)]
    assert all(p.x_m > 0.5 and p.y_m > 0.5 for p in free)
    assert {round(math.hypot(p.x_m - 1.0, p.y_m - 1.0), 6) for p in free} == {1.0}
    assert {round(p.heading_rad, 6) for p in free} == {0.35, -0.35}


def test_what_did_not_happen_as_it_was_asked_for_is_told() -> None:
    robot = body(
        Bump(forward_m=3.0), Bump(left_m=0.1), Kidnap(turn_rad=1.0),
        LightsOff(after_s=1e6), Stall("attic"),
    )
    robot.move(0.3)
    blocked, *late = robot.missed_faults
    assert blocked.startswith("bump: 0.") and blocked.endswith(" m of 3.00 m, for want of room")
    assert late == ["lights_off: its moment did not come", "stall: its moment did not come"]


def test_a_blocked_bump_goes_as_far_as_there_is_room() -> None:
    bump = Bump(left_m=1.0)
    there = bump.find_free_pose(Pose2(0.0, 0.0, 0.0), np.random.default_rng(0), lambda p: p.y_m < 0.52)
    assert there.y_m == pytest.approx(0.5)


def test_lights_go_off_for_their_time() -> None:
    robot = body(LightsOff(after_s=0.5, duration_s=1.0))
    lit = [(robot.look(), robot.truth.lights_on)[1] for _ in range(20)]
    assert lit.count(False) == 10 and lit[0] and lit[-1]


def test_faults_do_not_change_the_noise() -> None:
    sighted, blind = body(), body(LightsOff(after_s=0.05, duration_s=0.1))
    for robot in (sighted, blind):
        robot.look(), robot.look()
    assert sighted.look().jpeg == blind.look().jpeg


def test_a_camera_that_stands_still_is_a_fault_once_the_wheels_counted_and_over_when_it_goes_on() -> None:
    robot, board = body(CameraFrozen(after_s=0.15, duration_s=30.0)), Blackboard()
    port = BodyPort(FaultyBody(robot))

    def ask(value: Any) -> list[Any]:
        (change,) = board.apply([Post(value)], author="test", cycle=0)
        made = board.apply(port.answer(change), author="body", cycle=0)
        return [one.entry.value for one in made]

    assert [type(ask(PictureRequest("track"))[0]) for _ in range(4)] == [CameraPicture] * 4
    ask(MotorCommand(0.0, 0.0))
    assert isinstance(ask(PictureRequest("track"))[0], CameraPicture)  # nothing has moved
    ask(MotorCommand(0.1, 0.0))
    (fault,) = ask(PictureRequest("milestone"))
    assert isinstance(fault, BodyFault) and (fault.part, fault.what) == ("camera", STANDS_STILL)
    assert fault.detail == "its picture is the same as before the wheels counted 6 degrees and 0.00 m"
    (broken,) = ask(Course("Leg-1", 0.4, 0.0))
    path_m = robot.truth.path_m
    assert broken.what == STANDS_STILL and broken.move_m > 0.0
    assert ask(Recovery("", broken.request, 0.0, 1.0))[0].status == "still failing" and robot.truth.path_m == path_m
    over, report = ask(Recovery("", broken.request, 0.0, 40.0))
    assert over.status == "over" and report.move_m == broken.move_m
    assert isinstance(ask(PictureRequest("track"))[0], CameraPicture)


def test_the_same_pixels_with_another_head_are_the_same_picture_and_noise_is_none() -> None:
    robot, still = body(), StillCamera()
    first, again = robot.picture(), robot.picture()
    commented = first[:2] + b"\xff\xfe\x00\x04ab" + first[2:]
    told = []
    for jpeg, move_m in ((first, 0.0), (first, 0.6 * MUST_CHANGE_M), (commented, 0.6 * MUST_CHANGE_M), (again, 1.0),
                         (first, 1.0), (b"no picture", 1.0), (b"no picture", 0.0), (b"", 1.0)):
        still.move(0.0, move_m)
        told.append(bool(still.find(jpeg)))
    assert told == [False, False, True, False, False, False, False, False]
