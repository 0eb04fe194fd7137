"""docs/hardware.md is true: its flat can be driven, what it adds may stand there, its words are the board's."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from harvey.cli import main
from harvey.dry_run import dry_run, summarize_dry_run
from harvey.hardware.hardware_body import BASE_WORDS, CAMERA_WORDS
from harvey.hardware.hardware_mission import load_mission
from harvey.simulation.simulated_run import build_robot_model
from knowledge_sources.action.fault_handler import MAX_BROKEN_MOTIONS, MAX_FAULT_S, MAX_RETRY_WAIT_S, MIN_RETRY_WAIT_S
from sim.scenario import load_scenario
from world_models.actuator import ActuatorModel
from world_models.files.toml.mission import Safety
from world_models.files.world_files import load_world

DOCS = Path(__file__).parents[3] / "docs"
TEXT = (DOCS / "hardware.md").read_text(encoding="utf-8")
FLAT = DOCS / "flat"


def blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def test_its_flat_is_a_world_without_faults_and_its_mission_is_planned_with_every_milestone_clear() -> None:
    assert main(["world", "check", str(FLAT / "flat.toml")]) == 0
    mission, scenario = load_mission(FLAT / "mission.toml", {}), load_scenario(FLAT / "flat-sim.toml")
    assert mission.goal == scenario.goal and mission.world == scenario.world
    assert mission.start == scenario.start
    previews, outcome = dry_run(load_world(scenario.world), build_robot_model(scenario), mission.command)
    assert outcome.kind == "reached" and {p.verdict for p in previews} == {"clear"}
    said, can_be_driven = summarize_dry_run(previews, outcome)
    assert can_be_driven and f"{len(previews)} milestones, {said}" in TEXT


def test_what_goes_into_a_missions_file_may_stand_there(tmp_path: Path) -> None:
    for block in blocks("toml"):
        (tmp_path / "m.toml").write_text((FLAT / "mission.toml").read_text() + block)
        mission = load_mission(tmp_path / "m.toml", {})
        told = tomllib.loads(block)
        assert mission.actuator == ActuatorModel(**told.get("actuator", {}))
        assert mission.safety == Safety(**told.get("safety", {}))


@pytest.mark.parametrize("word", [w for w in (*CAMERA_WORDS.values(), *BASE_WORDS.values())
                                  if w not in ("stopped", "stopped by the watchdog")])
def test_every_fault_has_advice(word: str) -> None:
    assert f"`{word}`" in TEXT


def test_its_figures_are_those_of_the_sources() -> None:
    assert (MIN_RETRY_WAIT_S, MAX_RETRY_WAIT_S, MAX_FAULT_S, MAX_BROKEN_MOTIONS) == (0.25, 2.0, 30.0, 5)
    assert "after 0.25, 0.5, 1, 2, 2, ... s, and after 30 s" in TEXT and "after five motions in a row" in TEXT
    assert f"the default of {ActuatorModel().reach:.3f}" in TEXT
