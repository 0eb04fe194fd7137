"""Laws of the fault classes: each has its own keys, and no other key is read."""

from __future__ import annotations

import math
import re
from dataclasses import fields, replace
from pathlib import Path

import pytest

from box_rooms import box_room
from sim.body.faulty_body import FaultyBody
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import SimulatedBuilding
from sim.faults.built_in_faults import Kidnap
from sim.faults.fault import DeviceFault, Fault
from sim.faults.fault_registry import BUILT_IN, find_fault_class
from sim.scenario import ScenarioError, parse_scenario
from world_models.camera import Camera, CameraMount
from world_models.entries import BodyFault, CameraPicture, Course, MotionReport, MotorCommand, Place
from world_models.files.toml.settings_reader import known_keys
from world_models.frames import Pose2

HEAD = 'world = "w"\ngoal = "(ptrans (a (1,2,0)) (b (3.5,-4,0)))"\n[[faults]]\n'
KEYS = sorted({key for fault_class in BUILT_IN for key in known_keys(fault_class)})
DEVICE_FAULTS = [fault_class for fault_class in BUILT_IN if issubclass(fault_class, DeviceFault)]
CAMERA = Camera.from_field_of_view(math.radians(65.0), 64, 64)
BUILDING = SimulatedBuilding.of_faces(box_room(), samples=1)


def body(*faults: Fault) -> SimulatedBody:
    return SimulatedBody(BUILDING, Pose2(1.0, 2.0, 0.0), CAMERA, CameraMount(1.0), seed=4, faults=faults)


def test_kinds_are_unique_and_found() -> None:
    assert len({fault_class.kind for fault_class in BUILT_IN}) == len(BUILT_IN)
    assert all(find_fault_class(fault_class.kind) is fault_class for fault_class in BUILT_IN)


def test_of_every_kind_it_is_said_what_tells_it() -> None:
    said = (Path(__file__).parents[3] / "docs" / "design" / "faults.md").read_text("utf-8")
    kinds = set(re.findall(r"`(\w+)`", "".join(line.split("|")[1] for line in said.splitlines() if line[:3] == "| `")))
    assert kinds == {fault_class.kind for fault_class in BUILT_IN}


@pytest.mark.parametrize("fault_class", BUILT_IN)
def test_every_number_has_bounds_and_a_default_within(fault_class: type[Fault]) -> None:
    numbers = {f.name for f in fields(fault_class) if f.type == "float"}
    assert numbers == {*fault_class.bounds, "after_m", "after_s"}
    fault_class()


@pytest.mark.parametrize("fault_class", BUILT_IN)
def test_a_key_is_read_or_refused_with_its_line(fault_class: type[Fault]) -> None:
    for key in KEYS:
        value = '"a"' if "locale" in key else "0.5"
        text = f"{HEAD}kind = '{fault_class.kind}'\n{key} = {value}\n"
        if key in known_keys(fault_class) and not key.startswith("to_"):
            (fault,) = parse_scenario(text, "s.toml").faults
            assert fault != fault_class()
        elif key not in known_keys(fault_class):
            refused = rf"s\.toml:5: faults\.0\.{key}: expected one of .*, got the key '{key}'"
            with pytest.raises(ScenarioError, match=refused):
                parse_scenario(text, "s.toml")


def test_a_kidnap_to_a_place_puts_the_robot_there() -> None:
    building = replace(BUILDING, world_from_place=lambda place: Pose2(place.x_m, place.y_m, place.heading_rad or 0.0))
    kidnap = Kidnap(after_m=0.2, to_locale="room", to_x_m=2.5, to_y_m=1.5, to_heading_rad=0.7)
    robot = SimulatedBody(building, Pose2(1.0, 2.0, 0.0), CAMERA, CameraMount(1.0), seed=4, faults=(kidnap,))
    robot.move(0.4)
    assert any(truth.world_from_robot == Pose2(2.5, 1.5, 0.7) for truth in robot.track)
    assert robot.missed_faults == ()


def test_a_building_without_locales_has_no_places() -> None:
    with pytest.raises(ValueError, match="no named locales"):
        BUILDING.world_from_place(Place("room", 1.0, 1.0))


@pytest.mark.parametrize("fault_class", DEVICE_FAULTS)
def test_a_device_fault_answers_in_place_of_the_device_for_its_duration(fault_class: type[DeviceFault]) -> None:
    robot = body(fault_class(after_s=0.05, duration_s=2.0))
    reached = FaultyBody(robot)
    reached.wait(0.1)
    answers = reached.execute(MotorCommand(0.0, 0.1)), reached.look("track")
    faulty = answers[0] if fault_class.part == "base" else answers[1]
    assert isinstance(faulty, BodyFault) and (faulty.part, faulty.what) == (fault_class.part, fault_class.what)
    other = answers[1] if fault_class.part == "base" else answers[0]
    assert isinstance(other, CameraPicture | MotionReport)
    reached.wait(2.0 - robot.truth.time_s)
    assert set(robot.device_faults) == {fault_class.kind}
    reached.wait(0.1)
    assert not robot.device_faults
    assert isinstance(reached.execute(MotorCommand(0.0, 0.1)), MotionReport)
    assert isinstance(reached.look("track"), CameraPicture)


@pytest.mark.parametrize("fault_class", DEVICE_FAULTS)
def test_a_device_fault_in_mid_move_stops_the_wheels_as_its_class_says(fault_class: type[DeviceFault]) -> None:
    robot, whole = body(fault_class(after_m=0.2, duration_s=60.0)), body()
    reached = FaultyBody(robot)
    speed_m_per_s = 0.4
    answer = reached.execute(MotorCommand(0.0, 1.0, speed_m_per_s))
    whole.move(1.0)
    if fault_class.stops_motion_after_s is None:
        assert isinstance(answer, MotionReport) and robot.truth.path_m == whole.truth.path_m
        return
    assert isinstance(answer, BodyFault)
    assert robot.truth.path_m == pytest.approx(0.2 + speed_m_per_s * fault_class.stops_motion_after_s, abs=0.05)
    assert (answer.move_m is not None) == fault_class.odometry_arrives
    done = robot.truth.path_m
    reached.execute(MotorCommand(0.0, 0.3))
    assert robot.truth.path_m == done


@pytest.mark.parametrize("fault_class", DEVICE_FAULTS)
def test_a_device_fault_on_the_move_brings_the_robot_to_a_stand(fault_class: type[DeviceFault]) -> None:
    robot = body(fault_class(after_m=0.3, duration_s=60.0))
    reached = FaultyBody(robot)
    answers = [reached.steer(Course("Leg-1", 0.4, 0.0)) for _ in range(60)]
    assert isinstance(answers[0], tuple) and isinstance(answers[-1], BodyFault)
    first = next(answer for answer in answers if isinstance(answer, BodyFault))
    assert (first.move_m is not None) == fault_class.odometry_arrives
    path_m = robot.truth.path_m
    reached.wait(1.0)
    assert robot.truth.path_m == path_m < 1.0
