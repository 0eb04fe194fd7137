"""harvey world export: files are written and told of; what cannot be is refused in one line, with exit code 2."""

from __future__ import annotations

import builtins
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from harvey.cli import main
from world_models.building.plan_view import plan_svg
from world_models.files.world_files import WORLDS, load_world


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
