"""The recording: every decision and every picture is in it, and equal runs make equal recordings."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from journals import read_decisions
from logs.journal_file import JournalFile
from logs.reader import damage_of, read_frames, read_series
from logs.recording.paths import CHAPTERS
from logs.recording.writer import RecordingWriter
from logs.run_errors import RecordingError
from scripted_mission import CAMERA, MOUNT, house, play
from world_models.frames import Pose2


def recorded(folder: Path, *, truth: bool = True, name: str = "recording.rrd") -> Path:
    journal = JournalFile(folder / "journal.jsonl")
    recorder = RecordingWriter(folder / name, world=house(), camera=CAMERA, mount=MOUNT, title="house",
                               recording_id="house-0", line_of=journal.line)
    told = (lambda n: recorder.truth(Pose2(1.0 + 0.1 * n, 1.0, 0.0), 0.3 * n)) if truth else (lambda _n: None)
    play([journal, recorder], told)
    recorder.close()
    journal.close()
    return folder / name


def test_equal_runs_make_equal_recordings(tmp_path: Path) -> None:
    compare = shutil.which("rerun", path=str(Path(sys.executable).parent))
    if compare is None:
        pytest.skip("rerun's command line is not installed beside this Python")
    paths = [recorded(tmp_path, name=name) for name in ("one.rrd", "two.rrd")]
    done = subprocess.run([compare, "rrd", "compare", *map(str, paths)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_without_the_truth_the_true_robot_is_not_drawn(tmp_path: Path) -> None:
    paths = {truth: {chunk.entity_path for chunk in RrdReader(recorded(tmp_path, truth=truth)).stream()}
             for truth in (True, False)}
    robot = "/world/robot/true"
    assert paths[True] - paths[False] == {robot, f"{robot}/body", f"{robot}/heading", f"{robot}_trail"}


def test_what_the_simulator_did_is_a_turning_point_of_the_recording(tmp_path: Path) -> None:
    recorder = RecordingWriter(tmp_path / "r.rrd", world=house(), camera=CAMERA, mount=MOUNT, title="house",
                               recording_id="house-0")
    here = Pose2(1.0, 1.0, 0.0)
    play([recorder], lambda n: recorder.truth(here, 0.3 * n, (), ("the lights go off for 2 s",) if n == 3 else ()))
    recorder.close()
    told = [text for _, text in read_series(tmp_path / "r.rrd", CHAPTERS, "TextLog:text")]
    assert told.count("the lights go off for 2 s, as only the simulator knows") == 1


def test_an_unfinished_recording_holds_what_was_flushed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("logs.recording.stream.FLUSH_CYCLES", 8)
    recorder = RecordingWriter(
        tmp_path / "cut.rrd", world=house(), camera=CAMERA, mount=MOUNT, title="house", recording_id="cut")
    scheduler = play([recorder])
    flushed = read_decisions(tmp_path / "cut.rrd")
    assert len(flushed) == scheduler.cycle // 8 * 8 > 0
    recorder.close()
    assert len(read_decisions(tmp_path / "cut.rrd")) == scheduler.cycle


@pytest.mark.parametrize("keep", [0.0, 0.001, 0.3, 0.9])
def test_a_cut_file_is_told_by_name_or_read_as_far_as_it_goes(tmp_path: Path, keep: float) -> None:
    """Where the cut falls between two chunks, as after a flush, what is there can be read."""
    recording = recorded(tmp_path)
    decisions, whole = read_decisions(recording), recording.read_bytes()
    recording.write_bytes(whole[: int(keep * len(whole))])
    assert damage_of(recording) is not None
    try:
        read = read_decisions(recording)
    except RecordingError as error:
        assert "recording.rrd: expected a whole Rerun recording" in str(error)
    else:
        assert len(read) < len(decisions) and read == decisions[: len(read)]


def test_what_is_no_recording_is_told_by_name(tmp_path: Path) -> None:
    (tmp_path / "a.rrd").write_text(json.dumps({"cycle": 1}) * 100)
    with pytest.raises(RecordingError, match=r"a\.rrd: expected a whole Rerun recording"):
        read_frames(tmp_path / "a.rrd")
    with pytest.raises(RecordingError, match=r"b\.rrd: expected a recording, got no such file"):
        read_frames(tmp_path / "b.rrd")


def test_a_recording_needs_somewhere_to_go() -> None:
    with pytest.raises(ValueError, match="expected a path or live=True"):
        RecordingWriter(None, world=house(), camera=CAMERA, mount=MOUNT, title="house", recording_id="none")


def test_a_folder_that_is_not_there_is_told_by_name(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none/recording\.rrd: cannot be written"):
        RecordingWriter(
            tmp_path / "none" / "recording.rrd", world=house(), camera=CAMERA, mount=MOUNT, title="x", recording_id="x")


def test_a_full_disk_is_told() -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")
    with pytest.raises(RecordingError, match="/dev/full: cannot be written"):
        recorder = RecordingWriter(full, world=house(), camera=CAMERA, mount=MOUNT, title="x", recording_id="x")
        play([recorder])
        recorder.close()
