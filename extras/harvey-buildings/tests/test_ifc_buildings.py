"""Houses as different programs write them in IFC: rooms of the right size, doors that join the right ones, errors."""

from __future__ import annotations

import math
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import shapely
from ifc_house import House, box, flat

from harvey.cli import main
from harvey_buildings import BuildingError, import_building, read_plan
from harvey_buildings.fitting.building_plan import Space
from harvey_buildings.fitting.polygons import Floats, extract_outline, separate_outlines, straighten_wall
from harvey_buildings.formats.ifc_file import find_climbed_spaces
from world_models.building.checks import check_world
from world_models.building.world import World
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

pytestmark = pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell")


def import_house(house: House, folder: Path) -> tuple[World, str]:
    """The world of a house, which must be without faults, and what the import tells."""
    made = import_building(house.write(folder / "house.ifc"))
    world = read_world(Source.parse(made.text))
    assert check_world(world) == []
    return world, str(made.report)


def areas(world: World) -> dict[str, float]:
    return {name: float(shapely.Polygon(world.locale(name).outline).area) for name in world.rooms}


def doors(world: World) -> set[tuple[str, ...]]:
    return {tuple(sorted(doorway.between)) for doorway in world.doorways}


def row(house: House, gap_m: float, *, wall_m: float | None = None) -> House:
    """Rooms a, b and c of 3 by 3 m so far from each other, with walls between them, and no space boundaries."""
    house.storey("Ground", 0.0)
    for i, name in enumerate("abc"):
        house.space(name, box((3.0 + gap_m) * i, 0.0, (3.0 + gap_m) * i + 3.0, 3.0))
    thick = gap_m if wall_m is None else wall_m
    for i in (1, 2):
        middle = (3.0 + gap_m) * i - gap_m / 2
        house.wall(middle - thick / 2, 0.0, middle + thick / 2, 3.0)
    return house


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4", "IFC4X3"])
@pytest.mark.parametrize("unit", ["metre", "millimetre", "foot", "none"])
def test_rooms_are_as_large_in_any_unit(tmp_path: Path, schema: str, unit: str) -> None:
    world, report = import_house(flat(House(schema, unit)), tmp_path)
    assert areas(world) == {"1-living": pytest.approx(12.0, abs=0.01), "2-bath": pytest.approx(6.0, abs=0.01)}
    assert doors(world) == {("1-living", "2-bath")} and world.doorways[0].width_m == pytest.approx(0.9, abs=1e-3)
    assert ("says nothing of its unit" in report) == (unit == "none")


@pytest.mark.parametrize(("at", "words"), [
    ((0.0, 0.0, 0.0, 30.0), "turned by -30.0 degrees"),
    ((2_600_000.0, 1_200_000.0, 430.0, 0.0), "far from the file's zero"),
    ((456_000.0, 5_400_000.0, 112.0, -17.0), "turned by 17.0 degrees"),
])
def test_a_house_is_the_same_wherever_it_stands(tmp_path: Path, at: tuple[float, ...], words: str) -> None:
    house = flat(House("IFC4", "millimetre", (at[0], at[1], at[2], at[3])))
    house.element("IfcFurniture", box(-0.8, -0.4, 0.8, 0.4), 0.0, 0.7, at=(2.0, 1.5, 0.0), name="Table")
    world, report = import_house(house, tmp_path)
    outline = world.locale("1-living").outline
    assert outline.max(axis=0) - outline.min(axis=0) == pytest.approx([4.0, 3.0], abs=1e-3)
    assert len(world.doorways) == 1 and [t.name for t in world.things] == ["1-living/table-163"]
    assert words in report


def test_shapes_of_spaces(tmp_path: Path) -> None:
    house = House("IFC4", "millimetre")
    house.storey("EG", 0.0)
    house.space("brep", (), shape=house.shape(house.brep(box(0, 0, 4, 3), 0.0, 2.5), kind="Brep"))
    house.space("mapped", (), shape=house.mapped(house.extruded(house.profile(box(4.2, 0, 8.2, 3)), 0.0, 2.5)))
    corner = house.make("IfcBoundingBox", Corner=house.point(8.4, 0.0, 0.0), XDim=house.n(4.0), YDim=house.n(3.0),
                        ZDim=house.n(2.5))
    house.space("box", (), shape=house.shape(corner, kind="BoundingBox", called="Box"))
    lines = house.make("IfcGeometricCurveSet", [house.profile(box(12.6, 0, 16.6, 3)).OuterCurve])
    house.space("lines", (), shape=house.shape(lines, kind="GeometricCurveSet", called="FootPrint"))
    house.space("nothing", (), shape="none")
    house.space("L", [(0, 3.2), (4, 3.2), (4, 5.2), (2, 5.2), (2, 7.2), (0, 7.2)])
    for x in (4.0, 8.2, 12.4):
        house.door(x, 1.0, x + 0.2, 1.9)
    house.door(1.0, 3.0, 1.9, 3.2)
    world, report = import_house(house, tmp_path)
    assert areas(world) == dict.fromkeys(("brep", "mapped", "box", "lines", "l"), pytest.approx(12.0, abs=0.01))
    assert doors(world) == {("brep", "mapped"), ("box", "mapped"), ("box", "lines"), ("brep", "l")}
    assert "nothing: the file gives it no shape" in report and "lines: drawn as lines only" in report


def test_doors_by_boundary_of_their_opening_without_a_leaf_and_across_their_frame(tmp_path: Path) -> None:
    house = row(House(), 0.2)
    a, b = house.file.by_type("IfcSpace")[:2]
    first, second = house.file.by_type("IfcWall")
    door = house.door(3.0, 1.0, 3.2, 1.9, wall=first, leaf=False)
    for space in (a, b):
        house.bound(space, door.FillsVoids[0].RelatingOpeningElement)
    house.door(6.2, 1.0, 6.4, 1.9, wall=second, own_frame=False, told=False)
    world, _ = import_house(house, tmp_path)
    assert doors(world) == {("a", "b"), ("b", "c")}
    assert [d.width_m for d in world.doorways] == pytest.approx([0.9, 0.9], abs=1e-3)


@pytest.mark.parametrize("unit", ["millimetre", "foot"])
def test_a_door_and_a_window_without_any_shape_are_where_their_stated_size_and_place_say(
        tmp_path: Path, unit: str) -> None:
    """Also turned and far from zero; the wall's depth is not stated, so the place is right along the wall alone."""
    plans = []
    for bare in (False, True):
        house = flat(House("IFC4", unit, (2_600_000.0, 1_200_000.0, 400.0, 30.0)))
        house.door(0.0, 1.0, 0.2, 2.5, kind="IfcWindow", wall=house.file.by_type("IfcWall")[0], low=0.9, height=1.2)
        for element in house.file.by_type("IfcDoor") + house.file.by_type("IfcWindow") if bare else ():
            element.Representation = element.FillsVoids[0].RelatingOpeningElement.Representation = None
        if bare:
            house.file.by_type("IfcWindow")[0].ObjectPlacement.RelativePlacement.Location = house.point(0.1, 1.0, 0.9)
        plans.append(read_plan(house.write(tmp_path / "house.ifc"))[0])
    shaped, stated = plans
    assert "2 doors and windows have no shape: their stated width" in str(stated.report)
    for old, new in zip(shaped.openings + shaped.windows, stated.openings + stated.windows, strict=True):
        assert new.centre == pytest.approx(old.centre, abs=0.02) and abs(new.along @ old.along) > 0.999
        assert (new.width_m, new.height_m) == pytest.approx((old.width_m, old.height_m), abs=1e-3)
    assert stated.windows[0].sill_m == pytest.approx(shaped.windows[0].sill_m, abs=1e-3)
    house.file.by_type("IfcDoor")[0].OverallHeight = None
    told = str(read_plan(house.write(tmp_path / "house.ifc"))[0].report)
    assert "0 of 1 doors" in told and "its place, width and height are not all stated" in told


@pytest.mark.parametrize("mark", [b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff"])
def test_a_byte_order_mark_and_lone_backslashes_are_no_hindrance(tmp_path: Path, mark: bytes) -> None:
    path = flat(House()).write(tmp_path / "house.ifc")
    text = path.read_text().replace("FILE_NAME('", "FILE_NAME('C:\\temp\\")
    text = text.replace("Living", "C:\\new\\X2\\ \\S\\").replace("Bath", "\\X2\\00FC\\X0\\ \\\\ \xfc")
    encoding = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}.get(mark, "utf-8")
    path.write_bytes(mark + text.encode(encoding))
    assert [space.label for space in read_plan(path)[0].spaces] == ["C:\\new\\X2\\ \\S\\", "\xfc \\ \xfc"]
    path.write_bytes(mark + text.encode("cp1252") + b" ")
    with pytest.raises(BuildingError, match=r"first bytes say utf-.*, which it is not"):
        read_plan(path)


def test_a_thin_wall_is_a_wall_though_the_file_has_no_boundaries(tmp_path: Path) -> None:
    house = row(House(), 0.1)
    house.door(3.0, 1.0, 3.1, 1.9)
    world, _ = import_house(house, tmp_path)
    assert doors(world) == {("a", "b")}


def test_a_wall_on_the_border_of_spaces_that_touch_is_a_wall(tmp_path: Path) -> None:
    house = row(House(), 0.0, wall_m=0.2)
    house.door(2.9, 1.0, 3.1, 1.9)
    world, _ = import_house(house, tmp_path)
    assert doors(world) == {("a", "b")}


def test_where_a_wall_ends_the_rest_is_open_and_no_railing_is(tmp_path: Path) -> None:
    house = House()
    house.storey("Ground", 0.0)
    for name, x in (("a", 0.0), ("b", 3.0), ("c", 6.0)):
        house.space(name, box(x, 0.0, x + 3.0, 6.0))
    house.wall(2.95, 0.0, 3.05, 3.5)
    house.space("stairwell", box(9.0, 0.0, 12.0, 6.0))
    house.element("IfcRailing", box(5.97, 0.0, 6.03, 6.0), 0.0, 0.9)
    house.element("IfcRailing", box(8.97, 0.0, 9.03, 6.0), 0.0, 4.0)
    world, _ = import_house(house, tmp_path)
    assert doors(world) == {("a", "b"), ("c", "stairwell")}, "the railing of stairs leads up them"
    assert 2.0 < min(doorway.width_m for doorway in world.doorways) < 2.5


def test_openings_without_doors_and_virtual_boundaries_are_ways_through(tmp_path: Path) -> None:
    house = House()
    house.storey("Ground", 0.0)
    a, b, c = (house.space(name, box(x, 0.0, x + 3.0, 3.0)) for name, x in (("a", 0.0), ("b", 3.0), ("c", 6.2)))
    for space in (a, b):
        house.bound(space, house.rooted("IfcVirtualElement", None), "VIRTUAL")
    wall = house.wall(6.0, 0.0, 6.2, 3.0)
    house.bound(c, wall)
    house.opening(wall, 6.0, 1.0, 6.2, 2.0)
    house.opening(wall, 6.0, 2.2, 6.2, 2.8, 1.2, 0.6)
    world, report = import_house(house, tmp_path)
    assert doors(world) == {("a", "b"), ("b", "c")}
    assert "1 openings without a door" in report, "one cannot walk through a hatch"


def test_walls_of_old_houses(tmp_path: Path) -> None:
    house = row(House(), 0.8)
    for x in (3.0, 6.8):
        house.door(x, 1.0, x + 0.8, 1.9)
    assert doors(import_house(house, tmp_path)[0]) == {("a", "b"), ("b", "c")}


def test_a_step_between_rooms_is_told(tmp_path: Path) -> None:
    house = row(House(), 0.2)
    house.file.by_type("IfcSpace")[1].ObjectPlacement = house.place((0.0, 0.0, 0.4), above=house.storeys[0])
    house.door(3.0, 1.0, 3.2, 1.9)
    assert "from a to b the floor goes up by 0.40 m in the file; drawn level" in import_house(house, tmp_path)[1]


def test_a_door_in_a_curved_wall(tmp_path: Path) -> None:
    house = House()
    house.storey("Ground", 0.0)
    house.space("round", (), shape=house.shape(house.extruded(house.circle(3.0, 3.0, 3.0), 0.0, 2.5)))
    bends = [math.pi * i / 24 - math.pi / 2 for i in range(25)]
    inner, outer = ([(3 + r * math.cos(t), 3 + r * math.sin(t)) for t in bends] for r in (3.2, 5.0))
    house.space("hall", outer + inner[::-1])
    house.door(6.0, 2.5, 6.2, 3.4, wall=house.wall(6.0, 2.0, 6.2, 4.0))
    world, report = import_house(house, tmp_path)
    assert doors(world) == {("hall", "round")} and "curved wall is straight" in report
    assert areas(world)["round"] == pytest.approx(9 * math.pi, rel=0.02)
    assert len(world.locale("round").outline) < 40


def test_a_corridor_round_a_core_and_a_column(tmp_path: Path) -> None:
    house = House()
    house.storey("Ground", 0.0)
    hall = house.profile(box(0, 0, 12, 10), box(3, 3, 9, 7), box(10.0, 5.0, 10.4, 5.4))
    house.space("hall", (), shape=house.shape(house.extruded(hall, 0.0, 2.5)))
    house.space("core", box(3.2, 3.2, 8.8, 6.8))
    house.door(5.0, 3.0, 5.9, 3.2)
    world, report = import_house(house, tmp_path)
    assert areas(world)["hall"] == pytest.approx(96.0, abs=0.5) and doors(world) == {("core", "hall")}
    assert [thing.name for thing in world.things] == ["hall/column-1"]
    assert "goes round what is no part of it" in report


def test_areas_over_rooms_and_rooms_told_twice_are_no_rooms(tmp_path: Path) -> None:
    house = House()
    house.storey("Ground", 0.0)
    house.space("gross", box(-0.3, -0.3, 6.5, 3.3), PredefinedType="GFA")
    house.space("1", box(0.0, 0.0, 3.0, 3.0))
    house.space("2", box(3.2, 0.0, 6.2, 3.0))
    house.space("2", box(3.2, 0.0, 6.2, 3.0), long_name="again")
    house.door(3.0, 1.0, 3.2, 1.9)
    world, report = import_house(house, tmp_path)
    assert set(world.rooms) == {"1", "2"} and doors(world) == {("1", "2")}
    assert "space gross: other spaces of ground cover it" in report


def test_storeys_by_height_where_the_file_does_not_say(tmp_path: Path) -> None:
    """The site is at 100 m, elevations count from the building's zero, and all is contained in the building."""
    house = House("IFC4", "metre", (0.0, 0.0, 100.0, 0.0))
    for height in (0.0, 3.0):
        house.storey(None, height)
        house.space("a", box(0.0, 0.0, 3.0, 3.0))
        house.space("b", box(3.2, 0.0, 6.2, 3.0))
        house.door(3.0, 1.0, 3.2, 1.9)
    for relation in house.file.by_type("IfcRelAggregates"):
        if relation.RelatedObjects[0].is_a("IfcSpace"):
            relation.RelatingObject = house.building
    for relation in house.file.by_type("IfcRelContainedInSpatialStructure"):
        relation.RelatingStructure = house.building
    world, _ = import_house(house, tmp_path)
    assert doors(world) == {("a", "b"), ("a-2", "b-2")}
    assert world.locale("a").parent != world.locale("a-2").parent == world.locale("b-2").parent


def test_rooms_over_each_other_in_one_storey(tmp_path: Path) -> None:
    house = House()
    house.storey("All", 0.0)
    for low in (0.0, 3.0):
        for x in (0.0, 3.2):
            solid = house.extruded(house.profile(box(x, 0.0, x + 3.0, 3.0)), low, 2.5)
            house.space(None, (), shape=house.shape(solid))
        house.door(3.0, 1.0, 3.2, 1.9, low=low)
    world, report = import_house(house, tmp_path)
    assert len(world.rooms) == 4 and len(doors(world)) == 2 and "in a storey of their own" in report


def test_doors_of_a_storey_that_has_no_rooms(tmp_path: Path) -> None:
    house = row(House(), 0.2)
    house.door(3.0, 1.0, 3.2, 1.9, storey=house.storey("Slab", -0.1))
    assert doors(import_house(house, tmp_path)[0]) == {("a", "b")}


@pytest.mark.parametrize("how", ["a flight alone", "a stair with its railing", "parts"])
def test_stairs_join_storeys(tmp_path: Path, how: str) -> None:
    house = House("IFC4", "millimetre")
    below = house.storey("EG", 0.0)
    house.space("hall", box(0.0, 0.0, 6.0, 3.0))
    house.storey("OG", 2.9)
    house.space("landing", box(0.0, 0.0, 6.0, 3.0))
    solids = [house.extruded(house.profile(box(1 + 0.25 * i, 0.2, 1.25 + 0.25 * i, 1.2)), 0.0, 2.9 / 14 * (i + 1))
              for i in range(14)]
    if how == "a stair with its railing":
        solids.append(house.extruded(house.profile(box(4.3, 1.2, 4.5, 1.25)), 0.0, 3.85))
    kind = "IfcStair" if how == "a stair with its railing" else "IfcStairFlight"
    steps = house.rooted(kind, "Treppe", ObjectPlacement=house.place(above=below), Representation=house.shape(*solids))
    if how == "parts":
        stair = house.rooted("IfcStair", "Treppe", ObjectPlacement=house.place(above=below))
        house.aggregate(stair, steps)
        steps = stair
    house.contain(below, steps)
    world, report = import_house(house, tmp_path)
    assert [link.between for link in world.links] == [("hall", "landing")] and "1 of 1 stairs" in report


def test_a_lift_joins_the_shafts_over_each_other(tmp_path: Path) -> None:
    house = House()
    for number in range(3):
        house.storey(f"Level {number}", 3.0 * number)
        house.space(f"hall {number}", box(0.0, 0.0, 5.0, 3.0))
        house.space(f"shaft {number}", box(5.2, 0.0, 7.2, 2.0))
        house.door(5.0, 0.5, 5.2, 1.5)
    house.element("IfcTransportElement", box(5.4, 0.2, 7.0, 1.8), 0.0, 2.2, storey=house.storeys[0],
                  PredefinedType="ELEVATOR")
    world, report = import_house(house, tmp_path)
    assert [(link.kind, link.between) for link in world.links] == [
        ("elevator", ("shaft-0", "shaft-1")), ("elevator", ("shaft-1", "shaft-2"))]
    assert world.route("hall-0", "hall-2") is not None and "1 lifts: 2 rides" in report


def test_stairs_over_three_storeys_pass_the_one_between() -> None:
    square = extract_outline(shapely.box(0.0, 0.0, 4.0, 4.0))
    assert square is not None
    spaces = [Space(f"s{i}", "hall", "", f"f{i}", square, 3.0 * i, 2.5) for i in range(3)]
    points = shapely.get_coordinates(shapely.box(1, 1, 2, 3))
    tower: Floats = shapely.get_coordinates(shapely.force_3d(shapely.MultiPoint(points)), include_z=True)
    tower[:, 2] = [0.0, 6.9, 3.0, 0.0, 6.0]
    assert [(a.name, b.name) for a, b in find_climbed_spaces(tower, spaces)] == [("s0", "s1"), ("s1", "s2")]


def test_furniture_of_a_storey_stands_in_the_room_round_it_but_in_no_doorway(tmp_path: Path) -> None:
    house = flat(House("IFC4", "foot"))
    house.element("IfcFurniture", box(-0.4, -0.3, 0.4, 0.3), 0.0, 0.75, at=(1.0, 1.0, 0.0), turn_deg=20.0, name="Tisch")
    house.element("IfcSanitaryTerminal", box(-0.2, -0.3, 0.2, 0.3), 0.0, 0.4, at=(5.9, 2.5, 0.0), name="WC")
    house.element("IfcFurniture", box(-0.4, -0.3, 0.4, 0.3), 0.0, 0.05, at=(3.8, 1.4, 0.0), name="Mat")
    world, report = import_house(house, tmp_path)
    assert {thing.name.rpartition("-")[0] for thing in world.things} == {"1-living/tisch", "2-bath/wc"}
    assert "it stands in the doorway" in report


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_letters_as_they_are_though_the_format_wants_them_spelled_out(tmp_path: Path, encoding: str) -> None:
    text = flat(House()).file.to_string().replace("'Living'", "'Küche'").replace("'Bath'", r"'B\X2\00FC\X0\ro'")
    (tmp_path / "house.ifc").write_bytes(text.encode(encoding))
    made = import_building(tmp_path / "house.ifc")
    assert "[locales.\"1-küche\"]" in made.text and "[locales.\"2-büro\"]" in made.text


def test_what_cannot_be_a_world_is_told_in_a_paragraph(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    walls = House()
    walls.storey("EG", 0.0)
    walls.wall(0.0, 0.0, 5.0, 0.2)
    shapeless = House()
    shapeless.storey("EG", 0.0)
    shapeless.space("a", (), shape="none")
    wrong = flat(House())
    wrong.file.by_type("IfcUnitAssignment")[0].Units = [wrong.make("IfcSIUnit", UnitType="LENGTHUNIT", Prefix="KILO",
                                                                   Name="METRE")]
    cut = tmp_path / "cut.ifc"
    text = flat(House()).file.to_string()
    cut.write_text(text[: len(text) // 2], encoding="ascii")
    for path, expected in ((walls.write(tmp_path / "walls.ifc"), "expected rooms (IfcSpace), got none, only 1 IfcWall"),
                           (House().write(tmp_path / "empty.ifc"), "expected rooms (IfcSpace)"),
                           (shapeless.write(tmp_path / "none.ifc"), "the file gives it no shape"),
                           (wrong.write(tmp_path / "wrong.ifc"), "got half of them higher than 2500 m"),
                           (cut, "one that is cut off")):
        assert main(["world", "import", str(path), "--out", str(tmp_path / "out.toml")]) == 2
        assert expected in capsys.readouterr().err, path
    with pytest.raises(BuildingError, match=r"house\.ifc"):
        import_house(House(), tmp_path)


def test_a_straight_wall_stays_as_it_is() -> None:
    square = extract_outline(shapely.box(0.0, 0.0, 4.0, 4.0))
    assert square is not None
    assert straighten_wall(square, np.array([2.0, 0.0]), np.array([1.0, 0.0]), 0.9) is None


def test_a_room_within_a_room_leaves_it_what_is_round_it() -> None:
    bounds = {"hall": (0.0, 0.0, 9.0, 9.0), "core": (3.0, 3.0, 6.0, 6.0)}
    outlines = {name: extract_outline(shapely.box(*bound)) for name, bound in bounds.items()}
    rooms, _ = separate_outlines({name: outline for name, outline in outlines.items() if outline is not None})
    shapes = {name: shapely.Polygon(outline) for name, outline in rooms.items()}
    assert shapes["hall"].intersection(shapes["core"]).area == 0.0
    assert shapes["hall"].area == pytest.approx(72.0, abs=0.8)
