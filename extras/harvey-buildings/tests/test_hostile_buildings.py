"""Files made to hurt: each is answered within ten seconds, in one line of at most 300 letters, with exit code 2."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from harvey.errors import MOST_LETTERS
from harvey_buildings import import_building
from harvey_buildings.fitting.building_plan import BuildingError
from harvey_buildings.fitting.layout import MIN_OPENING_M
from harvey_buildings.fitting.polygons import MOST_CROSSINGS, MOST_HOLES, extract_outline, repair

LIMIT_S = 60.0  # a file that would take for ever; a busy machine takes its time
KEYS = "resolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def refuse(file: Path) -> str:
    """The one line by which a file is refused."""
    done = subprocess.run([sys.executable, "-m", "harvey.cli", "world", "import", file.name], cwd=file.parent,
                          capture_output=True, timeout=LIMIT_S, check=False)
    line = done.stderr.decode()
    assert done.returncode == 2 and not done.stdout
    assert line.endswith("\n") and line.count("\n") == 1 and line[:-1].isprintable() and len(line) <= MOST_LETTERS + 1
    return line


def map_of(folder: Path, image: bytes) -> Path:
    (folder / "map.yaml").write_bytes(b"image: " + image + b"\n" + KEYS.encode())
    return folder / "map.yaml"


def room(name: str, x: float, y: float, ring: list[list[float]] | None = None) -> dict[str, Any]:
    ring = ring or [[x, y], [x + 4.0, y], [x + 4.0, y + 3.0], [x, y + 3.0], [x, y]]
    return {"type": "Feature", "id": f"room/{name}", "geometry": {"type": "Polygon", "coordinates": [ring]},
            "properties": {"feature": "room", "name": name}}


def collection(path: Path, features: list[dict[str, Any]]) -> Path:
    path.write_text(json.dumps({"type": "FeatureCollection", "units": "metres", "features": features}))
    return path


def test_a_device_is_not_read(tmp_path: Path) -> None:
    assert "no regular file" in refuse(map_of(tmp_path, b"/dev/zero"))


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.pgm")
    assert "no regular file" in refuse(map_of(tmp_path, b"pipe.pgm"))
    os.mkfifo(tmp_path / "pipe.geojson")
    assert "expected a building file" in refuse(tmp_path / "pipe.geojson")


@pytest.mark.parametrize("image", [b"\x1b[31mred\x07.pgm", b"a\0b.pgm", b"a" * 5000 + b".pgm", b"a " * 50_000])
def test_names_come_to_the_terminal_short_and_printable(tmp_path: Path, image: bytes) -> None:
    refuse(map_of(tmp_path, image))


def test_of_a_file_that_is_no_picture_nothing_is_shown(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(b"root:*:20000")
    assert "root" not in refuse(map_of(tmp_path, str(tmp_path / "secret").encode())).replace("/root", "")


def test_a_checkerboard_is_no_plan_of_rooms(tmp_path: Path) -> None:
    cells = (np.indices((2000, 2000)).sum(axis=0) % 2 * 254).astype(np.uint8)
    (tmp_path / "map.pgm").write_bytes(b"P5\n2000 2000\n255\n" + cells.tobytes())
    assert "pieces" in refuse(map_of(tmp_path, b"map.pgm"))


def test_a_ring_that_crosses_itself_thousands_of_times_is_no_room(tmp_path: Path) -> None:
    ring = np.random.default_rng(0).uniform(0.0, 20.0, (600, 2)).tolist()
    assert "cross" in refuse(collection(tmp_path / "r.geojson", [room("tangle", 0.0, 0.0, [*ring, ring[0]])]))


@given(st.integers(3, 40), st.integers(0, 2**32 - 1))
def test_what_crosses_itself_seldom_is_repaired(corners: int, seed: int) -> None:
    shape = shapely.Polygon(np.random.default_rng(seed).uniform(0.0, 20.0, (corners, 2)))
    repaired = repair(shape)
    assert repaired.is_valid
    if corners * (corners - 3) / 2 <= MOST_CROSSINGS:
        assert repaired.equals(shapely.make_valid(shape))


@pytest.mark.parametrize(("count", "is_kept"), [(MOST_HOLES, True), (MOST_HOLES + 1, False)])
def test_a_room_has_only_so_many_holes(count: int, is_kept: bool) -> None:
    holes = [np.asarray(shapely.box(x, 1.0, x + 1.0, 2.0).exterior.coords) for x in 1.0 + 2.0 * np.arange(count)]
    hall = shapely.Polygon(np.asarray(shapely.box(0.0, 0.0, 2.0 * count + 2.0, 9.0).exterior.coords), holes)
    assert (extract_outline(hall, is_simplified=True) is not None) == is_kept


@given(st.floats(1e-12, 1.5))
def test_an_opening_of_any_width_is_placed_or_told(tmp_path_factory: pytest.TempPathFactory, width: float) -> None:
    line = {"type": "LineString", "coordinates": [[4.05, 1.0], [4.05, 1.0 + width]]}
    way = {"type": "Feature", "id": "d", "geometry": line, "properties": {"feature": "opening", "name": "way"}}
    path = collection(tmp_path_factory.mktemp("w") / "w.geojson", [room("a", 0.0, 0.0), room("b", 4.1, 0.0), way])
    made = import_building(path)
    assert bool(made.layout.cuts) == (1.0 + width - 1.0 >= MIN_OPENING_M)
    assert bool(made.layout.cuts) or any(line.startswith("way: narrower") for line in made.report.left_out)


def test_a_large_building_shows_how_far_it_is(tmp_path: Path) -> None:
    told: dict[str, int] = {}

    def watched(items: Any, what: str) -> Any:
        told[what] = len(items)
        return items

    import_building(collection(tmp_path / "r.geojson", [room(f"r{i}", 4.2 * (i % 40), 3.2 * (i // 40))
                                                        for i in range(1000)]), watched=watched)
    assert told == {"rooms read": 1000, "rooms kept apart": 1000, "openings placed": 0}


def test_a_report_has_short_printable_lines(tmp_path: Path) -> None:
    features = [room("a", 0.0, 0.0), room("\x1b[31m" + "b" * 5000, 0.0, 0.0, [[0.0, 0.0]] * 4)]
    report = str(import_building(collection(tmp_path / "r.geojson", features)).report)
    assert all(line.isprintable() and len(line) <= MOST_LETTERS + 2 for line in report.split("\n"))


def test_a_yaml_that_is_too_large_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BuildingError, match="more than 100000 bytes"):
        import_building(map_of(tmp_path, b"a" * 100_000))
