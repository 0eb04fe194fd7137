"""Robots that are kidnapped: they find out where they are, or say that the building cannot tell."""

from __future__ import annotations

import math
from pathlib import Path

from experiments.robustness.kidnap import Kidnap, format_scenario, get_floor, is_right, is_wrong, run_kidnap
from sim.scenario import load_scenario


def test_carried_off_to_another_room_it_finds_out_where_it_is() -> None:
    found = run_kidnap(Kidnap(7, 4, False, 1))
    assert is_right(found) and not is_wrong(found)
    assert 2 <= found.probes <= 5 and found.error_m < 0.05


def test_in_a_symmetric_corridor_it_says_that_it_is_ambiguous() -> None:
    found = run_kidnap(Kidnap(11, 4, True, 0))
    assert found.verdict == "ambiguous" and found.believed == "" and math.isinf(found.error_m)
    assert found.places == 2


def test_a_kidnap_can_be_seen_as_a_mission(tmp_path: Path) -> None:
    trial = Kidnap(7, 4, False, 1)
    get_floor(trial).write(tmp_path)
    path = tmp_path / "kidnap.toml"
    path.write_text(format_scenario(trial), encoding="utf-8")
    scenario = load_scenario(path)
    assert len(scenario.faults) == 1 and scenario.world == tmp_path / "floor-7.toml"
