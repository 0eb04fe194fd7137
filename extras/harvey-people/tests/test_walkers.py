"""Scenarios with people: the shipped ones can be set up, and mistakes are told."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import harvey_people
from harvey_people import people_experiment
from harvey_people.simulated.peopled import people_in
from sim.scenario import ScenarioError, load_scenario, parse_scenario, scenario_from_tables
from sim.stage import build_stage

SCENARIOS = sorted(harvey_people.SCENARIOS.glob("*.toml"))
MISSION = 'world = "research_center"\ngoal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"\n'
WALKER = '[[walkers]]\nlocale = "hallway"\n'


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_a_shipped_scenario_can_be_set_up_and_people_walk(path: Path) -> None:
    scenario = load_scenario(path)
    body = build_stage(scenario).body(0)
    body.wait(8.0)
    names = {face.name.split("/")[1] for face in body.building.added if face.name.startswith("people/")}
    assert names == {walker["name"] for walker in scenario.source.data["walkers"]}
    again = scenario_from_tables(scenario.source.data, scenario.name, scenario.folder)
    assert again.walkers == scenario.walkers


@pytest.mark.parametrize(("text", "message"), [
    (WALKER, r"0\.way: expected one point at least, got none"),
    (WALKER + "way = [{x_ft = 20.0, y_ft = 4.0, locale = 'hall'}]\n", "expected .*hallway.*, got 'hall'"),
    (WALKER + "way = [{x_ft = 20.0, y_ft = 4.0}, {x_ft = 20.0, y_ft = 30.0}]\n", "of room for a person, got none"),
    (WALKER + "speed_m_per_s = 3\n", r"speed_m_per_s: expected a number from 0\.3 to 1\.6, got 3"),
    (WALKER + "way = [{x_ft = 20.0, y_ft = 4.0}]\nhat = 1\n", "got the key 'hat'"),
    (WALKER * 21, "at most 20 walkers"),
])
def test_mistakes_are_told(text: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        build_stage(parse_scenario(MISSION + text))


def test_people_that_are_drawn_for_the_experiment_fit_its_building() -> None:
    stage = build_stage(parse_scenario("walkers = []\n" + people_experiment.MISSION))
    assert not people_in(stage.body(0).building)
    for seed in range(30):
        walkers = parse_scenario(people_experiment.MISSION + people_experiment.draw_walkers(seed)).walkers
        assert walkers is not None
        assert 1 <= len(people_in(walkers.enter(stage.building, stage.world, seed))) <= 6


def test_the_walkers_of_the_readme_can_be_set_up() -> None:
    text = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    block, = re.findall(r"^```toml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert people_in(build_stage(parse_scenario(MISSION + block)).body(0).building)
