"""What other programs get of a run: tracks as evo reads them, times in every table, properties of its recording."""

from __future__ import annotations

import csv
import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

import harvey
from harvey.cli import main


@pytest.fixture
def office(recorded: Any) -> Path:
    path: Path = recorded("office").path
    return path


def read_tum(path: Path) -> np.ndarray[Any, Any]:
    """(n, 4) time, x, y, heading; a reader of its own: lines of eight numbers whose times grow."""
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = np.array([[float(word) for word in line.split(" ")] for line in lines])
    assert rows.shape[1] == 8 and len(rows) > 5
    assert np.all(np.diff(rows[:, 0]) > 0)
    assert np.allclose(np.linalg.norm(rows[:, 4:], axis=1), 1.0, atol=1e-12)
    assert not rows[:, 3:6].any()
    return np.column_stack([rows[:, :3], 2.0 * np.arctan2(rows[:, 6], rows[:, 7])])


def read_properties(recording: Path) -> Mapping[str, Any]:
    """The properties that Harvey gives a recording."""
    found: dict[str, Any] = {}
    for chunk in RrdReader(recording).stream().filter(content="/__properties/harvey"):
        batch = chunk.to_record_batch()
        found |= {name: batch.column(name)[0].as_py()[0] for name in batch.schema.names if not name.endswith("RowId")}
    return found


def test_tracks_are_those_of_the_run_and_agree_where_they_meet(office: Path, tmp_path: Path) -> None:
    assert main(["export", str(office), "--tum", str(tmp_path)]) == 0
    believed, true = read_tum(tmp_path / "believed.tum"), read_tum(tmp_path / "true.tum")
    run = harvey.open_run(office)
    for track, points in ((believed, run.believed_track()), (true, run.true_track())):
        poses = [point.pose for point in points]
        for _, x, y, heading in track:
            there = [one.heading_rad for one in poses if (one.x_m, one.y_m) == (x, y)]
            assert min(abs(math.remainder(heading - one, math.tau)) for one in there) < 1e-12
    nearest = np.abs(believed[:, None, 0] - true[None, :, 0]).argmin(axis=0)
    meet = np.abs(believed[nearest, 0] - true[:, 0]) < 0.01
    off_m = np.linalg.norm(believed[nearest, 1:3] - true[:, 1:3], axis=1)[meet]
    assert meet.sum() > 5 and np.median(off_m) < 0.02  # by other times they would be some decimetres apart


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
