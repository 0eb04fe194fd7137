"""What an import says of a file that has more, or less, than a world can hold: in words, and by its exit code."""

from __future__ import annotations

import json
import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from ifc_house import House, flat

from harvey.cli import main
from harvey_buildings import BuildingError
from harvey_buildings.fitting.building_plan import BuildingPlan, Space, Storey, Window
from harvey_buildings.fitting.layout import lay_out
from harvey_buildings.formats.ifc import read_ifc
from harvey_buildings.formats.ros_map import read_ros_map
from harvey_buildings.world_text import world_text
from world_models.building.checks import check_world
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world


def write_rooms(path: Path, count: int) -> None:
    """Rooms of 5 by 4 m, 20 m from one another."""
    boxes = [[[x, 0.0], [x + 5.0, 0.0], [x + 5.0, 4.0], [x, 4.0], [x, 0.0]] for x in 20.0 * np.arange(count)]
    features = [{"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [box]},
                 "properties": {"feature": "room", "name": f"room-{n}"}} for n, box in enumerate(boxes)]
    text = json.dumps({"type": "FeatureCollection", "units": "metres", "features": features})
    path.write_text(text, encoding="utf-8")


@pytest.mark.parametrize("floor_m", [0.0, 3.6, -2.9])
@pytest.mark.parametrize(("sill_m", "height_m", "panes", "words"), [
    (0.9, 1.2, 1, ""), (2.6, 0.8, 0, "from 2.60 to 3.40 m"), (2.49, 0.5, 0, "from 2.49 to 2.99 m"),
    (-1.5, 1.0, 0, "from -1.50 to -0.50 m"), (1.0, 2.0, 1, "ends at 2.40 m"),
])
def test_a_window_above_the_ceiling_is_clipped_or_left_out_and_the_world_has_no_faults(
        sill_m: float, height_m: float, panes: int, words: str, floor_m: float) -> None:
    """On whichever storey: all heights are the floor's and as much more."""
    square = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 4.0]])
    plan = BuildingPlan("hut", "hut.ifc", [Storey("ground", floor_m)], [
        Space("den", "room", "den", "ground", square, floor_m, 2.5)])
    plan.windows.append(Window("w", "ground", np.array([2.5, 0.0]), np.array([1.0, 0.0]), 1.2,
                               floor_m + sill_m, height_m))
    layout = lay_out(plan)
    assert len(layout.panes) == panes and words in str(plan.report)
    assert ("window w" in str(plan.report)) == bool(words)
    assert check_world(read_world(Source.parse(world_text(layout)))) == []


def test_rooms_without_a_way_are_exit_code_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    for count, code in ((1, 0), (2, 1)):
        write_rooms(tmp_path / "a.geojson", count)
        assert main(["world", "import", "a.geojson"]) == code
        assert ("none of its 2 rooms has a way to another" in capsys.readouterr().err) == bool(code)


@pytest.mark.parametrize("has_doors", [True, False])
def test_a_map_most_of_whose_rooms_have_no_doorway_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], has_doors: bool,
) -> None:
    """The command line ends with 1 and writes no file."""
    picture = np.zeros((100, 320), np.uint8)
    for first in (10, 110, 210):
        picture[10:90, first : first + 95] = 254
    if has_doors:
        picture[40:58, 10:305] = 254
    (tmp_path / "m.pgm").write_bytes(b"P5 320 100 255\n" + picture.tobytes())
    (tmp_path / "m.yaml").write_text("image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
                                     "occupied_thresh: 0.65\nfree_thresh: 0.196\n", encoding="utf-8")
    if has_doors:
        assert len(read_ros_map(tmp_path / "m.yaml").spaces) == 3
    else:
        with pytest.raises(BuildingError, match="expected a doorway to most rooms, got none to 3 of 3"):
            read_ros_map(tmp_path / "m.yaml")
    made = tmp_path / "m.toml"
    assert main(["world", "import", str(tmp_path / "m.yaml"), "--out", str(made)]) == int(not has_doors)
    assert made.exists() == has_doors
    assert ("got none to 3 of 3" in capsys.readouterr().err) != has_doors


@pytest.mark.skipif(find_spec("ifcopenshell") is None, reason="needs ifcopenshell")
def test_the_reason_of_ifcopenshell_is_told_with_the_entity(tmp_path: Path) -> None:
    file = flat(House("IFC4", "metre")).write(tmp_path / "house.ifc")
    text = file.read_text(encoding="utf-8")
    solid = next(re.finditer(r"(#\d+=IFCEXTRUDEDAREASOLID\([^;]*,)[\d.]+\);", text))
    file.write_text(text.replace(solid[0], f"{solid[1]}0.);"), encoding="utf-8")
    left_out = [line for line in read_ifc(file).report.left_out if "cannot be read" in line]
    assert len(left_out) == 1 and re.match(r"IfcSpace #\d+ ", left_out[0])
    assert "Non-positive extrusion height encountered for IfcExtrudedAreaSolid" in left_out[0]
