"""Experiments that drive: their quick versions hold what they claim."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

from experiments import trials
from experiments.paper import levels
from experiments.robustness import imported_building, imported_floors
from experiments.shared_data import DUPLEX, UNIVERSITY, data_path, describe_absence

needs_duplex = pytest.mark.skipif(find_spec("ifcopenshell") is None or not data_path(DUPLEX).is_file(),
                                  reason=f"needs ifcopenshell (the extra ifc), or {describe_absence(DUPLEX)}")
needs_university = pytest.mark.skipif(not data_path(UNIVERSITY).is_file(), reason=describe_absence(UNIVERSITY))


@pytest.fixture(autouse=True)
def kept_elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Results go to a folder of the test's own."""
    monkeypatch.setattr(trials, "RUNS", tmp_path)


def test_the_levels_of_servoing_do_what_quick_claims() -> None:
    report = levels.run(quick=True, seed=0)
    assert report.holds, report.text()
    assert not any("lab-to-allens-office: without the goal level" in claim for claim, _ in report.claims)
    assert any("Left out by --quick" in note and "goal level" in note for note in report.notes)


@needs_duplex
def test_missions_in_an_imported_house_arrive() -> None:
    report = imported_building.run(quick=True, seed=0)
    assert report.holds, report.text()
    assert report.rows[-1][:3] == ("all", imported_building.QUICK_MISSIONS, imported_building.QUICK_MISSIONS)


@needs_university
def test_there_is_a_plan_between_any_two_floors_of_an_imported_building() -> None:
    report = imported_floors.run(quick=True, seed=0)
    assert report.holds, report.text()
    assert report.rows
