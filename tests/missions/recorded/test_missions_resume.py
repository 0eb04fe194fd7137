"""A run that was cut off goes on from its last decision: nothing is lost, nothing is done twice, and it arrives."""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from experiments.robustness import crash
from harvey.cli import main
from harvey.runner.result import MissionResult
from harvey.runner.resume import find_remains
from harvey.simulation.simulated_run import redraw, resume_mission, run_mission
from journals import read_decisions
from logs import disk
from logs.pictures import open_pictures
from logs.reader import damage_of, read_frames
from logs.records import DecisionRecord
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from recorded_runs import Recorded, cut_off, is_decided_again
from sim.stage import Stage

SEED = 3


@pytest.fixture(scope="module")
def whole(recorded: Recorded) -> RunDirectory:
    """A run that was not cut off."""
    return recorded("office")


def cut(whole: RunDirectory, to: Path, decisions: int, *, tail: int = 40) -> RunDirectory:
    """The same, with the beginning of its recording."""
    run = cut_off(whole, to, decisions, tail=tail)
    run.recording.write_bytes(whole.recording.read_bytes()[:5000])
    return run


def go_on(run: RunDirectory, stage: Stage) -> MissionResult:
    return resume_mission(run, find_remains(run), stage=stage)


def made_by(records: list[DecisionRecord], kind: str, which: int) -> int:
    """How many decisions there are up to the one that makes the n-th entry of a type."""
    return [r.cycle for r in records if any(e.type == kind for e in r.made)][which]


def answered(run: RunDirectory) -> list[str]:
    """The motor commands, once for each report on them."""
    return [record.because[0] for decision in Timeline(run.journal).decisions() for record in decision.observed
            if record.type == "MotionReport"]


def test_where_no_motion_was_broken_off_it_is_as_if_nothing_had_been(
    whole: RunDirectory, short_stage: Stage, tmp_path: Path
) -> None:
    records = list(Timeline(whole.journal).decisions())
    before = made_by(records, "PictureRequest", 2)
    run = cut(whole, tmp_path / "run", before)
    assert go_on(run, short_stage).outcome == "reached"
    first, second = ([r.data for r in Timeline(d.journal).decisions()] for d in (whole, run))
    assert first[:before] == second[:before]
    assert first[before + 1:] == second[before + 1:]
    told = [e for e in Timeline(run.journal).decisions() for e in e.observed if e.type == "Resumed"]
    assert [(e.cycle, e.author, e.fields["interrupted"]) for e in told] == [(before + 1, "resume", [])]
    assert run.camera.read_bytes() == whole.camera.read_bytes()
    assert is_decided_again(run)
    assert damage_of(run.recording) is None
    assert [d["cycle"] for d in read_decisions(run.recording)] == [r.cycle for r in records]


def test_a_motion_that_nobody_reported_on_is_not_carried_out_again(
    whole: RunDirectory, short_stage: Stage, tmp_path: Path
) -> None:
    """Cut off twice, each time while a motor command is under way: the wheels are asked how far it went."""
    before = made_by(list(Timeline(whole.journal).decisions()), "MotorCommand", 2)
    run = cut(whole, tmp_path / "once", before)
    assert go_on(run, short_stage).outcome == "reached"
    records = list(Timeline(run.journal).decisions())
    command = next(e for e in records[before - 1].made if e.type == "MotorCommand")
    resumed, report = records[before].observed
    assert (resumed.type, resumed.fields["interrupted"], resumed.because) == ("Resumed", [command.ref], (command.ref,))
    assert (report.type, report.because) == ("MotionReport", (command.ref,))
    claimed, asked = (abs(v["turn_rad"]) + v["move_m"] for v in (report.fields, command.fields))
    assert claimed < asked
    assert len(answered(run)) == len(set(answered(run)))
    assert is_decided_again(run)

    again = cut(run, tmp_path / "twice", made_by(records, "MotorCommand", 4))
    assert go_on(again, short_stage).outcome == "reached"
    assert sum(e.type == "Resumed" for r in Timeline(again.journal).decisions() for e in r.observed) == 2
    assert len(answered(again)) == len(set(answered(again)))
    assert is_decided_again(again)


@pytest.mark.parametrize("tail", [0, 200])
def test_a_run_that_had_hardly_begun_begins(
    whole: RunDirectory, short_stage: Stage, tmp_path: Path, tail: int
) -> None:
    run = cut(whole, tmp_path / "run", 0, tail=tail)
    run.camera.write_bytes(b"")
    assert go_on(run, short_stage).outcome == "reached"
    assert run.journal.read_bytes() == whole.journal.read_bytes()


@pytest.mark.parametrize("tail", [None, 0, 200])
@pytest.mark.parametrize("lacking", ["result.json", "camera.mjpeg"])
def test_a_run_whose_journal_was_lost_is_left_alone(
    whole: RunDirectory, tmp_path: Path, capsys: pytest.CaptureFixture[str], tail: int | None, lacking: str
) -> None:
    """Pictures, or a result, of decisions that are not there: the run had more than begun."""
    run = cut(whole, tmp_path / "run", 0, tail=tail or 0)
    shutil.copy(whole.result, run.result)
    (run.path / lacking).unlink()
    if tail is None:
        run.journal.unlink()
    before = {path.name: path.read_bytes() for path in run.path.iterdir()}
    assert main(["resume", str(run.path)]) == 2
    err = capsys.readouterr().err
    assert "journal.jsonl: expected the decisions of the run, got none, although" in err
    assert ("result.json tells of" if lacking == "camera.mjpeg" else "bytes of pictures") in err
    assert {path.name: path.read_bytes() for path in run.path.iterdir()} == before


def test_a_finished_run_says_so(whole: RunDirectory, capsys: pytest.CaptureFixture[str]) -> None:
    before = whole.journal.read_bytes()
    assert main(["resume", str(whole.path)]) == 0
    assert "was not cut off: it ended with reached" in capsys.readouterr().out
    assert whole.journal.read_bytes() == before


def test_a_simulator_that_answers_otherwise_is_found_out(
    whole: RunDirectory, short_stage: Stage, tmp_path: Path
) -> None:
    run = cut(whole, tmp_path / "run", 40)  # 5 of them ask for locale frames
    head = json.loads((run.path / "run.json").read_text())
    (run.path / "run.json").write_text(json.dumps({**head, "seed": SEED + 1}))
    assert main(["resume", str(run.path)]) == 2


@pytest.mark.parametrize(("body", "sync", "forces"),
                         [("simulated", False, False), ("simulated", True, True), ("denning", False, True)])
def test_the_disk_is_forced_where_a_port_is_real_or_it_is_asked_for(
    short_stage: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, sync: bool, forces: bool
) -> None:
    """Before each motion and each picture; what is written is the same."""
    forced: list[int] = []
    monkeypatch.setattr(disk.os, "fsync", forced.append)
    scenario = short_stage.scenario
    stage = replace(short_stage, scenario=replace(scenario, limits=replace(scenario.limits, max_cycles=24)))
    run_mission(stage, SEED, out=tmp_path / "run", body=body, sync=sync)
    assert bool(forced) == forces
    made_by(list(Timeline(tmp_path / "run" / "journal.jsonl").decisions()), "MotorCommand", 0)


def test_two_processes_do_not_write_one_run(
    whole: RunDirectory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = cut(whole, tmp_path / "run", 9)
    open_elsewhere = disk.Appended(run.journal, "journal", keep=run.journal.stat().st_size)
    assert main(["resume", str(run.path)]) == 2
    assert "another process is writing" in capsys.readouterr().err
    open_elsewhere.close()


def test_a_damaged_recording_is_drawn_anew(
    whole: RunDirectory, short_stage: Stage, tmp_path: Path
) -> None:
    run = cut(whole, tmp_path / "run", 30)
    assert damage_of(run.recording) is not None
    assert redraw(run) == 30
    assert damage_of(run.recording) is None
    assert [d["cycle"] for d in read_decisions(run.recording)] == list(range(1, 31))
    drawn, known = read_frames(run.recording), open_pictures(run)
    assert drawn == dict(known)


@pytest.mark.parametrize(("name", "room"), [("journal.jsonl", 60_000), ("camera.mjpeg", 150_000)])
def test_a_full_disk_stops_the_run_and_what_was_written_stays(
    short_stage: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, room: int
) -> None:
    run = RunDirectory(tmp_path / "run")
    with monkeypatch.context() as patched:
        patched.setattr(disk.os, "write", _with_room(run.path / name, room))
        result = run_mission(short_stage, SEED, out=run.path)
    assert result.outcome == "failed"
    assert "No space left on device" in result.reason and str(run.path / name) in result.reason
    assert (run.path / name).stat().st_size <= room
    assert run.journal.read_bytes().endswith(b"\n")
    assert is_decided_again(run)
    assert go_on(run, short_stage).outcome == "reached"


def _with_room(path: Path, room: int) -> Callable[[int, bytes], int]:
    """``os.write`` on a disk where one file finds only so much room; the last write gets in a part."""
    def write(file: int, data: bytes) -> int:
        if os.path.realpath(f"/proc/self/fd/{file}") != str(path.resolve()):
            return real(file, data)
        left = room - os.fstat(file).st_size
        if left <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(file, data[:left])

    real: Any = os.write
    return write


def test_a_process_that_is_killed_loses_nothing(tmp_path: Path) -> None:
    """SIGKILL in the middle of a drive, and again while it is resumed."""
    found = crash.run_trial(crash.Trial(0, "office", 1, 25, 0.03, 6.0), tmp_path)
    assert (found.wrong, found.outcome) == ("", "reached")
    assert found.kills >= 1
