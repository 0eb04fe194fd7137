"""The laws of GeoJSON as a building file: a world written and read again has the same plan; IMDF has it to the cm."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from harvey.cli import main
from harvey_buildings import BuildingError, import_building, read_plan
from harvey_buildings.exporters import export_world
from world_models.building.checks import check_world
from world_models.building.world import World
from world_models.files.first_world import first_world_text
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world

SOME = settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
MANY = settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
ROOMS = st.lists(st.sampled_from(["office", "library", "kitchen", "lab", "store", "studio"]), min_size=2, max_size=5,
                 unique=True)
DEGREE_M = 6_371_008.8 * np.pi / 180.0


def made(rooms: list[str]) -> World:
    return read_world(Source.parse(first_world_text("made", rooms), "made.toml"))


def again(path: Path) -> World:
    world = read_world(Source.parse(import_building(path).text, "again.toml"))
    assert check_world(world) == []
    return world


def assert_same(world: World, other: World, tolerance_m: float) -> None:
    assert set(other.rooms) == set(world.rooms)
    for room in world.rooms:
        own, found = shapely.Polygon(world.outline(room)), shapely.Polygon(other.outline(room))
        assert found.area == pytest.approx(own.area, abs=tolerance_m * own.length), room
    doors, found_doors = ({frozenset(d.between): d for d in w.doorways} for w in (world, other))
    assert set(doors) == set(found_doors)
    for pair, door in doors.items():
        assert found_doors[pair].width_m == pytest.approx(door.width_m, abs=tolerance_m)


@pytest.mark.parametrize("name", ["research_center", "campus"])
def test_a_shipped_world_written_and_read_again_has_the_same_plan(name: str, tmp_path: Path) -> None:
    world = load_world(WORLDS / f"{name}.toml")
    export_world(world, tmp_path / "w.geojson")
    other = again(tmp_path / "w.geojson")
    assert_same(world, other, 0.01)
    assert {frozenset(link.between) for link in other.links} == {frozenset(link.between) for link in world.links}
    assert sum(t.is_obstacle for t in other.things) == sum(t.is_obstacle for t in world.things)


@SOME
@given(rooms=ROOMS)
def test_so_has_any_first_world(tmp_path: Path, rooms: list[str]) -> None:
    export_world(made(rooms), tmp_path / "w.json")
    assert_same(made(rooms), again(tmp_path / "w.json"), 0.01)


@SOME
@given(rooms=ROOMS, longitude=st.floats(-170.0, 170.0), latitude=st.floats(-70.0, 70.0))
def test_imdf_has_the_rooms_and_openings_wherever_on_earth_it_lies(
    tmp_path: Path, rooms: list[str], longitude: float, latitude: float,
) -> None:
    world = made(rooms)
    write_imdf(tmp_path, world, longitude, latitude)
    assert_same(world, again(tmp_path / "unit.geojson"), 0.02)


def write_imdf(folder: Path, world: World, longitude: float, latitude: float) -> None:
    """unit, opening and level as an IMDF archive has them: degrees, names by language, openings as lines."""
    def degrees(xy: np.ndarray) -> list[list[float]]:
        return (np.array([longitude, latitude]) + xy / DEGREE_M / [np.cos(np.radians(latitude)), 1.0]).tolist()

    units = [imdf("unit", room, {"type": "Polygon", "coordinates": [degrees(np.vstack([o, o[:1]]))]},
                  {"name": {"en": room}, "category": "room", "level_id": "ground"})
             for room in world.rooms if (o := world.outline(room)) is not None]
    lines = [imdf("opening", door.name, {"type": "LineString", "coordinates": degrees(door.thresholds_world[0])},
                  {"category": "pedestrian", "level_id": "ground"}) for door in world.doorways]
    levels = [imdf("level", "ground", None, {"ordinal": 0, "name": {"en": "Ground"}})]
    for stem, features in (("unit", units), ("opening", lines), ("level", levels)):
        collection = {"type": "FeatureCollection", "features": features}
        (folder / f"{stem}.geojson").write_text(json.dumps(collection), encoding="utf-8")


def imdf(kind: str, name: str, geometry: dict | None, more: dict) -> dict:
    return {"type": "Feature", "feature_type": kind, "id": name, "geometry": geometry, "properties": more}


def test_what_is_guessed_is_told(tmp_path: Path) -> None:
    write_imdf(tmp_path, made(["office", "lab"]), 11.0, 48.0)
    told = str(import_building(tmp_path / "unit.geojson").report)
    assert "3 rooms, 2 doorways, 0 things, 0 links of 6 features; x and y are metres east and north" in told
    assert "rooms are 2.5 m high" in told and "doorways are 2.05 m high" in told and "storeys are 3 m apart" in told


def write_tower(folder: Path, units: list[dict], crs: str | None = None, **others: list) -> Path:
    """Units on three levels, and other files by name; coordinates as they are given."""
    levels = [imdf("level", f"l{n}", None, {"ordinal": n, "name": {"en": f"Level {n}"}}) for n in range(3)]
    for stem, features in {"unit": units, "level": levels, **others}.items():
        told = {} if crs is None else {"crs": {"type": "name", "properties": {"name": crs}}}
        text = json.dumps({"type": "FeatureCollection", **told, "features": features})
        (folder / f"{stem}.geojson").write_text(text, encoding="utf-8")
    return folder / "unit.geojson"


def unit(name: str, level: int, x0: float, y0: float, x1: float, y1: float, category: str = "room",
         at: tuple[float, float] = (11.0, 48.0), by: float | None = None) -> dict:
    """A unit of so many metres, in degrees from a place; or times ``by`` where that is given."""
    scale = np.array([1.0 / np.cos(np.radians(at[1])), 1.0]) / DEGREE_M if by is None else np.full(2, by)
    ring = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]) * scale + at
    return imdf("unit", name, {"type": "Polygon", "coordinates": [ring.tolist()]},
                {"category": category, "level_id": f"l{level}", "name": None})


@pytest.mark.parametrize(("category", "levels", "joined"), [
    ("elevator", (0, 1, 2), "elevator"), ("elevator", (0, 2), "elevator"), ("stairs", (0, 1, 2), "stairs"),
    ("escalator", (0, 1), "stairs"), ("ramp", (1, 2), "stairs"), ("stairs", (0, 2), ""), ("room", (0, 1), "")])
def test_units_of_lifts_and_stairs_over_one_another_join_their_levels(
        tmp_path: Path, category: str, levels: tuple[int, ...], joined: str) -> None:
    units = [unit(f"h{n}", n, 0, 0, 8, 4) for n in range(3)] + [
        unit(f"s{n}", n, 8, 0, 11, 4, category) for n in levels] + [unit("other", 1, 20, 0, 23, 4, category)]
    plan, _ = read_plan(write_tower(tmp_path, units))
    assert [storey.name for storey in plan.storeys] == ["level-0", "level-1", "level-2"]
    pairs = [(f"s{a}", f"s{b}") for a, b in pairwise(levels)]
    assert [(link.kind, link.between) for link in plan.links] == ([(joined, pair) for pair in pairs] if joined else [])


def test_a_relationship_joins_the_units_that_it_names_and_a_level_that_lacks_is_told(tmp_path: Path) -> None:
    units = [unit(f"h{n}", n, 9.0 * n, 0, 9.0 * n + 8.0, 4) for n in range(3)]
    way = imdf("relationship", "r", None, {"category": "ramp", "origin": {"id": "h2"}, "intermediary": [{"id": "h1"}],
                                           "destination": {"id": "h0"}})
    path = write_tower(tmp_path, units, relationship=[way])
    assert [link.between for link in read_plan(path)[0].links] == [("h0", "h1"), ("h1", "h2")]
    (tmp_path / "level.geojson").unlink()
    with pytest.raises(BuildingError, match=r"expected each level that a unit is on .*got none with the id 'l0'"):
        read_plan(path)


@pytest.mark.parametrize(("crs", "at", "by"), [
    ("urn:ogc:def:crs:EPSG::3857", (1_224_514.4, 6_106_854.8), 1.0 / np.cos(np.radians(48.0))),
    ("EPSG:32632", (649_000.0, 5_318_000.0), 1.0), ("urn:ogc:def:crs:OGC:1.3:CRS84", (11.0, 48.0), None),
    ("urn:ogc:def:crs:EPSG::2263", None, None), (None, (649_000.0, 5_318_000.0), 1.0)])
def test_projected_metres_are_used_as_such_or_refused_by_name(
        tmp_path: Path, crs: str | None, at: tuple[float, float] | None, by: float | None) -> None:
    path = write_tower(tmp_path, [unit("den", 0, 0, 0, 8, 4, at=at or (11.0, 48.0), by=by)], crs)
    if at is None or crs is None:
        with pytest.raises(BuildingError, match=r"EPSG:3857 or a zone of UTM\)?, got .*(2263|coordinates up to 5.318)"):
            read_plan(path)
        return
    assert np.ptp(read_plan(path)[0].spaces[0].outline, axis=0) == pytest.approx([8.0, 4.0], abs=0.01)


def test_an_opening_is_as_wide_as_a_world_may_have_it_and_what_export_writes_is_read(tmp_path: Path) -> None:
    """Two halls beside each other with an opening of 25 m; then one as wide and halls as high as a world allows."""
    units = [unit("one", 0, 0, 0, 30, 40), unit("two", 0, 30.1, 0, 60, 40)]
    line = unit("", 0, 30.05, 5, 30.05, 30)["geometry"]["coordinates"][0][1:3]
    gap = imdf("opening", "gap", {"type": "LineString", "coordinates": line}, {"level_id": "l0"})
    path = write_tower(tmp_path, units, opening=[gap])
    made = import_building(path)
    assert again(path).doorways[0].width_m == 20.0 and "gap: 25.0 m wide in the file" in str(made.report)
    tall = made.text.replace("height = 2.5", "height = 60").replace("height = 2.05", "height = 20")
    world = read_world(Source.parse(tall, "tall.toml"))
    export_world(world, tmp_path / "w.geojson")
    assert_same(world, other := again(tmp_path / "w.geojson"), 0.01)
    assert other.doorways[0].height_m == 20.0 and other.locale("one").height_m == 60.0


SQUARE = {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]]}
LINE = {"type": "LineString", "coordinates": [[4, 1], [4, 2]]}
JSON = st.recursive(st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
                    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
                    max_leaves=8)
FEATURES = st.fixed_dictionaries({
    "type": st.just("Feature"), "id": JSON, "feature_type": st.sampled_from(["unit", "opening", "level", "x"]) | JSON,
    "geometry": st.none() | st.just(SQUARE) | st.just(LINE) | JSON | st.fixed_dictionaries({
        "type": st.sampled_from(["Polygon", "LineString", "Point", "MultiPolygon"]), "coordinates": JSON}),
    "properties": JSON | st.fixed_dictionaries({
        "feature": st.sampled_from(["room", "doorway", "thing", "link"]), "name": JSON, "in": JSON, "between": JSON,
        "floor_m": JSON, "height_m": JSON, "width_m": JSON, "low_m": JSON, "high_m": JSON, "obstacle": JSON,
        "category": JSON, "kind": JSON, "level_id": JSON})})


@MANY
@given(features=st.lists(FEATURES, max_size=5) | st.lists(FEATURES | JSON, max_size=5),
       units=st.sampled_from(["metres", None]))
def test_any_other_file_is_read_or_refused_in_a_sentence(tmp_path: Path, features: list, units: str | None) -> None:
    path = tmp_path / "w.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "units": units, "features": features}), encoding="utf-8")
    try:
        text = import_building(path).text
    except BuildingError as error:
        assert str(error).startswith("w.geojson: ") and "expected" in str(error)
    else:
        assert read_world(Source.parse(text, "w.toml")).rooms


@pytest.mark.parametrize(("text", "told"), [
    ("{", "expected GeoJSON, got what is no JSON"),
    ("[" * 100_000, "expected GeoJSON, got what is no JSON"),
    ("[]", "expected a FeatureCollection with features, got none"),
    ('{"type": "FeatureCollection", "features": []}', "expected features that are rooms .*got none among 0 features"),
    ('{"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": {"type": "MultiPoint", "coordinates": '
     '[[5, 2], [6, 2]]}}]}', "a feature: expected coordinates up to 5000 m, got larger ones"),
    ('{"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": {"type": "Point", "coordinates": '
     '[500, 2]}}]}', "expected longitude and latitude in degrees, .*got coordinates up to 500"),
])
def test_what_is_no_building_is_refused(text: str, told: str, tmp_path: Path,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "w.geojson").write_text(text, encoding="utf-8")
    with pytest.raises(BuildingError, match=told):
        read_plan(tmp_path / "w.geojson")
    assert main(["world", "import", str(tmp_path / "w.geojson"), "--out", str(tmp_path / "out.toml")]) == 2
    assert capsys.readouterr().err.startswith("harvey: w.geojson: ")
