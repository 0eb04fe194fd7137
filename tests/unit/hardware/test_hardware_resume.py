"""Where a run on hardware stood when it was cut off, by its journal."""

from __future__ import annotations

from pathlib import Path

import pytest

from harvey.errors import BadInput
from harvey.hardware.hardware_run import count_pictures, time_of_last_observation
from logs.run_directory import RunDirectory
from recorded_runs import Recorded


def test_time_and_pictures_go_on_from_the_last_ones(short_run: RunDirectory) -> None:
    assert time_of_last_observation(short_run) > 1.0
    assert count_pictures(short_run) == short_run.read_result()["frames"]


def test_a_run_without_a_decision_begins_at_nought(tmp_path: Path) -> None:
    assert (time_of_last_observation(RunDirectory(tmp_path)), count_pictures(RunDirectory(tmp_path))) == (0.0, 0)


def test_what_is_no_number_is_said(short_run: RunDirectory, tmp_path: Path) -> None:
    told = short_run.journal.read_text(encoding="utf-8")
    spoilt = RunDirectory(tmp_path)
    spoilt.journal.write_text(told.replace('"number":1,"sim', '"number":"x","sim'), encoding="utf-8")
    with pytest.raises(BadInput, match="expected a picture's number"):
        count_pictures(spoilt)


@pytest.fixture
def short_run(recorded: Recorded) -> RunDirectory:
    return recorded("office")
