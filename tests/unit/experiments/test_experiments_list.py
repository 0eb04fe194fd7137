"""The list of experiments: complete, in order, in lines that fit a terminal."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import experiments
from experiments.report import Report
from harvey.cli import main
from harvey.errors import BadInput
from world_models import plugins
from world_models.plugins import EXTRAS

FOLDER = Path(experiments.__file__).parent
RUN = re.compile(r"^def run\(quick: bool", re.MULTILINE)


def test_every_experiment_is_listed_in_its_folder_in_alphabetical_order() -> None:
    assert list(experiments.EXPERIMENTS) == sorted(experiments.EXPERIMENTS)
    for folder, group in experiments.EXPERIMENTS.items():
        files = [path for path in (FOLDER / folder).glob("*.py") if RUN.search(path.read_text("utf-8"))]
        here = [name for name in group if name not in EXTRAS[experiments.GROUP]]
        assert here == sorted(path.stem.replace("_", "-") for path in files) and list(group) == sorted(group)


@pytest.mark.parametrize("name", EXTRAS[experiments.GROUP])
def test_an_experiment_of_an_extra_that_is_not_installed_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda **_: ())
    assert name in experiments.list_names()
    with pytest.raises(BadInput, match=f"experiment {name} needs harvey-.*: pip install ./extras/harvey-"):
        experiments.run(name, quick=True)


def test_the_list_fits_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.split("experiments: differences")[1].splitlines()
    summaries = [line for line in lines if line.startswith("  ")]
    assert len(summaries) == len(experiments.list_names()), "one line each"
    assert max(map(len, summaries)) <= 80


def test_help_names_every_experiment(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["experiment", "--help"]) == 0
    told = capsys.readouterr().out
    assert [name for name in experiments.list_names() if name not in told] == []
    assert "--quick" in told and "claims" in told and "runs/experiments" in told


def test_another_package_adds_an_experiment(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(quick: bool, seed: int) -> Report:
        return Report("Of another package", ("what", "ours"), ((f"quick {quick}", seed),))

    point = SimpleNamespace(name="mine", value="mine:run", group=experiments.GROUP, dist=None, load=lambda: run)
    monkeypatch.setattr(plugins, "entry_points", lambda **_: (point,))
    assert "mine" in experiments.list_names()
    assert experiments.run("mine", quick=True, seed=7).rows == (("quick True", 7),)
    with pytest.raises(BadInput, match="mine has no number of missions"):
        experiments.run("mine", missions=3)
