"""Missions on inexact models: what is written, what is claimed, and the small version."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from driven_here import run_here
from experiments.differences import inexact
from experiments.differences.inexact import InexactResult, InexactTrial, run_inexact_mission
from experiments.generated.missions import write_inexact_mission
from sim.differences.inexact import TrueInexact
from sim.scenario import load_scenario
from sim.stage import build_stage


def end(trial: InexactTrial, **other: Any) -> InexactResult:
    """An end that holds, or one with flaws: 19 of 20 ellipsoids hold."""
    values: dict[str, Any] = {
        "outcome": "reached", "reason": "there", "error_m": 0.01, "chi2": [1.0] * 19 + [9.0],
        "fix_errors_m": [0.01] * 20,
        "fix_sigmas_m": [0.01] * 20, "wrong": 0, "refuted": 0, "collisions": 0, "relocations": 0, "robot_s": 60.0,
        "wall_s": 4.0}
    return InexactResult(trial.row, trial.seed, **(values | other))


def test_a_mission_is_written_the_same_again_and_states_how_well_things_are_known(tmp_path: Path) -> None:
    truth = TrueInexact(sigma_m=0.05, missing=0.3, extra=0.1)
    path = write_inexact_mission(tmp_path, 3, truth, stated_m=0.05)
    text = path.read_text("utf-8")
    assert write_inexact_mission(tmp_path, 3, truth, stated_m=0.05).read_text("utf-8") == text
    scenario = load_scenario(path)
    assert scenario.truth.inexact.sigma_m == 0.05 and scenario.truth.inexact.seed == 3
    assert scenario.world.read_text("utf-8").startswith("sigma_cm = 5\n")
    build_stage(scenario)


def test_flawless_missions_hold_every_claim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, inexact, end, quick=False, missions=30)
    assert found.failing == ()
    assert sum(row[3] for row in found.rows) == 30 * len(inexact.SIGMAS_CM)


@pytest.mark.parametrize(("flaw", "told"), [
    ({"outcome": "lost"}, "2 cm"),
    ({"error_m": 0.5}, "10 cm"),
    ({"chi2": [9.0] * 20}, "ellipsoids"),
    ({"chi2": [1.0] * 20}, "ellipsoids"),
    ({"wrong": 1}, "no milestone"),
])
def test_a_flaw_fails_its_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flaw: dict[str, Any], told: str
) -> None:
    found = run_here(monkeypatch, tmp_path, inexact, lambda trial: end(trial, **flaw), quick=False, missions=30)
    assert any(told in claim for claim in found.failing)


@pytest.mark.slow
def test_the_small_version_drives(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, inexact, run_inexact_mission, quick=True)
    assert found.holds, found.text()
    assert sum(row[3] for row in found.rows) == inexact.QUICK_MISSIONS
