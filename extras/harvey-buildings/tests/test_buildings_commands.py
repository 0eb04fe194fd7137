"""The verbs keep what any command must; formats of other packages are read and written as ours are."""

from pathlib import Path

import pytest

from harvey.cli import main
from harvey_buildings.commands import EXPORT, IMPORT
from seams import check_command

MODULE = """
from harvey_buildings.building_plan import BuildingPlan, Space, Storey
import numpy as np

SQUARE = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 4.0]])

def read(path):
    return BuildingPlan("hut", path.name, [Storey("ground", 0.0)],
                        [Space("hut-room", "room", "Hut", "ground", SQUARE, 0.0, 2.5)])

def write(world, out):
    out.write_text(world.name)
    return "its name"
"""
POINTS = "[harvey.importers]\nhut = hut_format:read\n[harvey.exporters]\nhut = hut_format:write\n"


@pytest.mark.parametrize("verb", [IMPORT, EXPORT], ids=["import", "export"])
def test_a_verb_keeps_what_a_command_must(verb) -> None:
    check_command(verb, "world")


def test_an_unknown_format_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["world", "import", "a.dxf", "--out", "b.toml"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "expected a building file that ends in .geojson, .gml, .ifc" in err
    assert main(["world", "export", "campus", "--to", "a.svg", "--format", "dxf"]) == 2
    assert "expected one of geojson, gltf, rosmap, svg, got 'dxf'" in capsys.readouterr().err


def test_a_format_of_another_package_goes_in_and_out(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "hut_format.py").write_text(MODULE, encoding="utf-8")
    info = tmp_path / "hut_format-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hut-format\nVersion: 0.1\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(POINTS, encoding="utf-8")
    (tmp_path / "my.hut").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    made = tmp_path / "hut.toml"
    assert main(["world", "import", str(tmp_path / "my.hut"), "--out", str(made)]) == 0
    assert "hut-room" in made.read_text(encoding="utf-8")
    assert main(["world", "import", str(tmp_path / "my.hut"), "--out", str(made), "--wall-height", "2.5"]) == 2
    assert main(["world", "export", str(made), "--to", str(tmp_path / "again.hut")]) == 0
    assert (tmp_path / "again.hut").read_text(encoding="utf-8") == "hut"
    assert "again.hut: its name" in capsys.readouterr().out
