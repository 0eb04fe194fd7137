"""The verbs import and export of ``harvey world``: their arguments, their errors, and formats of other packages."""

from __future__ import annotations

import builtins
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from harvey.cli import main
from harvey_buildings.buildings_commands import EXPORT, IMPORT
from seams import check_command
from world_models.building.plan_view import plan_svg
from world_models.files.world_files import WORLDS, load_world

MODULE = """
from harvey_buildings.fitting.building_plan import BuildingPlan, Space, Storey
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


def test_the_plan_is_the_one_that_show_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["world", "export", "research_center", "--to", str(tmp_path / "plan.txt"), "--format", "svg"]) == 0
    assert "9 rooms, 8 open doorways" in capsys.readouterr().out
    assert (tmp_path / "plan.txt").read_text(encoding="utf-8") == plan_svg(load_world(WORLDS / "research_center.toml"))


@pytest.mark.parametrize(("out", "told"), [
    ("missing/plan.svg", "expected a file to write to, got: No such file or directory"),
    ("plan.foo", "expected a name that ends in .yaml, .yml, .svg"),
])
def test_what_cannot_be_written_is_refused(out: str, told: str, tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["world", "export", "research_center", "--to", str(tmp_path / out)]) == 2
    assert told in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_without_trimesh_it_says_what_to_install(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:
    real: Callable[..., Any] = builtins.__import__

    def no_trimesh(name: str, *more: Any) -> Any:
        if name.split(".")[0] == "trimesh":
            raise ModuleNotFoundError(f"No module named {name!r}")
        return real(name, *more)

    monkeypatch.setattr(builtins, "__import__", no_trimesh)
    assert main(["world", "export", "research_center", "--to", str(tmp_path / "w.glb")]) == 2
    assert "glTF needs trimesh: .venv/bin/pip install trimesh" in capsys.readouterr().err
