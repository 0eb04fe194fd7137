"""The report of a mission: in one file, and the same each time. ``tests/browser/`` opens it."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from harvey.report.page import build_page
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from recorded_runs import Recorded
from report_contents import read_contents
from world_models.entries import CameraPicture


@pytest.fixture(scope="module")
def run(recorded: Recorded) -> RunDirectory:
    return recorded("kidnap")


@pytest.fixture(scope="module")
def page(run: RunDirectory) -> str:
    return build_page(run, Timeline(run.journal))


def test_it_asks_the_network_for_nothing(page: str) -> None:
    assert set(re.findall(r"https?://[^\"' <)]+", page)) <= {
        "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert "default-src 'none'" in page
    assert not re.search(r"<(link|iframe|object|embed)\b|@import|src=\"(?!data:)", page)


def test_it_holds_the_run(page: str, run: RunDirectory) -> None:
    history, data = Timeline(run.journal), read_contents(page)
    assert [one["cycle"] for one in data["cycles"]] == list(history.cycles)
    assert data["entries"].keys() == set(history.refs)
    assert all(set(entry["because"]) <= data["entries"].keys() for entry in data["entries"].values())
    assert len(data["pictures"]) == len([*history.of_kind(CameraPicture)])
    judged = [one for one in data["pictures"] if "expected" in one]
    assert judged and all(len(line) == 4 for one in judged for line in (*one["expected"], *one["agreed"]))
    assert data["candidates"] and data["track"] and data["plans"][0]["rooms"]
    assert len(page) < 5e6


def test_it_is_the_same_each_time(page: str, run: RunDirectory) -> None:
    assert build_page(run, Timeline(run.journal)) == page


def test_without_the_recording_it_tells_no_truth(run: RunDirectory, tmp_path: Path) -> None:
    shutil.copytree(run.path, tmp_path / "run")
    bare = RunDirectory(tmp_path / "run")
    bare.recording.unlink()
    data = read_contents(build_page(bare, Timeline(bare.journal)))
    assert data["track"] == [] and data["errors"] == [] and data["beliefs"]

