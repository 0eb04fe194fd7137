"""Errands day after day: what is written, and what is claimed of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from driven_here import run_here
from experiments.generated.light import HALL_FT, write_soak_mission
from experiments.robustness import soak
from experiments.robustness.soak import SoakResult, SoakTrial
from sim.scenario import load_scenario
from sim.stage import build_stage


def end(trial: SoakTrial, **other: Any) -> SoakResult:
    flawless = SoakResult(trial.seed, trial.day, "reached", "", 0.01, 50.0, 30, 0, 0, 0, 0, 0, 200.0, 30.0, 400.0, 7)
    return replace(flawless, **other)


@pytest.mark.parametrize(("day", "seed"), [(0, 1), (7, 2), (44, 3)])
def test_a_mission_is_written_the_same_again_and_can_be_staged(tmp_path: Path, day: int, seed: int) -> None:
    text = write_soak_mission(tmp_path, day, seed).read_text("utf-8")
    path = write_soak_mission(tmp_path, day, seed)
    assert path.read_text("utf-8") == text
    stage = build_stage(load_scenario(path))
    assert stage.start_world.distance_to(stage.goal_world) > 0.3048 * (HALL_FT[1] - HALL_FT[0]) / 2.0 - 0.01
    told = [float(line.partition("=")[2]) for line in text.splitlines() if line.startswith("at_s")]
    assert len(told) >= 3 and told == sorted(told)


@pytest.mark.parametrize(("flaws", "claim"), [
    ({}, ""),
    ({0: {"false_accepts": 1}}, "no milestone is accepted wrongly"),
    ({0: {"outcome": "lost"}}, ""),
    ({0: {"outcome": "lost"}, 1: {"outcome": "blocked"}}, "at least 99% reach"),
])
def test_a_flaw_fails_its_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flaws: dict[int, dict[str, Any]], claim: str
) -> None:
    def work(trial: SoakTrial) -> SoakResult:
        return end(trial, **flaws.get(trial.seed - soak.FIRST_SEED, {}))

    found = run_here(monkeypatch, tmp_path, soak, work, quick=False, missions=100)
    assert [failing.partition(":")[0] for failing in found.failing] == [claim] * bool(claim)
    assert found.rows[-1][3] == 100 and found.rows[-1][4] == pytest.approx(5.0)  # missions, km


@pytest.mark.parametrize("growth_mb", [0.9 * soak.MAX_MB_PER_MISSION, 1.1 * soak.MAX_MB_PER_MISSION])
def test_a_process_that_grows_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, growth_mb: float) -> None:
    def work(trial: SoakTrial) -> SoakResult:
        return end(trial, memory_mb=400.0 + growth_mb * (trial.seed - soak.FIRST_SEED))

    found = run_here(monkeypatch, tmp_path, soak, work, quick=False, missions=60)
    assert bool(found.failing) == (growth_mb > soak.MAX_MB_PER_MISSION)


def test_the_memory_of_each_process_is_told_apart() -> None:
    both = [end(SoakTrial(k, 0), process=k % 2, memory_mb=300.0 + 100.0 * (k % 2) + 2.0 * k) for k in range(80)]
    assert soak._find_growth_mb(both) == pytest.approx(4.0)  # each runs every second one
