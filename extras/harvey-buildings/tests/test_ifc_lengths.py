"""Every length that the IFC importer reads, in every unit and on two storeys, against ifcopenshell's own numbers.

The oracle asks ifcopenshell for each element's shape in the world [m] and for the file's unit; it shares nothing with
the importer. Doors are stated narrower than their holes, and some elements are in no storey, so that what the file
states in words counts, and not only its shapes.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from ifc_house import House, box
from numpy.typing import NDArray

from harvey_buildings import read_plan
from harvey_buildings.fitting.building_plan import BuildingPlan

pytestmark = pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell")

UNITS = ("metre", "millimetre", "foot", "none")
HOLE_M, STATED_M = 1.1, 0.9
Array = NDArray[np.float64]


def build_house(unit: str, upper_m: float, told_m: float | None) -> House:
    """Two rooms on each of two storeys, each with a door, a passage, a window and a table.

    Args:
        upper_m: height at which the upper storey is placed. told_m: its stated height; None: it is not stated.
    """
    house = House("IFC4", unit)
    for number, (low, told) in enumerate(((0.0, 0.0), (upper_m, told_m))):
        storey = house.storey(f"storey {number}", low, told)
        if told is None:
            storey.Elevation = None
        contained = number == 0
        high = 2.5 + 0.2 * number
        names = [f"{number}{letter}" for letter in "ab"]
        house.space(names[0], box(0.0, 0.0, 4.0, 3.0), high)
        house.space(names[1], box(4.2, 0.0, 6.2 + number, 3.0), high)
        inner = house.wall(4.0, 0.0, 4.2, 3.0, contained=contained)
        outer = house.wall(-0.2, 0.0, 0.0, 3.0, contained=contained)
        hole = house.opening(inner, 4.0, 0.3, 4.2, 0.3 + HOLE_M)
        door = house.element("IfcDoor", box(0.0, -0.02, STATED_M, 0.02), 0.0, 2.1, at=(4.1, 0.4, 0.0), turn_deg=90.0,
                             name=f"door {number}", contained=contained, OverallWidth=house.n(STATED_M),
                             OverallHeight=house.n(2.1))
        house.rooted("IfcRelFillsElement", None, RelatingOpeningElement=hole, RelatedBuildingElement=door)
        house.opening(inner, 4.0, 1.6, 4.2, 2.8, name=f"passage {number}")
        gap = house.opening(outer, -0.2, 1.0, 0.0, 2.3, 0.9, 1.2)
        pane = house.element("IfcWindow", box(-0.15, 1.0, -0.05, 2.3), 0.9, 1.2, name=f"window {number}",
                             contained=contained, OverallWidth=house.n(1.3), OverallHeight=house.n(1.2))
        house.rooted("IfcRelFillsElement", None, RelatingOpeningElement=gap, RelatedBuildingElement=pane)
        house.element("IfcFurniture", box(-0.6, -0.3, 0.6, 0.3), 0.0, 0.74, at=(1.5, 1.5, 0.0), turn_deg=20.0,
                      name=f"table {number}", contained=contained)
    return house


def find_extents(model: Any, element: Any) -> Array:
    """(2, 3) least and largest corner of an element's own shape in the world [m], by ifcopenshell."""
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    corners = np.array(ifcopenshell.geom.create_shape(settings, element).geometry.verts).reshape(-1, 3)
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def of_name(model: Any, kind: str, name: str) -> Any:
    return next(element for element in model.by_type(kind) if element.Name == name)


@pytest.fixture(scope="module", params=[(unit, told) for unit in UNITS for told in (3.1, 3.4, None)],
                ids=lambda p: f"{p[0]}-{p[1]}")
def read(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, BuildingPlan]:
    import ifcopenshell

    unit, told = request.param
    path = build_house(unit, 3.1, told).write(tmp_path_factory.mktemp("ifc") / "house.ifc")
    return ifcopenshell.open(str(path)), read_plan(path)[0]


def test_storeys_are_as_high_as_stated_or_placed(read: tuple[Any, BuildingPlan]) -> None:
    import ifcopenshell.util.placement
    import ifcopenshell.util.unit

    model, plan = read
    unit_m = ifcopenshell.util.unit.calculate_unit_scale(model)
    expected = []
    for storey in model.by_type("IfcBuildingStorey"):
        placed = ifcopenshell.util.placement.get_local_placement(storey.ObjectPlacement)[2, 3]
        expected.append((placed if storey.Elevation is None else storey.Elevation) * unit_m)
    assert [s.elevation_m for s in plan.storeys] == pytest.approx(sorted(expected), abs=1e-3)


def test_rooms_are_as_large_and_as_high(read: tuple[Any, BuildingPlan]) -> None:
    model, plan = read
    assert len(plan.spaces) == 4
    for space in plan.spaces:
        low, high = find_extents(model, of_name(model, "IfcSpace", space.label))
        assert space.outline.min(axis=0) == pytest.approx(low[:2], abs=2e-3)
        assert space.outline.max(axis=0) == pytest.approx(high[:2], abs=2e-3)
        assert space.floor_m == pytest.approx(low[2], abs=1e-3)
        assert space.height_m == pytest.approx(high[2] - low[2], abs=1e-3)
        assert space.storey == f"storey-{space.label[0]}"


def test_doors_are_as_wide_as_stated_and_as_high_as_their_holes(read: tuple[Any, BuildingPlan]) -> None:
    import ifcopenshell.util.unit

    model, plan = read
    unit_m = ifcopenshell.util.unit.calculate_unit_scale(model)
    doors = [o for o in plan.openings if o.has_leaf]
    assert len(doors) == 2
    for door, number in zip(doors, (0, 1), strict=True):
        element = of_name(model, "IfcDoor", f"door {number}")
        low, high = find_extents(model, element.FillsVoids[0].RelatingOpeningElement)
        assert door.width_m == pytest.approx(element.OverallWidth * unit_m, abs=1e-3)
        assert door.width_m < high[1] - low[1] - 0.1
        assert door.height_m == pytest.approx(high[2] - low[2], abs=1e-3)
        assert door.centre == pytest.approx((low + high)[:2] / 2.0, abs=2e-3)
        assert door.storey == f"storey-{number}"


def test_passages_are_as_large_as_their_holes(read: tuple[Any, BuildingPlan]) -> None:
    model, plan = read
    passages = [o for o in plan.openings if not o.has_leaf]
    assert len(passages) == 2
    for passage, number in zip(passages, (0, 1), strict=True):
        low, high = find_extents(model, of_name(model, "IfcOpeningElement", f"passage {number}"))
        assert passage.width_m == pytest.approx(high[1] - low[1], abs=1e-3)
        assert passage.height_m == pytest.approx(high[2] - low[2], abs=1e-3)
        assert passage.centre == pytest.approx((low + high)[:2] / 2.0, abs=2e-3)
        assert passage.storey == f"storey-{number}"


def test_windows_are_where_and_as_large_as_their_holes(read: tuple[Any, BuildingPlan]) -> None:
    model, plan = read
    assert len(plan.windows) == 2
    for window, number in zip(plan.windows, (0, 1), strict=True):
        hole = of_name(model, "IfcWindow", f"window {number}").FillsVoids[0].RelatingOpeningElement
        low, high = find_extents(model, hole)
        assert window.width_m == pytest.approx(high[1] - low[1], abs=1e-3)
        assert window.sill_m == pytest.approx(low[2], abs=1e-3)
        assert window.height_m == pytest.approx(high[2] - low[2], abs=1e-3)
        assert window.centre == pytest.approx((low + high)[:2] / 2.0, abs=2e-3)
        assert window.storey == f"storey-{number}"


def test_tables_are_where_and_as_large_as_their_shapes(read: tuple[Any, BuildingPlan]) -> None:
    model, plan = read
    assert len(plan.furnishings) == 2
    for table, number in zip(plan.furnishings, (0, 1), strict=True):
        low, high = find_extents(model, of_name(model, "IfcFurniture", f"table {number}"))
        x0, x1, y0, y1, z0, z1 = table.boxes[0]
        c, s = np.cos(table.turn_rad), np.sin(table.turn_rad)
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) @ np.array([[c, s], [-s, c]]) + table.at
        assert corners.min(axis=0) == pytest.approx(low[:2], abs=2e-3)
        assert corners.max(axis=0) == pytest.approx(high[:2], abs=2e-3)
        assert (z0, z1) == pytest.approx((low[2], high[2]), abs=1e-3)
        assert plan.space(table.room).storey == f"storey-{number}"
