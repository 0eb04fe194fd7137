"""The shipped scenarios in the shipped building: they can be set up, run and seen."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.faults.built_in_faults import Bump
from sim.render.mesh import Pinhole, project_mesh
from sim.render.rasterizer import find_visible_patches
from sim.scenario import ScenarioError, load_scenario, parse_scenario, with_settings
from sim.scenario_names import list_scenarios
from sim.stage import Stage, build_stage
from world_models.frames import Pose2


@pytest.fixture(scope="module")
def main_stage() -> Stage:
    return build_stage(load_scenario("lab-to-allens-office"))


@pytest.mark.parametrize("name", list_scenarios())
def test_every_scenario_can_be_set_up_and_its_goal_is_free(name: str) -> None:
    stage = build_stage(load_scenario(name))
    assert stage.building.obstacles.clearance_m(stage.goal_world) > 0.05
    assert stage.body(0).truth.locale == stage.building.locale_at(stage.start_world) != ""


def test_the_forty_feet_are_free_of_obstacles_a_foot_to_either_side() -> None:
    stage = build_stage(load_scenario("forty-foot-hallway"))
    assert stage.start_world.distance_to(stage.goal_world) == pytest.approx(40 * 0.3048)
    for part in np.linspace(0.0, 40 * 0.3048, 80):
        assert stage.building.obstacles.clearance_m(stage.start_world @ Pose2(float(part), 0.0, 0.0)) > 0.3048


@pytest.mark.parametrize("locale", ["robot-laboratory", "hallway", "allens-office"])
def test_the_building_has_no_holes_where_the_mission_goes(main_stage: Stage, locale: str) -> None:
    world, mesh, settings = main_stage.world, main_stage.building.renderer.mesh, main_stage.scenario.camera
    middle = world.outline(locale).mean(axis=0)
    lens = Pinhole.of(settings.camera)
    for heading in np.linspace(-3.0, 3.0, 6):
        robot = Pose2(middle[0], middle[1], float(heading))
        pose = settings.mount.camera_from_robot @ robot.lifted().inverse()
        seen = find_visible_patches(mesh, project_mesh(mesh, lens, pose.rotation, pose.translation), lens, 4)
        assert np.mean(seen < 0) < 1e-5


def test_a_scenario_that_does_not_fit_the_world_is_refused(main_stage: Stage) -> None:
    scenario = main_stage.scenario
    for bad, message in (
        (with_settings(scenario, {"world": "atlantis"}), "atlantis"),
        (replace(scenario, faults=(Bump("halway"),)), "hallway"),
    ):
        with pytest.raises(ScenarioError, match=message):
            build_stage(bad)


SMALL = """world = "research_center"
goal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"
"""


@pytest.mark.parametrize(("old", "new", "told"), [
    ("(4,4,0)", "(4,400,0)", "m.toml:2: goal: expected a start within hallway, which reaches from (0.0, 0.0) to"),
    ("(4,4,0)", "(4,0.1,0)", "m.toml:2: goal: expected 0.35 m of room at the start, got 0.01 m"),
    ("(hallway (24", "(halway (24", "m.toml:2: goal: expected a locale of"),
    ('"research_center"', '"nowhere.toml"', "m.toml:1: world: "),
    ("", '[[faults]]\nkind = "bump"\nin_locale = "halway"\n', "m.toml:5: faults.0.in_locale: expected one of hallway"),
    ("", '[[faults]]\nkind = "kidnap"\nto_locale = "hallway"\nto_y_ft = 400\n',
     "m.toml:5: faults.0.to_locale: expected a place within hallway"),
    ("", '[[moved]]\nthing = "hallway/notices-by-students"\nx_ft = 1000\n',
     "m.toml:3: moved.0: expected hallway/notices-by-students to stay within hallway"),
    ("", '[[moved]]\nthing = "hallway/chandelier"\n', "m.toml:4: moved.0.thing: expected a thing of the building"),
    ("", 'details = ["nothing.toml"]\n', "m.toml:3: details: "),
])
def test_what_does_not_go_with_the_building_is_pointed_at(
    old: str, new: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("b").mkdir()
    Path("b/m.toml").write_text(SMALL.replace(old, new, 1) if old else SMALL + new)
    with pytest.raises(ScenarioError) as caught:
        build_stage(load_scenario("b/m.toml"))
    assert str(caught.value).startswith(f"b/{told}")


def test_what_was_set_otherwise_is_named_by_its_key() -> None:
    goal = "(ptrans (hallway (4,400,0)) (hallway (24,4,0)))"
    scenario = with_settings(parse_scenario(SMALL, "m.toml"), {"goal": goal})
    with pytest.raises(ScenarioError, match=r"^--set goal: expected a start within hallway"):
        build_stage(scenario)


@pytest.mark.parametrize("place", ["(4,4,3)", "(4,4,-0.5)", "(4e,4,0)", "(9999999,4,0)", f"({'9' * 400},4,0)"])
def test_a_place_is_on_the_floor_and_not_far_off(place: str) -> None:
    with pytest.raises(ScenarioError, match=r"m\.toml:2: goal: expected "):
        parse_scenario(SMALL.replace("(24,4,0)", place), "m.toml")


def test_relative_files_belong_to_the_scenarios_folder() -> None:
    scenario = parse_scenario('world = "w.toml"\ngoal = "(ptrans (a (1,2,0)) (b (3,4,0)))"\n')
    assert scenario.world.name == "w.toml" and scenario.world.parent == scenario.folder
    assert math.isnan(scenario.arrival.heading_rad)


def test_the_quick_locale_finder_agrees_with_the_world(main_stage: Stage) -> None:
    rng = np.random.default_rng(5)
    for x, y in rng.uniform((-1.0, -8.0), (30.0, 9.0), (200, 2)):
        expected = main_stage.world.locale_at((x, y)) or ""
        assert main_stage.building.locale_at(Pose2(x, y, 0.0)) == expected
