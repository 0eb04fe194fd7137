"""The ledger: the order of runs does not matter, a run twice counts once, nothing of an exact model is off."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from harvey.cli import main
from harvey.errors import BadInput
from harvey_survey.ledger import Ledger, is_sure, read_ledger
from logs.run_directory import RunDirectory
from world_models.files.world_files import WORLDS, load_world

WORLD = WORLDS / "research_center.toml"
NAMES = ("office", "bump", "kidnap")


@pytest.fixture(scope="module")
def runs(recorded: Any) -> list[RunDirectory]:
    return [recorded(name) for name in NAMES]


@pytest.fixture(scope="module")
def ledger(runs: list[RunDirectory]) -> Ledger:
    return read_ledger(load_world(WORLD), WORLD, runs)


def test_order_and_repetition_do_not_matter(runs: list[RunDirectory], ledger: Ledger, tmp_path: Path) -> None:
    copy = RunDirectory(tmp_path / "copy")
    shutil.copytree(runs[1].path, copy.path)
    assert read_ledger(load_world(WORLD), WORLD, [copy, *reversed(runs), runs[0]]) == ledger
    assert len(ledger.runs) == len(runs)


def test_counts_add_up(ledger: Ledger) -> None:
    for element in ledger.elements:
        for part in (element.by_light.values(), element.by_distance.values(), [line.counts for line in element.lines]):
            counted = list(part)
            assert sum(c.expected for c in counted) == element.counts.expected
            assert sum(c.found for c in counted) == element.counts.found
        assert element.counts.missing >= 0 and 0 <= element.unseen <= element.pictures <= ledger.looks


def test_exact_model_is_not_off(ledger: Ledger) -> None:
    assert sum(e.counts.found for e in ledger.elements) > 0.8 * sum(e.counts.expected for e in ledger.elements)
    far = [offset for offset in ledger.offsets if is_sure(offset) and abs(offset.mean_m) > 0.01]
    assert ledger.offsets and far == []


def test_run_of_another_world_is_refused(runs: list[RunDirectory]) -> None:
    other = WORLDS / "two_ways.toml"
    with pytest.raises(BadInput, match=r"expected a run with the world file .*two_ways\.toml"):
        read_ledger(load_world(other), other, runs[:1])


def test_command(runs: list[RunDirectory], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan, out = tmp_path / "plan.svg", tmp_path / "ledger.json"
    names = [str(run.path) for run in runs]
    assert main(["world", "ledger", "research_center", *names, "--plan", str(plan), "--json", str(out)]) == 0
    table = capsys.readouterr().out
    assert "3 runs" in table and "allens-office wall" in table and "allens-office/desk" in table
    assert plan.read_text("utf-8").startswith("<?xml") and "<svg" in plan.read_text("utf-8")
    assert len(json.loads(out.read_text("utf-8"))["elements"]) > 5
    assert main(["world", "ledger", "research_center", *names, "--plan", "plan.bmp"]) == 2
    assert "--plan: expected a name that ends in .png, .svg, .pdf, got 'plan.bmp'" in capsys.readouterr().err
    assert main(["world", "ledger", "research_center", *names, "--json", str(tmp_path / "no" / "out")]) == 2
    assert "--json" in capsys.readouterr().err
