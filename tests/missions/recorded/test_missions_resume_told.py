"""A run on which somebody tells the robot something: replayed to the byte; cut off, it is told the rest."""

from __future__ import annotations

from pathlib import Path

import pytest

from harvey.runner.resume import find_remains
from harvey.simulation.simulated_run import resume_mission
from logs.records import DecisionRecord
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from recorded_runs import TOLD, Recorded, cut_off, is_decided_again
from sim.stage import Stage
from two_doors import two_doors


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return two_doors(tmp_path_factory.mktemp("world"), TOLD)


@pytest.fixture(scope="module")
def whole(recorded: Recorded) -> RunDirectory:
    return recorded("two doors")


def records_of(run: RunDirectory) -> list[DecisionRecord]:
    return list(Timeline(run.journal).decisions())


def told_in(records: list[DecisionRecord]) -> list[tuple[int, str]]:
    return [(record.cycle, entry.fields["what"]) for record in records for entry in record.observed
            if entry.type == "UserReport"]


def test_a_run_that_was_told_something_is_replayed_to_the_byte(whole: RunDirectory) -> None:
    assert [what for _, what in told_in(records_of(whole))] == [what for _, what, _ in TOLD]
    assert is_decided_again(whole)


@pytest.mark.parametrize(("which", "away"), [(0, 0), (1, -1), (1, 0), (1, 1)])
def test_a_run_that_was_cut_off_near_a_telling_is_told_each_thing_once(
    whole: RunDirectory, stage: Stage, tmp_path: Path, which: int, away: int
) -> None:
    """Before it was written down that it was told; after, while it asks what is meant; and when that was taken up."""
    records = records_of(whole)
    decisions = told_in(records)[which][0] + away
    run = cut_off(whole, tmp_path / "run", decisions)
    assert resume_mission(run, find_remains(run), stage=stage).outcome == "reached"
    now = records_of(run)
    assert [what for _, what in told_in(now)] == [what for _, what, _ in TOLD]
    assert is_decided_again(run)
    if all(entry.type != "MotorCommand" for entry in records[decisions - 1].made):  # else a motion was broken off
        assert [r.data for r in now[:decisions]] == [r.data for r in records[:decisions]]
        assert [r.data for r in now[decisions + 1:]] == [r.data for r in records[decisions + 1:]]
