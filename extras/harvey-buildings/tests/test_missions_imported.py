"""Experiments with buildings by others, a small version."""

from importlib.util import find_spec

import pytest

from experiments.shared_data import DUPLEX, data_path, describe_absence
from harvey_buildings.experiments import imported_building

needs_duplex = pytest.mark.skipif(find_spec("ifcopenshell") is None or not data_path(DUPLEX).is_file(),
                                  reason=f"needs ifcopenshell, or {describe_absence(DUPLEX)}")


@needs_duplex
def test_missions_in_an_imported_house_arrive() -> None:
    report = imported_building.run(quick=True, seed=0)
    assert report.holds, report.text()
    assert report.rows[-1][:3] == ("all", imported_building.QUICK_MISSIONS, imported_building.QUICK_MISSIONS)
