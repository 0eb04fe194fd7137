"""The laws of GeoJSON as a building file: a world written and read again has the same plan; IMDF has it to the cm."""

from __future__ import annotations

import json
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
