"""Scenarios under light, and what any renderer of light must keep."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from driven_here import run_here
from experiments.differences import light
from experiments.generated.light import write_soak_mission
from harvey_light.baked import BAKED
from harvey_light.lit_renderer import LitRenderer
from seams import check_lit_renderers
from sim.render.lights import find_lit_renderers
from sim.scenario import load_scenario, parse_scenario
from sim.stage import build_stage

MINIMAL = 'world = "research_center"\ngoal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"\n'


def test_it_is_what_renderers_of_light_must_be() -> None:
    assert find_lit_renderers() is BAKED
    check_lit_renderers(BAKED)


def test_a_lit_stage_has_lamps_in_its_rooms() -> None:
    stage = build_stage(parse_scenario(MINIMAL + "[light]\nrays = 4\ncell_m = 1.0\nbounces = 1\n"))
    renderer = stage.building.renderer
    assert isinstance(renderer, LitRenderer)
    plain = build_stage(parse_scenario(MINIMAL)).building.renderer
    assert len(renderer.mesh) > len(plain.mesh)
    assert np.isfinite(renderer.baked.seen_light).all()


@pytest.mark.parametrize(("day", "seed"), [(7, 2), (44, 3)])
def test_a_day_of_errands_under_light_can_be_staged(tmp_path: Path, day: int, seed: int) -> None:
    stage = build_stage(load_scenario(write_soak_mission(tmp_path, day, seed)))
    assert isinstance(stage.building.renderer, LitRenderer)


def test_the_small_version_of_the_experiment_drives(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, light, light.drive, quick=True)
    assert found.holds, found.text()
    assert len(found.rows) == len(light.QUICK_KINDS)
