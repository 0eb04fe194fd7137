"""A robot that is put down roughly: the plan level knows how roughly, so that the first milestone mends it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from harvey.simulation.simulated_run import run_mission
from knowledge_sources.settings import DEFAULT
from logs.timeline import Timeline
from sim.scenario import load_scenario
from sim.stage import Stage, build_stage

FIRST_CYCLES = 20


@pytest.fixture(scope="module")
def roughly_put_down() -> Stage:
    """By hand, with standard deviations of 8 cm and 5 degrees; cut short after the first milestone."""
    scenario = load_scenario("lab-to-allens-office")
    return build_stage(replace(scenario, limits=replace(scenario.limits, max_cycles=FIRST_CYCLES)))


@pytest.mark.parametrize("seed", [9, 15, 18])
def test_a_first_milestone_far_from_where_expected_is_verified(
    roughly_put_down: Stage, seed: int, tmp_path: Path
) -> None:
    run_mission(roughly_put_down, seed, out=tmp_path)
    made = [entry for record in Timeline(tmp_path / "journal.jsonl").decisions() for entry in record.made]
    first = next(entry.fields for entry in made if entry.type == "Certificate")
    assert first["deviation_px"] > DEFAULT.plan.max_deviation_px
    assert first["verdict"] == "verified", first["reason"]
    assert first["deviation_px"] < first["tolerance_px"]
