"""Experiments that drive: their quick versions hold what they claim."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments import trials
from experiments.paper import levels


@pytest.fixture(autouse=True)
def kept_elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Results go to a folder of the test's own."""
    monkeypatch.setattr(trials, "RUNS", tmp_path)


@pytest.mark.slow
def test_the_levels_of_servoing_do_what_quick_claims() -> None:
    report = levels.run(quick=True, seed=0)
    assert report.holds, report.text()
    assert not any("lab-to-allens-office: without the goal level" in claim for claim, _ in report.claims)
    assert any("Left out by --quick" in note and "goal level" in note for note in report.notes)
