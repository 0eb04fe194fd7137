"""A desk that the model has elsewhere: the robot touches it, says so, and why it stopped walks to what it felt."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from experiments.generated.missions import OFFICE
from harvey.cli import main
from harvey.runner.result import MissionResult
from harvey.runner.resume import find_remains
from harvey.simulation.simulated_run import build_head, resume_mission, run_mission
from journals import logged
from logs.explain.turning_points import read_turning_points
from logs.explain.why import tell_stories
from logs.recording.paths import CONTACTS, RANGES
from logs.records import EntryRecord
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage

IN_THE_WAY = """max_collisions = 2
[ranges]
sensors = 24
[[moved]]
thing = "allens-office/desk"
x_m = -1.0
y_m = 1.0
"""


BLIND = (("floor.use_appearance", "false"), ("floor.use_ranges", "false"), ("action.keeps_to_seen_floor", "false"))
"""It sees and ranges nothing on the floor: it is touch that tells."""


@pytest.fixture(scope="module")
def stage() -> Stage:
    return build_stage(parse_scenario(OFFICE + IN_THE_WAY, "into-a-desk"))


@pytest.fixture(scope="module")
def touched(stage: Stage, tmp_path_factory: pytest.TempPathFactory) -> tuple[MissionResult, Path]:
    out = tmp_path_factory.mktemp("touch") / "run"
    return run_mission(stage, 1, out=out, head=build_head(stage, 1, settings=BLIND)), out


def observed(out: Path, kind: str) -> list[EntryRecord]:
    records = Timeline(RunDirectory(out).journal).decisions()
    return [entry for record in records for entry in record.observed if entry.type == kind]


def test_each_collision_is_felt_once_by_its_motion_and_nothing_else_is(touched: tuple[MissionResult, Path]) -> None:
    result, out = touched
    contacts, motions = observed(out, "Contact"), observed(out, "MotionReport")
    assert result.collisions == len(contacts) >= 1
    for contact in contacts:
        (request,) = contact.because
        assert request.startswith("MotorCommand-")
        assert [motion.cycle for motion in motions if motion.because == contact.because] == [contact.cycle]


def test_why_it_stopped_walks_to_what_it_touched(touched: tuple[MissionResult, Path]) -> None:
    history = Timeline(RunDirectory(touched[1]).journal)
    stopped = [entry for ref in history.refs if ref.startswith("Discrepancy-") and ref.endswith(".0")
               and (entry := history.entry(ref)) is not None and entry.author == "dead_reckoner"]
    assert stopped
    for entry in stopped:
        assert [ref.partition("-")[0] for ref in entry.because] == ["MotionReport", "Contact"]
        (told,) = tell_stories(history, [entry.ref])
        (step,) = [step for step in told.steps if step.label == "touched"]
        assert step.text.startswith("The bumper touched something") and step.refs == (entry.because[1],)
    assert [point.kind for point in read_turning_points(history)].count("contact") == touched[0].collisions


def test_it_is_replayed_byte_for_byte_and_goes_on_after_it_was_cut_off(
    stage: Stage, touched: tuple[MissionResult, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, out = touched
    assert main(["replay", str(out)]) == 0 and "byte for byte" in capsys.readouterr().out
    cut = RunDirectory(tmp_path / "cut")
    shutil.copytree(out, cut.path)
    lines = cut.journal.read_bytes().splitlines(keepends=True)
    after = next(i for i, line in enumerate(lines) if b'"Contact-1.0","type"' in line)
    cut.journal.write_bytes(b"".join(lines[:after + 3]))
    resumed = resume_mission(cut, find_remains(cut), stage=stage)
    assert resumed.collisions >= 1
    assert cut.journal.read_bytes().startswith(b"".join(lines[:after + 3]))


def test_the_recording_marks_where_it_touched_and_what_was_heard(touched: tuple[MissionResult, Path]) -> None:
    recording = touched[1] / "recording.rrd"
    contacts = logged(recording, CONTACTS, "Points3D:positions")
    heard = [np.array(lines) for _, lines in logged(recording, RANGES, "LineStrips3D:strips")]
    assert len(contacts[-1][1]) == touched[0].collisions and len(heard) > 3
    nearest_m = min(float(np.hypot(*lines[:, 1, :2].T).min()) for lines in heard)
    assert math.isclose(nearest_m, 0.35, abs_tol=0.1)
