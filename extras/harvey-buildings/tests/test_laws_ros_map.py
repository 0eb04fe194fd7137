"""Laws of a ROS map: its cells and rooms are where the map server puts them, and what cannot be read is told."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from harvey.cli import main
from harvey_buildings import BuildingError, import_building, read_plan
from harvey_buildings.experiments.scanned_map import ScanNoise, write_floor_map
from harvey_buildings.formats.ros_map import find_wall_turn, make_grid
from harvey_buildings.formats.ros_map_file import FREE, OCCUPIED, UNKNOWN, MapFile, read_cells, read_map_yaml
from world_models.building.checks import check_world
from world_models.building.world import World
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

PICTURES = arrays(np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12)))
MANY = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
FEW = settings(MANY, max_examples=15)


def write_map(folder: Path, picture: np.ndarray, kind: str = "P5", **keys: object) -> Path:
    """A map.yaml with its picture, as P2, P5 or png."""
    rows, columns = picture.shape
    name = "m.png" if kind == "png" else "m.pgm"
    if kind == "png":
        cv2.imwrite(str(folder / name), picture)
    elif kind == "P5":
        (folder / name).write_bytes(f"P5 {columns} {rows} 255\n".encode() + picture.tobytes())
    else:
        (folder / name).write_text(f"P2\n# by hand\n{columns} {rows}\n255\n"
                                   + "\n".join(" ".join(map(str, row)) for row in picture.tolist()) + "\n")
    lines = {"image": name, "resolution": 0.05, "origin": "[0, 0, 0]", **keys}
    (folder / "m.yaml").write_text("".join(f"{key}: {value}\n" for key, value in lines.items()))
    return folder / "m.yaml"


def cells_of(path: Path) -> np.ndarray:
    return read_cells(read_map_yaml(path))


@MANY
@given(picture=PICTURES, free=st.floats(0.0, 0.45), occupied=st.floats(0.5, 1.0), negate=st.booleans())
def test_cells_are_those_of_the_map_server_in_each_format(
    tmp_path: Path, picture: np.ndarray, free: float, occupied: float, negate: bool,
) -> None:
    keys = {"free_thresh": free, "occupied_thresh": occupied, "negate": int(negate)}
    p = picture / 255.0 if negate else (255.0 - picture) / 255.0
    near = (np.abs(p - free) < 1e-6) | (np.abs(p - occupied) < 1e-6)
    expected = np.where(p < free, FREE, np.where(p > occupied, OCCUPIED, UNKNOWN))
    expected[picture == (50 if negate else 205)] = UNKNOWN  # what savers write for it
    for kind in ("P2", "P5", "png"):
        cells = cells_of(write_map(tmp_path, picture, kind, **keys))
        assert (cells == expected)[~near].all()


@pytest.mark.parametrize(("mode", "negate"), [("trinary", "no"), ("trinary", "on"), ("scale", "0")])
def test_what_nav2_saves_as_unknown_stays_unknown(tmp_path: Path, mode: str, negate: str) -> None:
    """Its saver's free_thresh of 0.25 is above the occupancy of its grey of unknown: 50 of 255."""
    picture = np.full((60, 120), 205, np.uint8)
    for left in (10, 61):
        picture[10:50, left : left + 49] = 0
        picture[12:48, left + 2 : left + 47] = 254
    picture[20:38, 57:63] = 254
    path = write_map(tmp_path, 255 - picture if negate == "on" else picture, mode=mode, negate=negate,
                     occupied_thresh=0.65, free_thresh=0.25)
    assert ((cells_of(path) == UNKNOWN) == (picture == 205)).all()
    plan, _ = read_plan(path)
    assert len(plan.spaces) == 2 and len(plan.openings) == 1 and "205 are" in str(plan.report).replace(" 50 ", " 205 ")


def test_a_pixel_of_scale_that_is_not_quite_opaque_is_unknown(tmp_path: Path) -> None:
    path = write_map(tmp_path, np.full((2, 2), 254, np.uint8), "png", mode="scale")
    alpha = np.array([[255, 250], [0, 255]], np.uint8)
    cv2.imwrite(str(tmp_path / "m.png"), np.dstack([np.full((2, 2, 3), 254, np.uint8), alpha]))
    assert cells_of(path).tolist() == [[FREE, UNKNOWN], [UNKNOWN, FREE]]


@MANY
@given(picture=PICTURES)
def test_raw_cells_are_percents(tmp_path: Path, picture: np.ndarray) -> None:
    expected = np.where(picture > 100, UNKNOWN, np.where(picture < 20, FREE, np.where(picture > 65, OCCUPIED, UNKNOWN)))
    for kind in ("P5", "png"):
        assert (cells_of(write_map(tmp_path, picture, kind, mode="raw")) == expected).all()


@MANY
@given(turn_deg=st.floats(-44.0, 44.0), x=st.floats(-50, 50), y=st.floats(-50, 50), yaw=st.floats(-3.0, 3.0))
def test_a_cell_of_the_grid_is_where_the_map_server_puts_it(turn_deg: float, x: float, y: float, yaw: float) -> None:
    """A mark in a turned picture: its place in the grid, mapped back, is its place in the map's frame."""
    cells = np.full((120, 150), UNKNOWN)
    rows, columns = np.mgrid[:120, :150]
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    along, across = c * (columns - 75) - s * (rows - 60), s * (columns - 75) + c * (rows - 60)
    inside = (np.abs(along) < 40) & (np.abs(across) < 25)
    cells[inside] = OCCUPIED
    cells[(np.abs(along) < 38) & (np.abs(across) < 23)] = FREE
    grid = make_grid(cells, MapFile(Path("m.pgm"), 0.1, (x, y, yaw), False, 0.65, 0.196, "trinary"))
    middle = np.argwhere(grid.cells == FREE).mean(axis=0)
    true = np.argwhere(cells == FREE).mean(axis=0)
    flat = np.array([(true[1] + 0.5) * 0.1, (120 - 0.5 - true[0]) * 0.1])
    turned = np.array([math.cos(yaw) * flat[0] - math.sin(yaw) * flat[1],
                       math.sin(yaw) * flat[0] + math.cos(yaw) * flat[1]])
    assert grid.to_map(middle[None])[0] == pytest.approx(turned + np.array([x, y]), abs=0.1)
    assert math.degrees(find_wall_turn(cells)) == pytest.approx(turn_deg, abs=2.0)


def two_rooms(width: float, depth: float, other: float, door: float, wall: float, at: float) -> World:
    """Two rooms beside one another with an open door, as a world file."""
    along = door / 2 + 0.5 + at * (depth - door - 1.0)
    return read_world(Source.parse(f"""
name = "two"
units = "metres"
[finishes]
plain = {{ colour = [0.6, 0.6, 0.6] }}
[defaults]
height = 2.6
walls = "plain"
baseboard = "plain"
frame = "plain"
[locales.a]
kind = "room"
size = [{width}, {depth}]
[locales.b]
kind = "room"
at = [{width + wall}, 0]
size = [{other}, {depth}]
[doors]
d = {{ between = ["a", "b"], wall = "east", along = {along}, width = {door}, open = true }}
""", "two"))


def traced(path: Path, wall_height_m: float | None = None) -> World:
    return read_world(Source.parse(import_building(path, wall_height_m).text, "traced"))


def test_rooms_and_their_door_are_traced_where_they_are(tmp_path: Path) -> None:
    """Of 510 maps drawn so, 6 were traced otherwise: no door was found, or one too wide. None had a fault."""
    rng = np.random.default_rng(0)
    low, high = [2.5, 2.5, 2.5, 0.8, 0.15, 0.0], [6.0, 5.0, 6.0, 1.2, 0.4, 1.0]
    draws = [two_rooms(*rng.uniform(low, high)) for _ in range(60)]
    right = [is_traced(tmp_path, world, ScanNoise(rough=0.05, turn_rad=float(rng.uniform(-0.7, 0.7))), rng)
             for world in draws]
    assert sum(right) >= 57


def is_traced(folder: Path, world: World, noise: ScanNoise, rng: np.random.Generator) -> bool:
    """Whether a map of two rooms gives both, and the door between them where it is and as wide."""
    made = traced(write_floor_map(folder, world, noise, rng), 3.1)
    assert check_world(made) == []
    rooms, others = ([shapely.Polygon(one.outline(room)) for room in one.rooms] for one in (world, made))
    overlaps = [max(other.intersection(room).area / other.union(room).area for other in others) for room in rooms]
    (expected,) = world.doorways
    return len(others) == 2 and min(overlaps) > 0.88 and len(made.doorways) == 1 and all(
        doorway.centre_world == pytest.approx(expected.centre_world, abs=0.15)
        and doorway.width_m == pytest.approx(expected.width_m, abs=0.3) for doorway in made.doorways)


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 10_000), size=st.integers(20, 90), boxes=st.integers(0, 12))
def test_any_picture_becomes_a_world_without_faults_or_one_sentence(
    tmp_path: Path, seed: int, size: int, boxes: int,
) -> None:
    """Free boxes laid over one another at random, with walls drawn across them."""
    rng = np.random.default_rng(seed)
    picture = np.full((size, size), 205, np.uint8)
    for _ in range(boxes):
        (r, c), (h, w) = rng.integers(0, size, 2), rng.integers(3, 50, 2)
        picture[r : r + h, c : c + w] = 0
        picture[r + 1 : r + h - 1, c + 1 : c + w - 1] = 254
    path = write_map(tmp_path, picture, resolution=0.1)
    try:
        made = traced(path)
    except BuildingError as error:
        assert "expected" in str(error) and "m.p" in str(error)
        return
    assert check_world(made) == []
    assert len(made.rooms) > 0


GOOD = {"image": "m.pgm", "resolution": "0.05", "origin": "[0, 0, 0]", "negate": "0", "occupied_thresh": "0.65",
        "free_thresh": "0.196"}
FRAME = np.pad(np.full((60, 80), 254, np.uint8), 4, constant_values=0)


def write(folder: Path, picture: bytes | None = None, drop: str = "", name: str = "m.pgm", **changed: str) -> Path:
    lines = {**GOOD, "image": name, **changed}
    (folder / "m.yaml").write_text("".join(f"{k}: {v}\n" for k, v in lines.items() if k != drop))
    if picture is not None:
        (folder / name).write_bytes(picture)
    return folder / "m.yaml"


def pgm(picture: np.ndarray) -> bytes:
    return f"P5 {picture.shape[1]} {picture.shape[0]} 255\n".encode() + picture.tobytes()


def png(picture: np.ndarray) -> bytes:
    return cv2.imencode(".png", picture)[1].tobytes()


def said(capsys: pytest.CaptureFixture[str], *argv: str) -> tuple[int, str]:
    try:
        code = main(["world", "import", *argv])
    except SystemExit as stop:
        code = int(stop.code or 0)
    return code, capsys.readouterr().err


@pytest.mark.parametrize(("changed", "names"), [
    ({"drop": "image"}, "m.yaml: expected a line 'image"),
    ({"drop": "resolution"}, "m.yaml: expected a line 'resolution"),
    ({"drop": "origin"}, "m.yaml: expected a line 'origin"),
    ({"resolution": "0"}, "m.yaml:2: expected a resolution"),
    ({"resolution": "nan"}, "m.yaml:2: expected a finite number"),
    ({"resolution": "five"}, "m.yaml:2: expected a number for resolution"),
    ({"origin": "[0, 0]"}, "m.yaml:3: expected origin: [x, y, yaw]"),
    ({"negate": "maybe"}, "m.yaml:4: expected negate 0 or 1"),
    ({"free_thresh": "0.9"}, "expected free_thresh below occupied_thresh"),
    ({"occupied_thresh": "65"}, "m.yaml:5: expected occupied_thresh from 0 to 1"),
    ({"mode": "colour"}, "expected mode trinary, scale, raw"),
    ({"picture": None}, "m.pgm: expected the picture that the map.yaml names"),
    ({"picture": b""}, "m.pgm: expected a picture as PGM"),
    ({"picture": pgm(FRAME)[:-9]}, "m.pgm: expected 88 x 68 cells"),
    ({"picture": b"P2 3 2 255\n1 2 x 4 5 6"}, "m.pgm: expected a plain PGM of numbers"),
    ({"picture": b"P5 0 2 255\n"}, "m.pgm: expected 1 to"),
    ({"picture": b"P5 3"}, "m.pgm: expected the width, height"),
    ({"picture": b"GIF89a and so on, for a while more"}, "m.pgm: expected a picture as PGM"),
    ({"name": "m.png", "picture": png(FRAME)[:-40]}, "m.png: expected a whole PNG"),
    ({"name": "m.png", "picture": png(FRAME)[:40] + b"\0" * 60 + png(FRAME)[100:]}, "m.png: expected a picture"),
    ({"picture": pgm(np.full((40, 40), 205, np.uint8))}, "m.pgm: expected free and occupied cells, got no free one"),
    ({"picture": pgm(np.full((40, 40), 254, np.uint8))}, "got no occupied one"),
    ({"picture": pgm(np.pad(np.full((4, 4), 254, np.uint8), 2))}, "m.pgm: expected a room of 1.5 m2"),
])
def test_a_map_that_cannot_be_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changed: dict[str, Any], names: str,
) -> None:
    path = write(tmp_path, **{"picture": pgm(FRAME), **changed})
    code, text = said(capsys, str(path), "--out", str(tmp_path / "m.toml"))
    assert code == 2
    assert names in text
    assert "Traceback" not in text


def test_a_picture_alone_is_told_how_to_write_its_map_yaml(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, pgm(FRAME))
    code, text = said(capsys, str(tmp_path / "m.pgm"))
    assert code == 2
    assert "Write m.yaml beside it" in text and "resolution: 0.05" in text


@pytest.mark.parametrize("height", ["0.2", "300", "nan"])
def test_a_wall_height_out_of_range(tmp_path: Path, capsys: pytest.CaptureFixture[str], height: str) -> None:
    code, text = said(capsys, str(write(tmp_path, pgm(FRAME))), "--out", str(tmp_path / "m.toml"),
                      "--wall-height", height)
    assert code == 2
    assert "--wall-height: expected" in text


def test_walls_have_the_height_that_is_asked_for(tmp_path: Path) -> None:
    assert main(["world", "import", str(write(tmp_path, pgm(FRAME))), "--out", str(tmp_path / "m.toml"),
                 "--wall-height", "3.25"]) == 0
    assert "height = 3.25" in (tmp_path / "m.toml").read_text()
