"""Missions of one process share what they only read; another text is another building."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.generated.missions import OFFICE
from harvey.campaign.mission_task import Task
from harvey.errors import BadInput
from harvey.simulation.simulated_run import build_head
from world_models.files.world_files import WORLDS


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A short mission with a world file of its own."""
    shutil.copy(WORLDS / "research_center.toml", tmp_path / "floor.toml")
    path = tmp_path / "stroll.toml"
    path.write_text(OFFICE.replace('world = "research_center"', 'world = "floor.toml"'), encoding="utf-8")
    return path


def test_seeds_share_the_stage_and_what_the_robot_knows(scenario: Path) -> None:
    task = Task(str(scenario), (), 0)
    stage = task.stage()
    assert replace(task, seed=1).stage() is stage
    assert build_head(stage, 0).load_world() is build_head(stage, 1).load_world()
    assert build_head(stage, 0).load_world() is not stage.world


def test_another_setting_is_another_stage(scenario: Path) -> None:
    stage = Task(str(scenario), (), 0).stage()
    other = Task(str(scenario), (("limits.max_cycles", "28"),), 0).stage()
    assert other is not stage and other.scenario.limits.max_cycles == 28


def test_a_file_that_was_changed_meanwhile_is_read_anew(scenario: Path) -> None:
    """The scenario, and the world that it names."""
    stage = Task(str(scenario), (), 0).stage()
    known = build_head(stage, 0).load_world()
    scenario.write_text(scenario.read_text() + "\n# a remark\n")
    again = Task(str(scenario), (), 0).stage()
    assert again is not stage
    floor = scenario.parent / "floor.toml"
    floor.write_text(floor.read_text() + "\n# a remark\n")
    third = Task(str(scenario), (), 0).stage()
    assert third is not again
    assert build_head(third, 0).load_world() is not known


def test_a_world_that_is_gone_is_told_as_before(scenario: Path) -> None:
    Task(str(scenario), (), 0).stage()
    (scenario.parent / "floor.toml").unlink()
    with pytest.raises(BadInput, match=r"stroll\.toml:\d+: world: .*floor\.toml"):
        Task(str(scenario), (), 0).stage()
