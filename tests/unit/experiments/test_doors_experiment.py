"""Missions with doors otherwise than the model says: what is written, what is claimed, and the small version."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from driven_here import run_here
from experiments.differences import doors
from experiments.differences.doors import DoorResult, DoorTrial, run_door_mission
from experiments.generated.door_missions import write_door_mission
from sim.scenario import load_scenario
from sim.stage import build_stage


def end(trial: DoorTrial, **other: Any) -> DoorResult:
    """A flawless end, or one with flaws."""
    outcome = "blocked" if trial.case == "no way" else "reached"
    values: dict[str, Any] = {
        "door": "d", "outcome": outcome, "reason": "d is shut", "error_m": 0.01, "is_found": True, "false_states": [],
        "false_accepts": 0, "collisions": 0, "relocations": 0, "robot_s": 60.0, "wall_s": 4.0}
    return DoorResult(trial.case, trial.floor, **(values | other))


@pytest.mark.parametrize("case", ["another way", "no way", "stands open"])
def test_a_mission_is_written_the_same_again_and_can_be_staged(tmp_path: Path, case: Any) -> None:
    one = write_door_mission(tmp_path, 3, case)
    text = one.path.read_text("utf-8")
    assert write_door_mission(tmp_path, 3, case).path.read_text("utf-8") == text
    scenario = load_scenario(one.path)
    assert [d.name for d in scenario.truth.doors] == ([one.door] if one.door else [])
    build_stage(scenario)


def test_flawless_missions_hold_every_claim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, doors, end, quick=False)
    assert found.failing == ()
    assert sum(row[3] for row in found.rows) == 1_000


@pytest.mark.parametrize(("flaw", "told"), [
    ({"outcome": "lost"}, "another way"),
    ({"outcome": "lost"}, "no way"),
    ({"reason": "another-door is shut"}, "no way"),
    ({"outcome": "blocked"}, "harms nothing"),
    ({"false_states": ["d is shut at 3.0 s"]}, "as filed"),
    ({"false_accepts": 1}, "no milestone"),
])
def test_a_flaw_fails_its_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flaw: dict[str, Any], told: str
) -> None:
    found = run_here(monkeypatch, tmp_path, doors, lambda trial: end(trial, **flaw), quick=False, missions=30)
    assert any(told in claim for claim in found.failing)


@pytest.mark.slow
def test_the_small_version_drives(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, doors, run_door_mission, quick=True)
    assert found.holds, found.text()
    assert sum(row[3] for row in found.rows) == doors.QUICK_MISSIONS
