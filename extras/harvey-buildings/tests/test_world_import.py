"""Buildings of other formats become worlds that can be checked, planned in and driven in."""

import sys
from importlib.util import find_spec
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from harvey.cli import main
from harvey_buildings import BuildingError, ImportedBuilding, import_building
from harvey_buildings.experiments.imported_building import draw_trips
from harvey_buildings.fitting.building_plan import Furnishing, Names, Space, WallOpening, slug
from harvey_buildings.fitting.placement import build_bounding_boxes, fit_into_room, place_door, place_wide_opening
from harvey_buildings.fitting.polygons import (
    clean_outline,
    find_facing_stretches,
    separate_outlines,
    square_outline,
)
from world_models.building.checks import check_world
from world_models.building.world import World
from world_models.files.world_files import load_world

DATA = Path(__file__).parents[4] / "shared" / "data" / "buildings"
DUPLEX, UNIVERSITY = DATA / "Ifc2x3_Duplex_Architecture.ifc", DATA / "pnu_abc.gml"
no_ifc = pytest.mark.skipif(find_spec("ifcopenshell") is None or not DUPLEX.is_file(),
                            reason="needs ifcopenshell and the Duplex apartment")
no_gml = pytest.mark.skipif(not UNIVERSITY.is_file(), reason="needs the university building")

Building = tuple[ImportedBuilding, World]
"""A building file as imported, and the world read from its text."""

ROOM = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)])


@pytest.fixture(scope="module")
def duplex(tmp_path_factory: pytest.TempPathFactory) -> Building:
    made = import_building(DUPLEX)
    path = tmp_path_factory.mktemp("duplex") / "duplex.toml"
    path.write_text(made.text, encoding="utf-8")
    return made, load_world(path)


@pytest.fixture(scope="module")
def university(tmp_path_factory: pytest.TempPathFactory) -> Building:
    made = import_building(UNIVERSITY)
    path = tmp_path_factory.mktemp("university") / "university.toml"
    path.write_text(made.text, encoding="utf-8")
    return made, load_world(path)


@no_ifc
def test_the_duplex_apartment_is_a_world_without_faults(duplex: Building) -> None:
    made, world = duplex
    assert check_world(world) == []
    assert len(world.rooms) == 21
    between_rooms = {d.between for d in world.doorways if d.name.startswith("door")}
    assert len(between_rooms) == 10
    assert "14 of 14 doors" in str(made.report) and "24 of 24 windows" in str(made.report)


@no_ifc
def test_rooms_of_the_duplex_are_as_large_as_the_file_says(duplex: Building) -> None:
    world = duplex[1]
    low, high = (bound(world.locale("a203-bedroom-2").outline, axis=0) for bound in (np.min, np.max))
    assert high - low == pytest.approx([3.708, 6.249], abs=0.01)
    assert world.locale("a203-bedroom-2").height_m == pytest.approx(2.58, abs=0.01)


@no_ifc
def test_the_duplex_says_what_cannot_be_reached_and_why(duplex: Building) -> None:
    world = duplex[1]
    assert "out of doors" in world.locale("b103-kitchen").properties["unreachable"]
    assert world.route("a102-living-room", "a104-bathroom-1") is not None
    assert world.route("a202-bedroom-1", "a205-utility") is not None
    assert world.route("a102-living-room", "a202-bedroom-1") is None, "by stairs only"
    assert {link.kind for link in world.links} == {"stairs"}


@no_ifc
def test_the_two_apartments_of_the_duplex_have_the_same_doors(duplex: Building) -> None:
    widths = {side: sorted(d.width_m for d in duplex[1].doorways if d.between[0].startswith(side))
              for side in "ab"}
    assert widths["a"] == pytest.approx(widths["b"], abs=0.025)


@no_ifc
def test_a_wall_beside_a_virtual_boundary_stays(duplex: Building) -> None:
    opening, = (d for d in duplex[1].doorways if set(d.between) == {"a102-living-room", "a101-foyer"})
    assert opening.width_m == pytest.approx(0.915), "0.09 m of partition stand beside it in the file"


@no_gml
def test_the_university_is_a_world_without_faults(university: Building) -> None:
    world = university[1]
    assert check_world(world) == []
    assert len(world.rooms) == 23 and not any(world.locale(r).properties.get("unreachable") for r in world.rooms)
    assert [round(world.locale(f).properties["elevation_m"], 2) for f in ("f2", "f3", "f4")] == [0.0, 3.5, 7.0]


@pytest.mark.parametrize(("name", "rooms", "open_doors"), [
    ("FJK-Haus_IndoorGML_withEXR-corrected_1_0_3", 14, 12), ("201-2019-05-24-corrected", 80, 79),
    ("KU-EngBuilding-IndoorGML-2019-02-12_with_NRG", 7, 6)])
def test_indoor_gml_by_others_is_a_world_without_faults(name: str, rooms: int, open_doors: int, tmp_path: Path) -> None:
    if not (DATA / f"{name}.gml").is_file():
        pytest.skip(f"needs {name}.gml")
    path = tmp_path / "building.toml"
    path.write_text(import_building(DATA / f"{name}.gml").text, encoding="utf-8")
    world = load_world(path)
    assert check_world(world) == []
    assert (len(world.rooms), len(world.doorways)) == (rooms, open_doors)


@no_gml
def test_the_university_plans_between_any_two_rooms_of_different_floors(university: Building) -> None:
    made, world = university
    network = made.network
    assert network is not None and network.layer == "network"
    pairs = [(a, b) for a, b in combinations(world.rooms, 2) if world.locale(a).parent != world.locale(b).parent]
    assert len(pairs) == 166
    for a, b in pairs:
        way = network.find_route(a, b)
        assert way is not None, (a, b)
        assert network.graph.nodes[way[0]]["floor"] == world.locale(a).parent
        assert network.graph.nodes[way[-1]]["floor"] == world.locale(b).parent


@no_gml
def test_a_wheeled_robot_changes_floors_of_the_university_by_elevator(university: Building) -> None:
    world = university[1]
    route = world.route("room1-deans-office", "restroom4")
    assert route is not None
    assert [world.passage(s.passage.name) for s in route.steps if s.passage.name.startswith("elevator")]


@no_gml
def test_between_floors_of_the_university_only_stairs_are_not_for_wheels(university: Building) -> None:
    world = university[1]
    pairs = [(a, b) for a, b in combinations(world.rooms, 2) if world.locale(a).parent != world.locale(b).parent]
    assert len(pairs) == 166 and all(world.walk(*pair) for pair in pairs)
    driven = [route for pair in pairs if (route := world.route(*pair)) is not None]
    assert len(driven) == 63
    assert world.walk("corridor3", "corridor2") is not None and world.route("corridor3", "corridor2") is None
    assert all(any("elevator" in step.passage.name for step in route.steps) for route in driven), (
        "nothing but an elevator joins floors on wheels")


@no_ifc
def test_trips_in_the_duplex_are_between_rooms_that_wheels_can_reach(duplex: Building) -> None:
    world = duplex[1]
    trips = list(draw_trips(world, 50, 0))
    assert [e.number for e in trips] == list(range(50)) and trips == list(draw_trips(world, 50, 0))
    assert all(e.origin != e.destination and world.route(e.origin, e.destination) for e in trips)
    rooms = {room for e in trips for room in (e.origin, e.destination)}
    assert not rooms & {"a105-stair", "b105-room", "r301-roof"} and len(rooms) == 18


def test_touching_rooms_are_put_apart_and_opened() -> None:
    rooms, changed = separate_outlines({"a": ROOM, "b": np.add(ROOM, [4.0, 0.0]), "c": np.add(ROOM, [20.0, 0.0])})
    assert changed == ["a", "b"] and np.array_equal(rooms["c"], np.add(ROOM, [20.0, 0.0]))
    cut = place_wide_opening("a-to-b", "a", "b", rooms, 2.0, [], 0.1)
    assert cut is not None and cut.between == ("a", "b") and 2.5 < cut.width_m < 3.0
    assert place_wide_opening("a-to-c", "a", "c", rooms, 2.0, [], 0.1) is None


def test_a_door_goes_where_it_is_and_not_where_no_wall_is() -> None:
    rooms = {"a": ROOM, "b": np.add(ROOM, [4.2, 0.0])}
    found = place_door(WallOpening("d", "floor", np.array([4.1, 1.0]), 0.8, 2.0), rooms, [("a", "b")])
    assert found is not None
    assert (found[0].side, found[0].along_m, found[0].width_m) == (1, pytest.approx(1.0), pytest.approx(0.8))
    assert place_door(WallOpening("d", "floor", np.array([1.0, 1.5]), 0.8, 2.0), rooms, [("a", "b")]) is None


def test_facing_needs_a_wall_between() -> None:
    assert find_facing_stretches("a", ROOM, "b", np.add(ROOM, [4.2, 0.0]))[0].gap_m == pytest.approx(0.2)
    assert find_facing_stretches("a", ROOM, "b", np.add(ROOM, [5.0, 0.0])) == []
    assert find_facing_stretches("a", ROOM, "b", np.add(ROOM, [4.2, 2.9])) == []


def test_crooked_walls_are_squared_and_spoilt_outlines_refused() -> None:
    crooked = np.add(ROOM, [(0.0, 0.0), (0.0, 0.1), (0.1, 0.0), (0.0, 0.1)])
    square = square_outline(crooked)
    ahead = np.roll(square, -1, axis=0) - square
    assert np.abs(ahead).min(axis=1).max() < 1e-9
    assert clean_outline(np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)])) is None
    assert clean_outline(np.array([(0.0, 0.0), (1.0, np.nan), (2.0, 1.0)])) is None


def test_furniture_in_a_wall_is_moved_out_of_it_or_left_out() -> None:
    space = Space("a", "room", "A", "floor", ROOM, 3.0, 2.5)
    box = ((-0.5, 0.5, -0.3, 0.3, 3.0, 3.9),)
    placed = fit_into_room(Furnishing("t", "t", "a", np.array([0.4, 1.0]), 0.0, box), ROOM, space)
    assert placed is not None and placed.at[0] == pytest.approx(0.5, abs=0.01) and placed.boxes[0][4:] == (
        0.0, pytest.approx(0.9))
    assert fit_into_room(Furnishing("t", "t", "a", np.array([9.0, 1.0]), 0.0, box), ROOM, space) is None
    high = ((-0.5, 0.5, -0.3, 0.3, 9.0, 9.9),)
    assert fit_into_room(Furnishing("t", "t", "a", np.array([2.0, 1.0]), 0.0, high), ROOM, space) is None


def test_a_flight_of_stairs_rises_box_by_box() -> None:
    treads = np.array([(x, y, 0.2 * x) for x in range(11) for y in (0.0, 1.0)] + [(0.0, 0.0, 0.0)])
    tops = [box[5] for box in build_bounding_boxes(treads, 5)]
    assert len(tops) == 5 and tops == sorted(tops) and tops[-1] == pytest.approx(2.0)


def test_names_are_words_and_given_once() -> None:
    names = Names("house")
    assert [names.new("Dean's Office", "room"), names.new("deans office", "room"), names.new("!", "room"),
            names.new("House", "room")] == ["deans-office", "deans-office-2", "room", "house-2"]
    assert slug("3층 복도") == "3층-복도"


def test_the_command_tells_what_it_cannot_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, text, expected in (("a.txt", "", "ends in .geojson"), ("b.gml", "nothing", "expected XML"),
                                 ("c.gml", '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "entities are not expanded"),
                                 ("d.gml", "<a/>", "1 to 5000 cells")):
        (tmp_path / name).write_text(text, encoding="utf-8")
        assert main(["world", "import", str(tmp_path / name), "--out", str(tmp_path / "out.toml")]) == 2
        assert expected in capsys.readouterr().err
    assert main(["world", "import", str(tmp_path / "none.gml")]) == 2


@no_gml
def test_the_command_writes_a_world_and_an_account(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["world", "import", str(UNIVERSITY), "--out", str(tmp_path / "out.toml")]) == 0
    told = capsys.readouterr().out
    assert "166 of 166 pairs of rooms on different floors" in told and "guessed" in told and "left out" in told
    assert "no faults in" in told


def test_without_the_extra_ifc_is_refused_in_plain_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ifcopenshell", None)
    (tmp_path / "a.ifc").write_text("ISO-10303-21;", encoding="utf-8")
    with pytest.raises(BuildingError, match=r"pip install ifcopenshell"):
        import_building(tmp_path / "a.ifc")
