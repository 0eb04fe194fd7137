"""Missions with a camera mounted otherwise: what is written, what is claimed, and the small version."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from driven_here import run_here
from experiments.differences import miscalibrated
from experiments.differences.miscalibrated import CameraResult, CameraTrial, run_camera_mission
from experiments.generated.missions import CAMERA_CASES, MAX_TURN_RAD, write_camera_mission
from sim.scenario import load_scenario
from sim.stage import build_stage


def end(trial: CameraTrial, **other: Any) -> CameraResult:
    """A flawless end, or one with flaws."""
    values: dict[str, Any] = {
        "outcome": "reached", "reason": "there", "error_m": 0.01, "false_accepts": 0, "relocations": 0,
        "told": [0.02] * 7, "found": [1e-4] * 7, "sigmas": [1e-4] * 7, "is_learnt": True, "is_knocked": False,
        "gone_m": 12.0, "robot_s": 60.0, "wall_s": 4.0}
    return CameraResult(trial.case, trial.floor, **(values | other))


@pytest.mark.parametrize("case", CAMERA_CASES)
def test_a_mission_is_written_the_same_again_and_can_be_staged(tmp_path: Path, case: Any) -> None:
    path = write_camera_mission(tmp_path, 3, case)
    text = path.read_text("utf-8")
    assert write_camera_mission(tmp_path, 3, case).read_text("utf-8") == text
    scenario = load_scenario(path)
    camera = scenario.truth.camera
    assert bool(scenario.faults) == (case == "knocked") and bool(camera.tilt_rad) == (case == "miscalibrated")
    assert max(abs(camera.tilt_rad), abs(camera.roll_rad), abs(camera.yaw_rad)) <= MAX_TURN_RAD
    build_stage(scenario)


def test_flawless_missions_hold_every_claim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, miscalibrated, end, quick=False)
    assert found.failing == ()
    assert sum(row[3] for row in found.rows) == 1_000


@pytest.mark.parametrize(("flaw", "told"), [
    ({"outcome": "lost"}, "knocked: at least"),
    ({"error_m": 0.03}, "miscalibrated: at least"),
    ({"found": [0.02] * 7}, "tilt is found"),
    ({"found": [0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0]}, "yaw is found"),
    ({"sigmas": [1e-5] * 7}, "within 2 sigma"),
    ({"false_accepts": 1}, "no milestone"),
])
def test_a_flaw_fails_its_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flaw: dict[str, Any], told: str
) -> None:
    found = run_here(monkeypatch, tmp_path, miscalibrated, lambda trial: end(trial, **flaw), quick=False, missions=30)
    assert any(told in claim for claim in found.failing)


@pytest.mark.slow
def test_the_small_version_drives(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, miscalibrated, run_camera_mission, quick=True)
    assert found.holds, found.text()
    assert {row[0] for row in found.rows} == set(CAMERA_CASES)
