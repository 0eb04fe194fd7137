"""Missions among things, judged: what is written, what is counted, and the experiment in its small version."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import experiments
from driven_here import run_here
from experiments.differences import obstacles
from experiments.differences.obstacles_trial import EMPTY, Trial, TrialEnd, make_trials, write_mission
from harvey.errors import BadInput
from sim.scenario import load_scenario


def end(trial: Trial, **other: Any) -> TrialEnd:
    """A flawless end, or one with flaws."""
    values: dict[str, Any] = {
        "verdict": "reached", "reason": "", "error_m": 0.01, "path_m": 11.0, "shortest_m": 10.0, "time_s": 50.0,
        "contact_speeds": [], "answered": 0, "obstacles": 1, "false_obstacles": [], "stops": 1, "needless": 0,
        "false_accepts": 0, "wall_s": 1.0}
    return TrialEnd(trial.row, trial.seed, trial.floor, **(values | other))


def test_an_empty_floor_is_the_cluttered_one_without_its_things(tmp_path: Path) -> None:
    cluttered, empty = (load_scenario(write_mission(Trial("", 5, floor), tmp_path)) for floor in ("cluttered", EMPTY))
    assert cluttered.truth.extra and not empty.truth.extra
    assert (cluttered.goal, cluttered.start, cluttered.details) == (empty.goal, empty.start, empty.details)


def test_in_each_tenth_mission_no_way_is_left() -> None:
    floors = [trial.floor for trial in make_trials("", 1_000_000, 20)]
    assert floors.count("barred") == 2 and floors.count("cluttered") == 18


def test_flawless_missions_hold_every_claim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, obstacles, end, quick=False)
    assert found.failing == () and found.rows[0][3] == 1_000
    assert [row["peer"] for row in found.record()["rows"] if row["peer"]] == ["25%; 48%"]


@pytest.mark.parametrize(("flaw", "told"), [
    ({"contact_speeds": [0.38], "answered": 1}, "each contact below"),
    ({"contact_speeds": [0.05], "answered": 0}, "each contact is answered"),
    ({"verdict": "blocked wrongly"}, "at least 98%"),
    ({"false_accepts": 1}, "no milestone"),
    ({"path_m": 13.0}, "the way is at most"),
    ({"false_obstacles": ["something"]}, "false obstacle"),
    ({"needless": 1}, "needless stop"),
])
def test_a_flaw_fails_its_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flaw: dict[str, Any], told: str
) -> None:
    found = run_here(monkeypatch, tmp_path, obstacles, lambda trial: end(trial, **flaw), quick=False, missions=30)
    assert any(told in claim for claim in found.failing)
    assert found.rows[0][3] == 30


@pytest.mark.slow
def test_the_small_version_drives(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = run_here(monkeypatch, tmp_path, obstacles, obstacles.run_trial, quick=True)
    assert found.rows[0] == ("missions", None, None, 2, 1, 1, 1)
    assert not [claim for claim in found.failing if "milestone" in claim]


def test_only_an_experiment_that_drives_missions_by_number_takes_their_number() -> None:
    with pytest.raises(BadInput, match="levels has no number of missions"):
        experiments.run("levels", quick=True, missions=3)
