"""What other programs get of a run: times in every table, properties of its recording."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from rerun.chunk import RrdReader

from harvey.cli import main


@pytest.fixture
def office(recorded: Any) -> Path:
    path: Path = recorded("office").path
    return path


def read_properties(recording: Path) -> Mapping[str, Any]:
    """The properties that Harvey gives a recording."""
    found: dict[str, Any] = {}
    for chunk in RrdReader(recording).stream().filter(content="/__properties/harvey"):
        batch = chunk.to_record_batch()
        found |= {name: batch.column(name)[0].as_py()[0] for name in batch.schema.names if not name.endswith("RowId")}
    return found


def test_every_table_has_times_that_do_not_fall(office: Path, tmp_path: Path) -> None:
    assert main(["export", str(office), "--csv", str(tmp_path)]) == 0
    names = [path.stem for path in sorted(tmp_path.iterdir())]
    assert names == ["decisions", "milestones", "poses", "truth", "turning_points"]
    for path in tmp_path.iterdir():
        with path.open(encoding="utf-8", newline="") as file:
            times = [float(row["time_s"]) for row in csv.DictReader(file) if row["time_s"]]
        assert times and times == sorted(times), path.name


def test_a_recording_can_be_searched_for_by_how_it_ended(office: Path) -> None:
    result = json.loads((office / "result.json").read_text(encoding="utf-8"))
    told = {name: result[name] for name in ("scenario", "seed", "outcome")}
    assert read_properties(office / "recording.rrd") == {**told, "error_m": result["final_error_m"]}


def test_a_recording_that_is_drawn_anew_says_the_same(office: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(office, tmp_path / "office")
    (copy / "recording.rrd").unlink()
    assert main(["repair", str(copy)]) == 0
    assert read_properties(copy / "recording.rrd") == read_properties(office / "recording.rrd")
