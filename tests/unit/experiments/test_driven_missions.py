"""Experiments that drive missions: what each claims of ends that are given, and the small versions."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import experiments
from driven_here import run_here
from experiments.differences import doors, inexact, light, miscalibrated, obstacles, twins
from experiments.drives import End, Trial
from experiments.robustness import missions, soak
from harvey.errors import BadInput

COMMON: dict[str, Any] = {
    "outcome": "reached", "reason": "there", "error_m": 0.01, "path_m": 11.0, "verified": 9, "refuted": 0,
    "not_testable": 1, "false_accepts": 0, "contacts": 0, "relocations": 0, "replans": 0, "robot_s": 60.0,
    "wall_s": 4.0}
OWN: dict[ModuleType, tuple[type[End], dict[str, Any]]] = {
    doors: (doors.DoorEnd, {"door": "d", "is_found": True, "false_states": []}),
    inexact: (inexact.InexactEnd, {"chi2": [1.0] * 19 + [9.0], "wrong": 0}),  # 19 of 20 ellipsoids hold
    light: (End, {}),
    miscalibrated: (miscalibrated.CameraEnd, {"found": [1e-4] * 7, "sigmas": [1e-4] * 7}),
    obstacles: (obstacles.ObstacleEnd, {
        "verdict": "reached", "shortest_m": 10.0, "contact_speeds": [], "answered": 0, "false_obstacles": [],
        "stops": 1, "needless": 0}),
    twins: (twins.TwinEnd, {"rooms": 8, "doubts": 0, "by_odds": 0}),
    missions: (missions.MissionEnd, {}),
    soak: (soak.SoakEnd, {"memory_mb": 400.0, "process": 7}),
}
"""The kind of a flawless end, and what it has beside the common."""
ODD_ROWS: dict[str, dict[str, Any]] = {
    "no way": {"outcome": "blocked", "reason": "d is shut"}, "wrong": {"doubts": 1, "relocations": 1}}
NUMBER = {doors: 1_000, light: 1_000, miscalibrated: 1_000, twins: 3_000, missions: 2_000}


def end(experiment: ModuleType, trial: Trial, **flaw: Any) -> End:
    """A flawless end, or one with a flaw."""
    kind, own = OWN[experiment]
    return kind(**{"row": trial.row, "seed": trial.seed, **COMMON, **own, **ODD_ROWS.get(trial.row, {}), **flaw})


@pytest.mark.parametrize("experiment", OWN, ids=lambda e: e.__name__.rpartition(".")[2])
def test_flawless_missions_hold_every_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, experiment: ModuleType
) -> None:
    how = {} if experiment in NUMBER or experiment is obstacles else {"missions": 60}
    found = run_here(monkeypatch, tmp_path, experiment, lambda t: end(experiment, t), quick=False, **how)
    assert found.failing == () and found.claims
    assert not any("to look at" in note for note in found.notes)
    if experiment in NUMBER:
        assert sum(row[found.columns.index("missions")] for row in found.rows) == NUMBER[experiment]


@pytest.mark.parametrize(("experiment", "rows", "flaw", "told"), [
    (doors, (), {"outcome": "lost"}, "another way"),
    (doors, (), {"outcome": "lost"}, "no way"),
    (doors, (), {"reason": "another-door is shut"}, "no way"),
    (doors, (), {"outcome": "blocked"}, "harms nothing"),
    (doors, (), {"false_states": ["d is shut at 3.0 s"]}, "as filed"),
    (doors, (), {"false_accepts": 1}, "no milestone"),
    (inexact, (), {"outcome": "lost"}, "2 cm"),
    (inexact, (), {"error_m": 0.5}, "10 cm"),
    (inexact, (), {"chi2": [9.0] * 20}, "ellipsoids"),
    (inexact, (), {"chi2": [1.0] * 20}, "ellipsoids"),
    (inexact, (), {"wrong": 1}, "no milestone"),
    (light, ("sun",), {"outcome": "lost"}, "reach"),
    (light, ("sun",), {"false_accepts": 1}, "no milestone"),
    (miscalibrated, (), {"outcome": "lost"}, "knocked: at least"),
    (miscalibrated, (), {"error_m": 0.03}, "miscalibrated: at least"),
    (miscalibrated, (), {"found": [0.02] * 7}, "tilt is found"),
    (miscalibrated, (), {"found": [0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0]}, "yaw is found"),
    (miscalibrated, (), {"sigmas": [1e-5] * 7}, "within 2 sigma"),
    (miscalibrated, (), {"false_accepts": 1}, "no milestone"),
    (obstacles, (), {"contact_speeds": [0.38], "answered": 1}, "each contact below"),
    (obstacles, (), {"contact_speeds": [0.05], "answered": 0}, "each contact is answered"),
    (obstacles, (), {"verdict": "blocked wrongly"}, "at least 98%"),
    (obstacles, (), {"false_accepts": 1}, "no milestone"),
    (obstacles, (), {"path_m": 13.0}, "the way is at most"),
    (obstacles, (), {"false_obstacles": ["something"]}, "false obstacle"),
    (obstacles, (), {"needless": 1}, "needless stop"),
    (twins, ("right",), {"outcome": "lost"}, "told right"),
    (twins, ("wrong",), {"doubts": 0}, "told wrong"),
    (twins, ("wrong",), {"error_m": 4.4}, "wrong and confident"),
    (soak, (), {"false_accepts": 1}, "no milestone"),
    (soak, (), {"outcome": "lost"}, "reach"),
])
def test_a_flaw_fails_its_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, experiment: ModuleType, rows: tuple[str, ...],
    flaw: dict[str, Any], told: str,
) -> None:
    found = run_here(
        monkeypatch, tmp_path, experiment, lambda t: end(experiment, t, **flaw if t.row in rows or not rows else {}),
        quick=False, missions=300 if experiment is twins else 30)
    assert any(told in claim for claim in found.failing)
    if flaw.keys().isdisjoint({"path_m", "needless", "chi2"}):
        assert any("to look at" in note for note in found.notes) or experiment is miscalibrated


@pytest.mark.parametrize(("flaw", "told"), [
    ({"outcome": "lost"}, "within an inch"), ({"error_m": 0.03}, "within an inch"), ({"contacts": 1}, "no collision"),
    ({"false_accepts": 1}, "no false accept"), ({"outcome": "confused"}, "declared"),
])
def test_a_flaw_of_the_main_mission_fails_its_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flaw: dict[str, Any], told: str
) -> None:
    monkeypatch.setattr(missions, "SEEDS", 20)
    found = run_here(monkeypatch, tmp_path, missions, lambda t: end(missions, t, **flaw), quick=False)
    assert any(told in claim for claim in found.failing)


def test_quoted_figures_of_a_peer_stand_in_its_column(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, obstacles, lambda t: end(obstacles, t), quick=False, missions=30)
    assert [row["peer"] for row in found.record()["rows"] if row["peer"]] == ["25%; 48%"] and found.rows[0][3] == 30


@pytest.mark.parametrize("growth_mb", [0.9 * soak.MAX_MB_PER_MISSION, 1.1 * soak.MAX_MB_PER_MISSION])
def test_a_process_that_grows_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, growth_mb: float) -> None:
    found = run_here(
        monkeypatch, tmp_path, soak, lambda t: end(soak, t, memory_mb=400.0 + growth_mb * (t.seed - 1_000_000)),
        quick=False, missions=60)
    assert bool(found.failing) == (growth_mb > soak.MAX_MB_PER_MISSION)
    assert found.rows[-1][:5] == ("all", None, None, 60, pytest.approx(0.66))  # missions, km


def test_the_memory_of_each_process_is_told_apart() -> None:
    both: Any = [end(soak, Trial("flat", k), process=k % 2, memory_mb=300.0 + 100.0 * (k % 2) + 2.0 * k)
                 for k in range(80)]
    assert soak._find_growth_mb(both) == pytest.approx(4.0)  # each runs every second one


def test_only_an_experiment_that_drives_missions_by_number_takes_their_number() -> None:
    with pytest.raises(BadInput, match="levels has no number of missions"):
        experiments.run("levels", quick=True, missions=3)


@pytest.mark.slow
@pytest.mark.parametrize("experiment", [doors, inexact, light, miscalibrated, obstacles],
                         ids=lambda e: e.__name__.rpartition(".")[2])
def test_the_small_version_drives(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, experiment: ModuleType) -> None:
    found = run_here(monkeypatch, tmp_path, experiment, experiment.drive, quick=True)
    if experiment is obstacles:  # what it claims of ways needs more missions
        assert found.rows[0] == ("missions", None, None, 2, 1, 1, 1)
        assert not [claim for claim in found.failing if "milestone" in claim]
    else:
        assert found.holds, found.text()
