"""How a run began, written down and read back."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harvey.errors import BadInput
from logs.run_head import HARDWARE, RunHead
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraDeviation, CameraMount
from world_models.entries import Command, diagonal
from world_models.files.toml.mission import Servo
from world_models.files.world_files import WORLDS, load_world
from world_models.robot import RobotModel

WORLD = WORLDS / "research_center.toml"
COMMAND = Command("(ptrans (hallway (4,4,0)) (hallway (44,4,0)))", 0.1, None, diagonal(0.01, 0.02))


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    camera = Camera(400.5, 401.0, 255.0, 256.0, 512, 512, (0.1, -0.02, 0.001, 0.0, 0.003))
    return RobotModel(load_world(WORLD), camera, CameraMount(0.8, 0.05, 0.1), ActuatorModel(reach=0.97), radius_m=0.2)


def build_head(robot: RobotModel, world: Path = WORLD) -> RunHead:
    return RunHead.of(HARDWARE, "flat", 0, world, robot, Servo(plan=False), COMMAND)


def model_of(head: RunHead) -> RobotModel:
    return head.model(head.load_world())


def test_what_the_robot_knows_comes_back(robot: RobotModel, tmp_path: Path) -> None:
    build_head(robot).write(tmp_path)
    head = RunHead.read(tmp_path)
    model = model_of(head)
    assert head.task() == COMMAND
    assert head.servo_settings() == Servo(plan=False)
    assert (model.mount, model.actuator, model.radius_m) == (robot.mount, robot.actuator, robot.radius_m)
    np.testing.assert_array_equal(model.lens.matrix, robot.lens.matrix)
    np.testing.assert_array_equal(model.lens.distortion, robot.lens.distortion)


def test_how_well_the_camera_is_known_comes_back_and_lies_on_the_board(robot: RobotModel, tmp_path: Path) -> None:
    assert "deviation" not in build_head(robot).robot
    known = dataclasses.replace(robot, deviation=CameraDeviation(0.01, 0.002, 0.003, 0.0004))
    build_head(known).write(tmp_path)
    head = RunHead.read(tmp_path)
    model = model_of(head)
    camera, _, _ = model.entries()
    assert model.deviation == known.deviation
    assert (camera.sigma_tilt_rad, camera.sigma_height_m, camera.sigma_forward_m, camera.sigma_focal) == (
        0.01, 0.002, 0.003, 0.0004)


def test_another_world_file_is_refused(robot: RobotModel, tmp_path: Path) -> None:
    world = tmp_path / "flat.toml"
    world.write_bytes(WORLD.read_bytes())
    head = build_head(robot, world)
    world.write_bytes(WORLD.read_bytes() + b"\n# a new coat of paint\n")
    with pytest.raises(BadInput, match=r"flat\.toml: expected the world file as it was"):
        model_of(head)


@pytest.mark.parametrize(
    ("text", "word"), [("{", "expected JSON"), ("[]", "expected RunHead"), ("{}", "expected RunHead")])
def test_a_malformed_head_is_named(tmp_path: Path, text: str, word: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(BadInput, match=rf"run\.json: {word}"):
        RunHead.read(tmp_path)


@pytest.mark.parametrize(("key", "value"), [("seed", "three"), ("servo", []), ("without", [3]), ("kind", None)])
def test_a_value_of_the_wrong_kind_is_named(robot: RobotModel, tmp_path: Path, key: str, value: object) -> None:
    (tmp_path / "run.json").write_text(json.dumps({**dataclasses.asdict(build_head(robot)), key: value}))
    with pytest.raises(BadInput, match=rf"run\.json: {key}.*: expected"):
        RunHead.read(tmp_path)


@pytest.mark.parametrize(("part", "spoilt", "told"), [
    ("robot", {"camera": {"fx": "wide"}}, "robot.camera.fx: expected a number, got 'wide'"),
    ("robot", {"camera": {"fx": True}}, "robot.camera.fx: expected a number, got True"),
    ("robot", {"camera": {"width": 3.5}}, "robot.camera.width: expected a whole number, got 3.5"),
    ("robot", {"camera": {"fx": -1.0}}, "robot.camera: expected positive focal lengths"),
    ("robot", {"camera": {"distortion": "barrel"}}, "robot.camera: "),
    ("robot", {"camera": {"focus": 1.0}}, "robot.camera: expected fx, fy, .*, got 'focus'"),
    ("robot", {"mount": {"height_m": None}}, "robot.mount.height_m: expected a number, got None"),
    ("robot", {"radius_m": "broad"}, "robot.radius_m: expected a number, got 'broad'"),
    ("robot", {"colour": "red"}, "robot: expected .*, got 'colour'"),
    ("servo", {"plan": "perhaps"}, "servo.plan: expected true or false, got 'perhaps'"),
    ("command", {"text": 3}, "command.text: expected a text, got 3"),
])
def test_what_cannot_be_used_is_named_by_where_it_stands(
    robot: RobotModel, tmp_path: Path, part: str, spoilt: dict[str, object], told: str
) -> None:
    data = dataclasses.asdict(build_head(robot))
    (tmp_path / "run.json").write_text(json.dumps({**data, part: merged(data[part], spoilt)}))
    head = RunHead.read(tmp_path)
    with pytest.raises(BadInput, match=rf"run\.json: {told}"):
        {"robot": lambda: model_of(head), "servo": head.servo_settings, "command": head.task}[part]()


def merged(whole: dict[str, Any], spoilt: Any) -> dict[str, Any]:
    return whole | {key: merged(whole[key], value) if isinstance(value, dict) else value
                    for key, value in spoilt.items()}


def test_a_head_that_lacks_what_is_lacking_by_default_is_read(robot: RobotModel, tmp_path: Path) -> None:
    """As an older version wrote it; what has no default is asked for by name."""
    data = dataclasses.asdict(build_head(robot))
    del data["robot"]["camera"]["obstruction"], data["robot"]["continuous"], data["robot"]["actuator"]["turn_sigma"]
    (tmp_path / "run.json").write_text(json.dumps(data))
    assert model_of(RunHead.read(tmp_path)).actuator == robot.actuator
    del data["robot"]["camera"]["cx"]
    (tmp_path / "run.json").write_text(json.dumps(data))
    with pytest.raises(BadInput, match=r"run\.json: robot\.camera: expected cx as well"):
        model_of(RunHead.read(tmp_path))


def test_without_a_head_it_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="expected the head of a run"):
        RunHead.read(tmp_path)
