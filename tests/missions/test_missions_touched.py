"""A thing that the model lacks is seen and driven round; what the camera misses is touched once, and driven round too.

What the model explains, or doubt leaves open, is no obstacle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from blackboard import Decision, KnowledgeSource
from harvey.simulation.simulated_run import run_mission
from harvey.wiring import knowledge_sources
from knowledge_sources.settings import Settings
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.entries import Obstacle

CARTON = """units = "feet"
[finishes]
cardboard = { colour = [0.58, 0.46, 0.32], texture = "speckle", scale = 0.3 }
[parts]
carton = [{ x = [-0.7, 0.7], y = [-0.7, 0.7], z = [0.0, 1.6], finish = "cardboard" }]
[locales]
north-hall = { things = [ { part = "carton", at = [14, 4.1] } ] }
"""
MISSION = """description = "A carton in the hall, of which the model knows nothing."
world = "two_ways"
details = ["carton.toml"]
goal = "(ptrans (north-hall (3,4,0)) (north-hall (26,4,0)))"
[start]
put_down_sigma_m = 0.02
put_down_sigma_deg = 1.0
"""


def without_floor_watcher(settings: Settings) -> Sequence[KnowledgeSource]:
    """The knowledge sources of a robot whose camera misses what stands on the floor."""
    blind = replace(settings, action=replace(settings.action, keeps_to_seen_floor=False))
    return [source for source in knowledge_sources(blind) if source.name != "floor_watcher"]


def test_a_carton_that_the_model_lacks_is_seen_and_driven_round(tmp_path: Path) -> None:
    (tmp_path / "carton.toml").write_text(CARTON, encoding="utf-8")
    decisions: list[Decision] = []
    result = run_mission(build_stage(parse_scenario(MISSION, "carton", tmp_path)), 1, sinks=[decisions.append])
    made = [change.entry for d in decisions for change in d.made]
    found = [e for e in made if isinstance(e.value, Obstacle) and e.value.is_there]
    assert (result.outcome, result.collisions, result.false_accepts) == ("reached", 0, 0)
    # Not mended: at 18.1 ft it holds 6 x 30 px of free floor in the picture's lowest rows for a thing, at 0.71. Patches
    # there reach over the picture's edge, and show half of themselves mirrored (relief.py). Where they tell nothing,
    # that thing is gone, but the carton is held for two, 0.3 m apart.
    assert {e.value.name for e in found if e.value.certainty >= 0.9} == {"north-hall/obstacle-1"}
    assert found[0].value.by == "camera" and found[0].value.x_m == pytest.approx(14 * 0.3048, abs=0.25)
    assert found[0].because[0].id.startswith("FreeFloor-")
    assert any(ref.id.startswith("CameraPicture-") for e in made if e.ref == found[0].because[0] for ref in e.because)


def test_a_carton_that_the_camera_misses_is_touched_once_and_driven_round(tmp_path: Path) -> None:
    (tmp_path / "carton.toml").write_text(CARTON, encoding="utf-8")
    decisions: list[Decision] = []
    stage = build_stage(parse_scenario(MISSION, "carton", tmp_path))
    result = run_mission(stage, 1, sources=without_floor_watcher, sinks=[decisions.append])
    found = [change.entry for d in decisions for change in d.made if isinstance(change.entry.value, Obstacle)]
    assert (result.outcome, result.collisions, result.false_accepts) == ("reached", 1, 0)
    assert result.error_m < 0.0254
    assert len(found) == 1
    assert found[0].value.locale == "north-hall" and found[0].value.x_m == pytest.approx((14 - 0.7) * 0.3048, abs=0.05)
    assert found[0].because[0].id.startswith("Contact-")
