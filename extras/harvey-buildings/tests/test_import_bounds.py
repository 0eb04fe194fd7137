"""What importers take for a storey, a room, a door or a step: both sides of each bound, in files written here."""

from __future__ import annotations

import math
from importlib.util import find_spec
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ifc_house import House, box

from harvey_buildings import BuildingError, read_plan
from harvey_buildings.fitting.building_plan import BuildingPlan, Names, RoomLink, Space, Storey, slug
from harvey_buildings.fitting.layout import Layout, lay_out
from harvey_buildings.formats.ifc_file import build_column, build_stairs, find_climbed_spaces
from harvey_buildings.formats.indoor_gml import _find_crossing, _Reader, read_indoor_gml
from harvey_buildings.formats.indoor_gml_file import find_origin, read_xml

needs_ifc = pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell")
NAMES = {"c": "http://www.opengis.net/indoorgml/1.0/core", "g": "http://www.opengis.net/gml/3.2",
         "x": "http://www.w3.org/1999/xlink"}
Corners = tuple[float, float, float, float]


def gml(folder: Path, cells: dict[str, tuple[Corners, float, float]], ways: list[tuple[str, str]] | None = None,
        doors: dict[int, tuple[float, float, float, float]] | None = None, unit: float = 1.0) -> Path:
    """An IndoorGML file: (x0, y0, x1, y1), floor and height of each cell; a node in each; a door line for some ways."""
    spaces, nodes, edges, walls = "", "", "", ""
    for name, ((x0, y0, x1, y1), low, tall) in cells.items():
        rings = ""
        for z in (low, low + tall):
            around = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]
            places = "".join(f"<g:pos>{x / unit:.6f} {y / unit:.6f} {z / unit:.6f}</g:pos>" for x, y in around)
            rings += (f"<g:surfaceMember><g:Polygon><g:exterior><g:LinearRing>{places}</g:LinearRing></g:exterior>"
                      "</g:Polygon></g:surfaceMember>")
        spaces += (f'<c:cellSpaceMember><c:CellSpace g:id="{name}"><g:name>{name}</g:name><c:cellSpaceGeometry>'
                   f"<c:Geometry3D><g:Solid><g:exterior><g:Shell>{rings}</g:Shell></g:exterior></g:Solid></c:Geometry3D>"
                   "</c:cellSpaceGeometry></c:CellSpace></c:cellSpaceMember>")
        at = f"{(x0 + x1) / 2 / unit:.6f} {(y0 + y1) / 2 / unit:.6f} {(low + 1.0) / unit:.6f}"
        nodes += (f'<c:State g:id="S{name}"><c:duality x:href="#{name}"/><c:geometry><g:Point><g:pos>{at}</g:pos>'
                  "</g:Point></c:geometry></c:State>")
    for number, (a, b) in enumerate(ways or []):
        edges += (f'<c:Transition g:id="T{number}"><c:weight>1</c:weight><c:connects x:href="#S{a}"/>'
                  f'<c:connects x:href="#S{b}"/></c:Transition>')
    for number, (xa, ya, xb, yb) in (doors or {}).items():
        line = "".join(f"<g:pos>{x / unit:.6f} {y / unit:.6f} {z / unit:.6f}</g:pos>" for x, y, z in (
            (xa, ya, 0.0), (xb, yb, 0.0), (xb, yb, 2.1), (xa, ya, 2.1), (xa, ya, 0.0)))
        walls += (f'<c:cellSpaceBoundaryMember><c:CellSpaceBoundary g:id="B{number}"><c:duality x:href="#T{number}"/>'
                  f"<c:geometry3D><g:Polygon><g:exterior><g:LinearRing>{line}</g:LinearRing></g:exterior></g:Polygon>"
                  "</c:geometry3D></c:CellSpaceBoundary></c:cellSpaceBoundaryMember>")
    spelled = " ".join(f'xmlns:{key}="{value}"' for key, value in NAMES.items())
    path = folder / "made.gml"
    path.write_text(f'<?xml version="1.0"?><c:IndoorFeatures {spelled}><c:primalSpaceFeatures>{spaces}{walls}'
                    f"</c:primalSpaceFeatures><c:layers><c:SpaceLayer>{nodes}{edges}</c:SpaceLayer></c:layers>"
                    "</c:IndoorFeatures>")
    return path


A, B = (0.0, 0.0, 4.0, 3.0), (4.0, 0.0, 7.0, 3.0)


@pytest.mark.parametrize(("step", "storeys"), [(1.15, 1), (1.25, 2), (3.0, 2)])
def test_floors_less_than_a_metre_and_a_fifth_apart_are_one_storey(tmp_path: Path, step: float, storeys: int) -> None:
    plan, _ = read_indoor_gml(gml(tmp_path, {"a": (A, 0.05, 2.8), "b": (B, 0.05 + step, 2.8)}))
    assert len(plan.storeys) == storeys and plan.storeys[-1].elevation_m == pytest.approx(0.05 + step * (storeys > 1))
    assert [s.floor_m for s in plan.spaces] == pytest.approx([0.05, 0.05 + step])


@pytest.mark.parametrize(("below", "floor"), [(0.29, "up"), (0.31, "down"), (0.0, "up"), (-0.5, "up")])
def test_a_height_less_than_a_step_below_a_floor_is_on_it(tmp_path: Path, below: float, floor: str) -> None:
    reader = _Reader(tmp_path / "x.gml", read_xml(gml(tmp_path, {"a": (A, 0.0, 2.8)})), np.zeros(3), [])
    reader.floors = {0.0: "down", 3.5: "up"}
    assert reader._find_floor(3.5 - below) == floor
    assert reader._find_floor(-9.0) == "down"


@pytest.mark.parametrize(("tall", "height"), [(1.45, 2.8), (1.55, 1.55), (2.6, 2.6), (7.9, 7.9)])
def test_a_ceiling_is_at_least_a_metre_and_a_half(tmp_path: Path, tall: float, height: float) -> None:
    plan, _ = read_indoor_gml(gml(tmp_path, {"a": (A, 0.1, tall)}))
    assert plan.spaces[0].height_m == pytest.approx(height)


@pytest.mark.parametrize("unit", [1.0, 0.01, 0.0254])
def test_the_unit_is_told_by_doors_or_else_by_storeys(tmp_path: Path, unit: float) -> None:
    cells = {"a": (A, 0.123, 3.5), "b": (B, 0.123, 3.5)}
    plan, _ = read_indoor_gml(gml(tmp_path, cells, [("a", "b")], {0: (4.0, 1.0, 4.0, 1.9)}, unit))
    assert np.ptp(plan.spaces[0].outline, axis=0) == pytest.approx([4.0, 3.0], abs=2e-3)
    (door,) = plan.openings
    assert door.width_m == pytest.approx(0.9, abs=1e-3) and door.centre == pytest.approx([4.0, 1.45], abs=2e-3)
    assert (door.height_m, door.rooms) == (2.1, ("a", "b"))
    plan, _ = read_indoor_gml(gml(tmp_path, cells, None, None, unit))
    assert np.ptp(plan.spaces[0].outline, axis=0) == pytest.approx([4.0, 3.0], abs=2e-3)


def test_whole_heights_count_floors(tmp_path: Path) -> None:
    plan, _ = read_indoor_gml(gml(tmp_path, {"a": (A, 0.0, 1.0), "b": (B, 1.0, 1.0), "d": (A, 2.0, 1.0)}))
    assert [s.elevation_m for s in plan.storeys] == [0.0, 3.5, 7.0]
    assert [s.height_m for s in plan.spaces] == [2.8] * 3
    plan, _ = read_indoor_gml(gml(tmp_path, {"a": (A, 0.0, 1.02), "b": (B, 1.5, 1.0)}))
    assert [s.elevation_m for s in plan.storeys] == [0.0, 1.5]


@pytest.mark.parametrize(("width", "doors"), [(0.4, 0.6), (1.0, 1.0), (3.1, 3.1), (3.25, None)])
def test_a_boundary_that_a_way_passes_is_a_door(tmp_path: Path, width: float, doors: float | None) -> None:
    """At least as wide as the narrowest door; one of more than 3.2 m is a wall that is missing."""
    cells = {"a": ((0.0, 0.0, 4.0, 5.0), 0.1, 2.8), "b": ((4.0, 0.0, 7.0, 5.0), 0.1, 2.8)}
    plan, _ = read_indoor_gml(gml(tmp_path, cells, [("a", "b")], {0: (4.0, 0.5, 4.0, 0.5 + width)}))
    if doors is None:
        assert not plan.openings and plan.without_wall == {frozenset(("a", "b"))}
        return
    (door,) = plan.openings
    assert door.width_m == pytest.approx(doors) and door.centre == pytest.approx([4.0, 0.5 + width / 2.0], abs=1e-3)


@pytest.mark.parametrize(("long", "how"), [(0.27, "none"), (0.29, "door"), (1.57, "door"), (1.59, "open")])
def test_rooms_that_a_way_joins_where_they_touch(tmp_path: Path, long: float, how: str) -> None:
    """From 0.3 to 1.6 m (and a centimetre on either side) it is a doorway, in its middle; else there is no wall."""
    cells = {"a": (A, 0.1, 2.8), "b": ((4.0, 3.0 - long, 7.0, 9.0), 0.1, 2.8)}
    plan, _ = read_indoor_gml(gml(tmp_path, cells, [("a", "b")]))
    if how == "door":
        (door,) = plan.openings
        assert door.width_m == pytest.approx(long, abs=0.03)
        assert door.centre == pytest.approx([4.0, 3.0 - long / 2.0], abs=0.02)
    else:
        assert not plan.openings
    assert bool(plan.without_wall) == (how != "door")


def space(name: str, x0: float, y0: float, x1: float, y1: float, floor_m: float = 0.0, storey: str = "s") -> Space:
    return Space(name, "room", name, storey, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), floor_m, 2.5)


@settings(max_examples=40)
@given(st.floats(0.9, 6.0), st.floats(-2.0, 8.0), st.floats(0.0, 0.5))
def test_a_way_passes_a_shared_wall_as_near_as_there_is_wall(long: float, y: float, gap: float) -> None:
    """A door of 1.2 m and 5 cm on either side; the way is level, so the place is the nearest possible."""
    one, other = space("a", 0.0, 0.0, 4.0, 6.5), space("b", 4.0 + gap, 0.0, 8.0, long)
    found = _find_crossing(np.array([[2.0, y], [6.0, y]]), one, other)
    if abs(long - 1.3) > 1e-6:
        assert (found is None) == (long < 1.3)
    if found is not None:
        assert found == pytest.approx([4.0, min(max(y, 0.65), long - 0.65)])


@pytest.mark.parametrize(("x", "is_moved"), [(3990.0, False), (4010.0, True), (-4010.0, True)])
def test_projected_coordinates_are_moved_to_the_building(tmp_path: Path, x: float, is_moved: bool) -> None:
    root = read_xml(gml(tmp_path, {"a": ((x - 2.0, 0.0, x + 2.2, 3.0), 0.0, 2.8)}))
    origin = find_origin(root)
    assert origin.any() == is_moved and origin[2] == 0.0
    assert not is_moved or origin[0] == pytest.approx(x, abs=3.0)


def test_a_file_of_too_many_cells_or_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BuildingError, match="1 to 5000 cells"):
        read_indoor_gml(gml(tmp_path, {}))


@given(st.floats(0.2, 1.5), st.floats(0.2, 1.5), st.floats(-math.pi, math.pi), st.floats(-3.0, 3.0))
def test_a_column_fills_its_hole_from_floor_to_ceiling(width: float, depth: float, turn: float, floor: float) -> None:
    import shapely

    from harvey_buildings.fitting.placement import footprint

    hole = shapely.affinity.rotate(shapely.box(1.0, 1.0, 1.0 + width, 1.0 + depth), turn, use_radians=True)
    column = build_column("c", space("a", 0.0, 0.0, 9.0, 9.0, floor), hole)
    assert shapely.Polygon(footprint(column)).symmetric_difference(hole).area < 1e-6
    assert column.boxes[0][4:] == pytest.approx((floor, floor + 2.5)) and column.kind == "column"


FLIGHT = np.array([[x, y, z] for x in (1.0, 3.0) for y in (1.0, 2.0) for z in (0.0, 3.0)])


@pytest.mark.parametrize(("up", "away", "joins"), [(3.45, 0.0, True), (3.55, 0.0, False), (2.55, 0.0, True),
                                                   (3.0, 0.45, True), (3.0, 0.55, False)])
def test_stairs_begin_and_end_at_floors_within_half_a_metre(up: float, away: float, joins: bool) -> None:
    spaces = [space("low", 0.0, 0.0, 9.0, 9.0), space("far", 30.0, 0.0, 39.0, 9.0),
              space("high", 3.0 + away, 0.0, 9.0, 9.0, up, "t")]
    found = [(a.name, b.name) for a, b in find_climbed_spaces(FLIGHT, spaces)]
    assert found == [("low", "high")] * joins


def test_stairs_are_eight_boxes_about_their_middle() -> None:
    slope = np.array([[x, y, max(0.0, x)] for x in np.linspace(0.0, 4.0, 33) for y in (0.0, 1.0)])
    stairs = build_stairs("s", "a", slope + np.array([5.0, 2.0, 0.0]))
    assert stairs.at == pytest.approx([7.0, 2.5]) and len(stairs.boxes) == 8
    assert [b[5] for b in stairs.boxes] == pytest.approx([0.5 * (i + 1) for i in range(8)], abs=0.13)


def plan_of(*spaces: Space, storeys: tuple[str, ...] = ("s",)) -> BuildingPlan:
    plan = BuildingPlan("p", "p.file", [Storey(name, 3.0 * at) for at, name in enumerate(storeys)])
    plan.spaces += spaces
    return plan


def test_storeys_are_laid_out_ten_metres_or_more_apart() -> None:
    plan = plan_of(space("a", 0.0, -1.0, 4.0, 4.3), space("b", 0.0, -2.5, 4.0, 3.0, 3.0, "t"),
                   space("c", 0.0, 0.0, 4.0, 3.0, 6.0, "u"), storeys=("s", "t", "u"))
    layout: Layout = lay_out(plan)
    assert layout.north_m == {"s": 0.0, "t": 17.0, "u": 30.0}


@pytest.mark.parametrize(("reach", "is_read"), [(1999.0, True), (2001.0, False)])
def test_a_building_is_within_two_kilometres(reach: float, is_read: bool) -> None:
    plan = plan_of(space("a", reach - 4.0, 0.0, reach, 3.0))
    if is_read:
        lay_out(plan)
        return
    with pytest.raises(BuildingError, match="within 2000 m"):
        lay_out(plan)


@pytest.mark.parametrize(("width", "is_full"), [(0.71, True), (0.73, False)])
def test_a_room_without_a_place_for_the_robot_is_full(width: float, is_full: bool) -> None:
    assert bool(lay_out(plan_of(space("a", 0.0, 0.0, width, 3.0))).full) == is_full


def test_the_largest_set_of_rooms_comes_first() -> None:
    at = {"alone": 0.0, "b": 10.0, "c": 20.0}
    plan = plan_of(*(space(name, x, 0.0, x + 3.0, 3.0) for name, x in at.items()))
    plan.links.append(RoomLink("w", "stairs", ("b", "c")))
    layout = lay_out(plan)
    assert list(layout.rooms) == ["b", "c", "alone"] and list(layout.shut_off) == ["alone"]


def test_names_are_numbered_and_short() -> None:
    names = Names("room")
    assert [names.new("Room", "x") for _ in range(3)] == ["room-2", "room-3", "room-4"]
    assert names.new("  ", "space") == "space" and slug("O'Neil's_Lab  2") == "oneils-lab-2"
    assert len(slug("a" * 80)) == 60 and slug("a" * 59 + " bc") == "a" * 59


@needs_ifc
@pytest.mark.parametrize(("height", "is_kept"), [(0.98, False), (1.02, True)])
def test_spaces_lower_than_a_metre_are_left_out(tmp_path: Path, height: float, is_kept: bool) -> None:
    house = House("IFC4", "metre")
    house.storey("s", 0.0)
    house.space("tall", box(0.0, 0.0, 4.0, 3.0), 2.5)
    house.space("low", box(5.0, 0.0, 9.0, 3.0), height)
    plan = read_plan(house.write(tmp_path / "h.ifc"))[0]
    assert len(plan.spaces) == 1 + is_kept


@needs_ifc
@pytest.mark.parametrize(("height", "is_read"), [(19.9, True), (20.3, False)])
def test_rooms_higher_than_twenty_metres_mean_a_wrong_unit(tmp_path: Path, height: float, is_read: bool) -> None:
    house = House("IFC4", "metre")
    house.storey("s", 0.0)
    house.space("hall", box(0.0, 0.0, 4.0, 3.0), height)
    path = house.write(tmp_path / "h.ifc")
    if is_read:
        assert read_plan(path)[0].spaces[0].height_m == pytest.approx(height)
        return
    with pytest.raises(BuildingError, match="up to 20 m high"):
        read_plan(path)


@needs_ifc
@pytest.mark.parametrize(("side", "is_column"), [(1.99, True), (2.01, False)])
def test_a_hole_of_up_to_four_square_metres_is_a_column(tmp_path: Path, side: float, is_column: bool) -> None:
    house = House("IFC4", "metre")
    house.storey("s", 0.0)
    hall = house.profile(box(0.0, 0.0, 9.0, 9.0), box(3.0, 3.0, 3.0 + side, 3.0 + side))
    house.space("hall", (), shape=house.shape(house.extruded(hall, 0.0, 2.5)))
    plan = read_plan(house.write(tmp_path / "h.ifc"))[0]
    assert bool([t for t in plan.furnishings if t.kind == "column"]) == is_column


def test_a_navigation_graph_has_lengths_in_metres_and_a_node_for_each_room(tmp_path: Path) -> None:
    cells = {"a": (A, 0.1, 2.8), "b": (B, 0.1, 2.8), "up": (A, 3.6, 2.8)}
    plan, network = read_indoor_gml(gml(tmp_path, cells, [("a", "b"), ("a", "up")]))
    assert network is not None and network.rooms == {name: f"S{name}" for name in cells}
    lengths = nx.get_edge_attributes(network.graph, "length_m")
    assert {frozenset(k): round(v, 6) for k, v in lengths.items()} == {
        frozenset(("Sa", "Sb")): 3.5, frozenset(("Sa", "Sup")): 3.5}
    kinds = {frozenset(k): v for k, v in nx.get_edge_attributes(network.graph, "kind").items()}
    assert kinds == {frozenset(("Sa", "Sb")): "floor", frozenset(("Sa", "Sup")): "stairs"}
    assert [(link.kind, link.between) for link in plan.links] == [("stairs", ("a", "up"))]


@pytest.mark.parametrize(("x", "y"), [(3.0e5, -4.0e4), (-7.0e5, 12.0), (8.0, 6.0e6)])
def test_the_origin_of_a_far_house_is_near_its_rooms_in_both_directions(x: float, y: float) -> None:
    from harvey_buildings.formats.ifc_file import ElementShape, find_plan_origin

    corners = np.array([[x + u, y + v, z] for u in (-2.0, 2.0) for v in (-1.0, 1.0) for z in (0.0, 2.5)])
    origin = find_plan_origin([ElementShape(corners, (), np.eye(4)[:3])])
    assert origin.zero == pytest.approx([x, y], abs=0.51)
