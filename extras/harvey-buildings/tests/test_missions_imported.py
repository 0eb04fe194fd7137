"""Experiments with buildings by others, a small version."""

from importlib.util import find_spec

import pytest

from experiments.robustness import imported_building, imported_floors
from experiments.shared_data import DUPLEX, UNIVERSITY, data_path, describe_absence

needs_duplex = pytest.mark.skipif(find_spec("ifcopenshell") is None or not data_path(DUPLEX).is_file(),
                                  reason=f"needs ifcopenshell, or {describe_absence(DUPLEX)}")
needs_university = pytest.mark.skipif(not data_path(UNIVERSITY).is_file(), reason=describe_absence(UNIVERSITY))


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
