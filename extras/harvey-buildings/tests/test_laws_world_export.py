"""The laws of exported worlds: read back they have the world's areas, doorways, surfaces and colours."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from harvey_buildings import import_building
from harvey_buildings.exporters import ExportError, export_world
from harvey_buildings.formats.geojson import FRAME
from harvey_buildings.formats.ros_map_file import FREE, OCCUPIED, read_cells, read_map_yaml
from world_models.building.geometry.faces import area_vector
from world_models.building.plan_view import find_storeys
from world_models.building.world import World
from world_models.files.first_world import first_world_text
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world

STOREYS = (("research_center", 1), ("typical_floor", 1), ("campus", 2))
SOME = settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
ROOMS = st.lists(st.sampled_from(["office", "library", "kitchen", "lab", "store", "studio"]), min_size=2, max_size=5,
                 unique=True)


def shipped(name: str) -> World:
    return load_world(WORLDS / f"{name}.toml")


def made(rooms: list[str]) -> World:
    return read_world(Source.parse(first_world_text("made", rooms), "made.toml"))


def read_text(text: str) -> World:
    return read_world(Source.parse(text, "again.toml"))


def assert_same_plan(world: World, rooms: list[str], again: World, cell_m: float) -> None:
    """Each room is found once, its area to a cell along its walls; each doorway where it is."""
    found = {name: shapely.Polygon(again.outline(name)) for name in again.rooms}
    twins = {}
    for room in rooms:
        shape = shapely.Polygon(world.outline(room))
        twins[room] = max(found, key=lambda name: found[name].intersection(shape).area)
        assert abs(found[twins[room]].area - shape.area) < shape.length * cell_m, room
        assert found[twins[room]].symmetric_difference(shape).area < shape.length * cell_m, room
    assert len(set(twins.values())) == len(rooms) == len(found)
    doors = {door.name: door for room in rooms for door in world.doorways_of(room)}
    assert len(again.doorways) == len(doors)
    for door in doors.values():
        pair = {twins[room] for room in door.between}
        near = [d for d in again.doorways if set(d.between) == pair]
        apart = [float(np.linalg.norm(d.centre_world - door.centre_world)) for d in near]
        assert apart and min(apart) < 2 * cell_m
        assert abs(near[int(np.argmin(apart))].width_m - door.width_m) < 4 * cell_m


@pytest.mark.parametrize(("name", "storey"), STOREYS)
def test_a_ros_map_imported_again_has_the_same_rooms_and_doorways(name: str, storey: int, tmp_path: Path) -> None:
    world = shipped(name)
    export_world(world, tmp_path / "map.yaml", storey=storey, with_things=False)
    again = read_text(import_building(tmp_path / "map.yaml").text)
    assert_same_plan(world, find_storeys(world)[storey - 1][1], again, 0.05)


@SOME
@given(rooms=ROOMS, cell_m=st.sampled_from([0.02, 0.03, 0.05]))
def test_so_does_that_of_any_first_world_at_any_resolution(tmp_path: Path, rooms: list[str], cell_m: float) -> None:
    world = made(rooms)
    export_world(world, tmp_path / "map.yml", resolution_m=cell_m, with_things=False)
    again = read_text(import_building(tmp_path / "map.yml").text)
    assert_same_plan(world, list(world.rooms), again, cell_m)


@pytest.mark.parametrize("with_things", [True, False])
def test_a_cell_is_free_inside_occupied_on_walls_and_things_and_unknown_behind(tmp_path: Path, with_things: bool,
                                                                               ) -> None:
    world = shipped("research_center")
    export_world(world, tmp_path / "map.yaml", "rosmap", resolution_m=0.1, with_things=with_things)
    file = read_map_yaml(tmp_path / "map.yaml")
    cells = read_cells(file)[::-1]
    x, y = (file.origin[axis] + 0.1 * (np.arange(cells.shape[1 - axis]) + 0.5) for axis in (0, 1))
    points = shapely.points(*np.meshgrid(x, y))
    inside = shapely.union_all([shapely.Polygon(world.outline(r)) for r in world.rooms]
                               + [shapely.Polygon(d.thresholds_world.reshape(-1, 2)) for d in world.doorways])
    solid = shapely.union_all([shapely.Polygon(foot) for room in world.rooms for foot in world.obstacles(room)])
    to_floor, to_solid = shapely.distance(points, inside), shapely.distance(points, solid)
    deep = shapely.distance(points, inside.boundary) > 0.1
    is_thing = (to_solid == 0) & with_things
    assert (cells[deep & (to_floor == 0) & (is_thing)] == OCCUPIED).all()
    assert (cells[deep & (to_floor == 0) & ~is_thing] == FREE).all()
    assert not (cells[to_floor > 0.02] == FREE).any()
    assert not (cells[to_floor > 0.25] == OCCUPIED).any()
    beside = (to_floor > 0.02) & (to_floor < 0.04)
    assert beside.any() and (cells[beside] == OCCUPIED).all()


@pytest.mark.parametrize("name", ["research_center", "campus"])
def test_geojson_has_the_worlds_areas_and_everything_in_it(name: str, tmp_path: Path) -> None:
    world = shipped(name)
    export_world(world, tmp_path / "w.geojson")
    assert_geojson_is(json.loads((tmp_path / "w.geojson").read_text(encoding="utf-8")), world)


@SOME
@given(rooms=ROOMS)
def test_so_it_does_for_any_first_world(tmp_path: Path, rooms: list[str]) -> None:
    export_world(made(rooms), tmp_path / "w.json")
    assert_geojson_is(json.loads((tmp_path / "w.json").read_text(encoding="utf-8")), made(rooms))


def assert_geojson_is(told: dict, world: World) -> None:
    assert (told["type"], told["frame"], told["units"]) == ("FeatureCollection", FRAME, "metres")
    by_kind: dict[str, dict[str, tuple[shapely.Geometry, dict]]] = {}
    for feature in told["features"]:
        kind, shape = feature["properties"]["feature"], shapely.from_geojson(json.dumps(feature["geometry"]))
        assert shape.is_valid and (kind == "link" or shape.exterior.is_ccw)
        by_kind.setdefault(kind, {})[feature["properties"]["name"]] = shape, feature["properties"]
    assert set(by_kind["room"]) == set(world.rooms)
    for room, (shape, more) in by_kind["room"].items():
        area_m2 = shapely.Polygon(world.outline(room)).area
        assert shape.area == pytest.approx(area_m2, abs=1e-3) and more["area_m2"] == pytest.approx(area_m2, abs=1e-3)
        assert more["floor_m"] == pytest.approx(world.floor_m(room), abs=1e-4)
    assert set(by_kind["doorway"]) == {door.name for door in world.doorways}
    for door in world.doorways:
        shape, more = by_kind["doorway"][door.name]
        assert shape.area == pytest.approx(door.width_m * door.depth_m, abs=1e-3)
        assert more["between"] == list(door.between) and more["width_m"] == pytest.approx(door.width_m, abs=1e-4)
    told_in = {name: more["in"] for name, (_, more) in by_kind["thing"].items()}
    assert told_in == {thing.name: thing.locale for thing in world.things}
    assert set(by_kind.get("link", {})) == {link.name for link in world.links}


@pytest.mark.parametrize("ending", [".glb", ".gltf"])
@pytest.mark.parametrize("name", ["research_center", "campus"])
def test_gltf_read_by_another_library_has_the_worlds_surfaces(name: str, ending: str, tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    pygltflib = pytest.importorskip("pygltflib")
    world = shipped(name)
    export_world(world, tmp_path / f"w{ending}")
    triangles, colours = read_triangles(pygltflib.GLTF2().load(str(tmp_path / f"w{ending}")))
    own = triangles @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # y up to z up
    normals = np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0]) / 2
    regions = [region for face in world.faces for region in (*face.front, *face.back)]
    areas = np.array([area_vector(region.polygon_world) for region in regions])
    assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(np.linalg.norm(areas, axis=1).sum(), rel=1e-4)
    for sign in (1.0, -1.0):  # each is seen from its front
        assert (np.clip(sign * normals, 0, None).sum(axis=0)
                == pytest.approx(np.clip(sign * areas, 0, None).sum(axis=0), rel=1e-3, abs=1e-3))
    corners = np.concatenate([region.polygon_world for region in regions])
    for end in ("min", "max"):
        assert getattr(own.reshape(-1, 3), end)(axis=0) == pytest.approx(getattr(corners, end)(axis=0), abs=1e-4)
    expected = {tuple(round(255 * c) for c in region.colour) for region in regions if not math.isnan(region.colour[0])}
    assert expected <= {tuple(np.round(255 * srgb(colour)).astype(int).tolist()) for colour in colours}


def read_triangles(file) -> tuple[np.ndarray, list[np.ndarray]]:
    """(t, 3, 3) corners of all triangles, nodes applied, and the linear colours of the materials."""
    def rows(index: int) -> np.ndarray:
        accessor = file.accessors[index]
        view = file.bufferViews[accessor.bufferView]
        data = file.get_data_from_buffer_uri(file.buffers[view.buffer].uri) if file.buffers[view.buffer].uri else (
            file.binary_blob())
        kind = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}[accessor.componentType]
        width = {"SCALAR": 1, "VEC3": 3}[accessor.type]
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        return np.frombuffer(data, kind, accessor.count * width, start).reshape(-1, width)

    assert all(node.matrix in (None, np.eye(4).ravel().tolist()) and node.translation is None and node.rotation is None
               for node in file.nodes)
    parts = [rows(p.attributes.POSITION)[rows(p.indices).ravel()].reshape(-1, 3, 3).astype(float)
             for node in file.nodes if node.mesh is not None for p in file.meshes[node.mesh].primitives]
    return np.concatenate(parts), [np.array(m.pbrMetallicRoughness.baseColorFactor[:3]) for m in file.materials]


def srgb(linear: np.ndarray) -> np.ndarray:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055)


@pytest.mark.parametrize(("out", "more", "told"), [
    ("w.foo", {}, "expected a name that ends in .yaml"),
    ("w.pgm", {"kind": "rosmap"}, "expected the name of the map's .yaml"),
    ("w.yaml", {}, "has one and campus has 4 .1: floor at 0.00 m"),
    ("w.yaml", {"storey": 5}, "expected a storey of campus .*got 5"),
    ("w.yaml", {"storey": 1, "resolution_m": math.nan}, "expected a resolution of 0.005 to 0.5 metres a cell, got nan"),
    ("w.svg", {"storey": 1}, "told of a ROS map only, got svg"),
])
def test_what_cannot_be_written_is_told_in_a_sentence_and_nothing_is(
    out: str, more: dict, told: str, tmp_path: Path,
) -> None:
    with pytest.raises(ExportError, match=told):
        export_world(shipped("campus"), tmp_path / out, **more)
    assert not list(tmp_path.iterdir())
