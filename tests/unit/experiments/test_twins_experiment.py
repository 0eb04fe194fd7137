"""Missions on floors of identical rooms: what is written, and what is claimed."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from driven_here import run_here
from experiments.differences import twins
from experiments.differences.twins import TwinResult, TwinTrial
from experiments.generated.floors import generated_floor
from experiments.generated.missions import write_twin_mission
from sim.scenario import load_scenario
from sim.stage import build_stage


def end(trial: TwinTrial, **other: Any) -> TwinResult:
    flawless = TwinResult(trial.seed, trial.is_told_right, 8, "reached", "", 0.01, not trial.is_told_right, 0,
                          int(not trial.is_told_right), 0, 60.0, 5.0)
    return replace(flawless, **other)


@pytest.mark.parametrize("is_told_right", [True, False])
def test_a_mission_is_written_the_same_again_and_can_be_staged(tmp_path: Path, is_told_right: bool) -> None:
    one = write_twin_mission(tmp_path, 3, is_told_right=is_told_right, rooms=6)
    text = one.path.read_text("utf-8")
    again = write_twin_mission(tmp_path, 3, is_told_right=is_told_right, rooms=6)
    assert again == one and again.path.read_text("utf-8") == text
    stage = build_stage(load_scenario(one.path))
    assert (stage.put_down_world == stage.start_world) == is_told_right == (one.told == one.true)
    assert stage.world.locale_at([*stage.put_down_world.position, 0.0]) == one.true


def test_rooms_are_identical_but_for_a_turn() -> None:
    floor = generated_floor(5, 8, open_share=1.0, identical=True)
    rooms = [tomllib.loads(floor.text)["locales"][name] for name in floor.rooms]
    assert all(room["size"] == rooms[0]["size"] for room in rooms)
    parts = [sorted(thing["part"] for thing in room["things"]) for room in rooms]
    assert parts[0] and all(names == parts[0] for names in parts)
    north = [room for name, room in zip(floor.rooms, rooms, strict=True) if "north" in name]
    assert all(room["things"] == north[0]["things"] for room in north)


def test_flawless_missions_hold_every_claim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, twins, end, quick=False)
    assert found.failing == ()
    assert sum(row[3] for row in found.rows) == twins.MISSIONS
    told_right = found.rows[0][3]
    assert 0.97 * twins.MISSIONS < told_right < 0.99 * twins.MISSIONS


@pytest.mark.parametrize(("told_right", "flaw", "claim"), [
    (True, {"outcome": "lost"}, "told right"),
    (False, {"doubts": 0}, "told wrong"),
    (False, {"error_m": 4.4}, "wrong and confident"),
])
def test_a_flaw_fails_its_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, told_right: bool, flaw: dict[str, Any], claim: str
) -> None:
    def work(trial: TwinTrial) -> TwinResult:
        return end(trial, **flaw) if trial.is_told_right == told_right else end(trial)

    found = run_here(monkeypatch, tmp_path, twins, work, quick=False, missions=300)
    assert any(claim in failing for failing in found.failing)
