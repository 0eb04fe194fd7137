"""The experiment integrity: every fault makes a scenario, and what is claimed of missions that are given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blackboard import Entry
from experiments.differences.obstacles import Lacking
from experiments.robustness import integrity
from experiments.robustness.integrity import KINDS, NO_FAULT, PLACES, Flight, Point, Trial
from sim.scenario import load_scenario
from world_models.entries import BodyFault, Hypothesis, Obstacle, Obstruction, PoseFix, Protection, diagonal
from world_models.frames import Pose2


@pytest.mark.parametrize("kind", KINDS)
def test_every_fault_makes_a_scenario(kind: str, tmp_path: Path) -> None:
    for seed in range(4):
        trial = Trial(kind, "forty feet", seed)
        assert KINDS[kind].least <= trial.size <= KINDS[kind].most
        scenario = load_scenario(trial.write(tmp_path))
        assert scenario.faults or "[[faults]]" not in KINDS[kind].text


def test_a_fix_and_a_belief_say_their_protection_level() -> None:
    belief = Hypothesis("hall", Pose2(0.0, 0.0, 0.0), diagonal(0.01, 0.01), "milestone").protected(
        Protection(0.07, 0.01, "a wall"))
    assert integrity.protection_level(Entry("Hypothesis-1", 0, belief, "test", 1)) == pytest.approx(0.07)
    fix = PoseFix("LineMatch-1", Pose2(0.0, 0.0, 0.0), np.eye(3), np.zeros(0, bool), np.zeros((0, 2)), (),
                  protection=Protection(0.09, 0.01, "a wall"))
    assert integrity.protection_level(Entry("PoseFix-1", 0, fix, "test", 1)) == 0.09


def test_what_is_further_off_than_it_says_misleads() -> None:
    assert not Point(1, 0.02, 0.01).is_misleading
    assert Point(1, 0.02, 0.03).is_misleading and not Point(1, 0.02, 0.03).is_hazardous
    assert Point(1, 0.02, 0.11).is_hazardous and not Point(1, 0.12, 0.13).is_hazardous


def test_entries_name_what_is_wrong() -> None:
    lacking = Lacking.of_segments(np.array([[[2.0, 0.0], [2.0, 1.0]]]), np.zeros((0, 2, 2)))
    there = Obstacle("hall/obstacle-1", "hall", ((1.9, 0.2), (2.1, 0.2), (2.1, 0.4), (1.9, 0.4)), 0.02, 2.0, 0.3, 0.2)
    nowhere = replace(there, footprint=tuple((x + 1.0, y) for x, y in there.footprint))
    for value, words in ((BodyFault("camera", "frame late", "", "", 1.0), ["frame late"]), ("anything else", []),
                         (Obstruction(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))), ["hidden"]), (there, ["thing"]),
                         (nowhere, ["false thing"]), (replace(nowhere, status="suspected"), [])):
        assert list(integrity.list_words(value, lacking)) == words


def fly(trial: Trial, **flaw: Any) -> Flight:
    """A flawless mission, or one with a flaw."""
    word = next(iter(KINDS[trial.kind].named), None)
    points = [Point(9, 0.02, 0.01)] * 3
    good: dict[str, Any] = {"fixes": points, "beliefs": points, "alerts": {word: 1.0} if word else {}}
    return Flight(trial.kind, trial.place, trial.seed, trial.size, "reached", **{**good, **flaw})


def run(monkeypatch: pytest.MonkeyPatch, folder: Path, drive: Any) -> Any:
    monkeypatch.setattr(integrity, "campaign_folder", lambda *_, **__: folder)
    monkeypatch.setattr(integrity, "run_trials", lambda _work, trials, *_: [drive(trial) for trial in trials])
    return integrity.run(quick=True, seed=0)


def test_flawless_missions_hold_every_claim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    report = run(monkeypatch, tmp_path, fly)
    assert report.holds and [row[0] for row in report.rows] == list(KINDS) and (tmp_path / "stanford.png").exists()


@pytest.mark.parametrize(("flaw", "claim"), [
    ({"fixes": [Point(9, 0.02, 0.11)]}, "of the fixes at most 0.0001 are hazardously misleading"),
    ({"beliefs": [Point(9, 0.02, 0.03)]}, "of the beliefs at most 0.0001 are misleading"),
    ({"fixes": [Point(9, 0.2, 0.01)]}, "available"),
    ({"alerts": {"lost": 2.0}}, "no mission has an alert"),
])
def test_a_flaw_fails_its_claim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flaw: dict[str, Any], claim: str,
                                ) -> None:
    report = run(monkeypatch, tmp_path, lambda trial: fly(trial, **flaw if trial.kind == NO_FAULT else {}))
    assert any(claim in failing for failing in report.failing)


def test_the_missions_are_at_every_place(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    trials: list[Trial] = []
    run(monkeypatch, tmp_path, lambda trial: (trials.append(trial), fly(trial))[1])
    assert {trial.place for trial in trials} == set(PLACES) and len({trial.seed for trial in trials}) == len(trials)
