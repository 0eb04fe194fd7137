"""How a run began, written down and read back."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from harvey.errors import BadInput
from harvey.run_head import HARDWARE, RunHead
from sim.scenario import Servo
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.location import diagonal
from world_models.robot import RobotModel
from world_models.store import WORLDS, load_world
from world_models.task import Command

WORLD = WORLDS / "research_center.toml"
COMMAND = Command("(ptrans (hallway (4,4,0)) (hallway (44,4,0)))", 0.1, None, diagonal(0.01, 0.02))


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    camera = Camera(400.5, 401.0, 255.0, 256.0, 512, 512, (0.1, -0.02, 0.001, 0.0, 0.003))
    return RobotModel(load_world(WORLD), camera, CameraMount(0.8, 0.05, 0.1), ActuatorModel(reach=0.97), radius_m=0.2)


def head_of(robot: RobotModel, world: Path = WORLD) -> RunHead:
    return RunHead.of(HARDWARE, "flat", 0, world, robot, Servo(plan=False), COMMAND)


def test_what_the_robot_knows_comes_back(robot: RobotModel, tmp_path: Path) -> None:
    head_of(robot).write(tmp_path)
    head = RunHead.read(tmp_path)
    model = head.model()
    assert head.task() == COMMAND
    assert head.servo_settings() == Servo(plan=False)
    assert (model.mount, model.actuator, model.radius_m) == (robot.mount, robot.actuator, robot.radius_m)
    np.testing.assert_array_equal(model.lens.matrix, robot.lens.matrix)
    np.testing.assert_array_equal(model.lens.distortion, robot.lens.distortion)


def test_another_world_file_is_refused(robot: RobotModel, tmp_path: Path) -> None:
    world = tmp_path / "flat.toml"
    world.write_bytes(WORLD.read_bytes())
    head = head_of(robot, world)
    world.write_bytes(WORLD.read_bytes() + b"\n# a new coat of paint\n")
    with pytest.raises(BadInput, match=r"flat\.toml: expected the world file as it was"):
        head.model()


@pytest.mark.parametrize(
    ("text", "word"), [("{", "expected JSON"), ("[]", "expected RunHead"), ("{}", "expected RunHead")])
def test_a_malformed_head_is_named(tmp_path: Path, text: str, word: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(BadInput, match=rf"run\.json: {word}"):
        RunHead.read(tmp_path)


@pytest.mark.parametrize(("key", "value"), [("seed", "three"), ("servo", []), ("without", [3]), ("kind", None)])
def test_a_value_of_the_wrong_kind_is_named(robot: RobotModel, tmp_path: Path, key: str, value: object) -> None:
    (tmp_path / "run.json").write_text(json.dumps({**dataclasses.asdict(head_of(robot)), key: value}))
    with pytest.raises(BadInput, match=r"run\.json: expected"):
        RunHead.read(tmp_path)


def test_without_a_head_it_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="expected the head of a run"):
        RunHead.read(tmp_path)
