"""A goal where the robot cannot stand is told before anything moves: blocked, and why."""

from __future__ import annotations

from pathlib import Path

import pytest

from harvey.cli import main
from harvey.dry_run import dry_run
from scripted_mission import CAMERA, HOUSE, MOUNT
from world_models.actuator import ActuatorModel
from world_models.entries import Command, Outcome, diagonal
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.robot import RobotModel
from world_models.units import FOOT_M

TABLE = """[parts]
table = [ { x = [0, 1], y = [0, 1], z = [0, 0.8], finish = "paint" } ]
[locales.kitchen]
things = [ { part = "table", at = [0.5, 2.5], name = "table" } ]
"""
FURNISHED = HOUSE.replace("[locales.kitchen]\n", TABLE)


def outcome(x_m: float, y_m: float, radius_m: float = 0.35) -> Outcome:
    """How a mission to a place in the kitchen ends in a dry run."""
    world = read_world(Source.parse(FURNISHED, "house.toml"))
    robot = RobotModel(world, CAMERA, MOUNT, ActuatorModel(), radius_m)
    places = [f"(kitchen ({x / FOOT_M:.4f},{y / FOOT_M:.4f},0))" for x, y in ((2.0, 2.0), (x_m, y_m))]
    return dry_run(world, robot, Command(f"(ptrans {' '.join(places)})", 0.0, None, diagonal(0.01, 0.01)))[1]


@pytest.mark.parametrize(("x_m", "y_m", "told"), [
    (2.0, 0.03, "(kitchen (2.00, 0.03) m) is 0.03 m from a wall: the robot cannot stand there, with a radius of 0.35"),
    (2.0, 0.37, "is 0.37 m from a wall"),
    (1.7, 3.0, "is 0.20 m from kitchen/table"),
    (1.0, 3.0, "is 0.00 m from kitchen/table"),
    (2.0, 40.0, "is not within kitchen"),
    (2.0, -0.03, "is not within kitchen"),
])
def test_a_goal_without_room_is_blocked(x_m: float, y_m: float, told: str) -> None:
    found = outcome(x_m, y_m)
    assert found.kind == "blocked"
    assert told in found.reason


def test_a_smaller_robot_may_stand_where_a_larger_one_cannot() -> None:
    assert "0.37 m from a wall" in outcome(2.0, 0.37).reason
    assert "m from " not in outcome(2.0, 0.37, radius_m=0.2).reason


@pytest.mark.parametrize(("x_m", "y_m"), [(2.0, 0.39), (3.9, 2.0)])
def test_the_middle_of_an_open_doorway_is_not_near_a_wall(x_m: float, y_m: float) -> None:
    assert "m from " not in outcome(x_m, y_m).reason


def test_a_run_to_such_a_goal_does_not_move_and_why_tells_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    goal = "goal=(ptrans (hallway (4,4,0)) (hallway (24,0.1,0)))"
    assert main(["run", "link-lost", "--set", goal, "--out", str(tmp_path / "run")]) == 1
    out = capsys.readouterr().out
    assert out.startswith("blocked: the goal (hallway (7.32, 0.03) m) is 0.03 m from a wall")
    assert "way           0.0 m" in out
    assert main(["why", str(tmp_path / "run")]) == 0
    assert "is 0.03 m from a wall: the robot cannot stand there" in " ".join(capsys.readouterr().out.split())
