"""What if: what is taken away or set is a revision on the board with the author "what if", and nothing else."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from harvey.cli import main
from harvey.replay.counterfactual import Answer, what_if
from harvey.runner.resume import find_remains
from harvey.simulation.simulated_run import build_head, resume_mission, run_mission
from logs.records import EntryRecord
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from recorded_runs import Recorded
from sim.stage import Stage

DESK = "allens-office/desk"


@pytest.fixture(scope="module")
def run(recorded: Recorded) -> RunDirectory:
    return recorded("office")


@pytest.fixture(scope="module")
def without(run: RunDirectory, tmp_path_factory: pytest.TempPathFactory) -> tuple[RunDirectory, Answer]:
    """The run without the desk, and what it answered."""
    out = RunDirectory(tmp_path_factory.mktemp("runs") / "without")
    return out, what_if(run, [DESK], (), out=out)


def told(run: RunDirectory) -> list[EntryRecord]:
    """What the run was told by what if."""
    return [entry for record in Timeline(run.journal).decisions() for entry in record.observed
            if entry.author == "what if"]


def is_replayed(run: RunDirectory, capsys: pytest.CaptureFixture[str]) -> bool:
    assert main(["replay", str(run.path)]) == 0
    return "all the same, byte for byte" in capsys.readouterr().out


def test_a_landmark_that_is_taken_away_is_a_revision_of_its_locales_frame(
    run: RunDirectory, without: tuple[RunDirectory, Answer]
) -> None:
    """Told in the cycle in which the frame comes; no other frame is revised, and the desk is expected nowhere."""
    other, answer = without
    (revision,) = told(other)
    frame, _, number = revision.ref.rpartition(".")
    assert (revision.type, revision.change, number) == ("LocaleFrame", "Revised", "1")
    assert revision.because == (f"{frame}.0",) and answer.revised == (revision.ref,)
    assert revision.fields["locale"] == "allens-office"
    assert revision.fields["changes"] == [
        {"what": "removed", "name": DESK, "by": "what if", "footprint": [], "height_m": 0.0,
         "by_m": [0.0, 0.0], "sigma_m": 0.0}]
    observed = next(r.observed for r in Timeline(other.journal).decisions() if revision in r.observed)
    assert f"{frame}.0" in [entry.ref for entry in observed]
    expects = [json.dumps(e.fields) for r in Timeline(other.journal).decisions() for e in r.made
               if e.type == "Milestone"]
    assert expects and not any(DESK in text for text in expects)
    assert not told(run)


def test_acts_use_the_revision_and_never_the_frame_before_it(without: tuple[RunDirectory, Answer]) -> None:
    (revision,) = told(without[0])
    used = {ref for record in Timeline(without[0].journal).decisions() for ref in record.used}
    assert revision.ref in used and f"{revision.id}.0" not in used


def test_it_is_replayed_without_being_told_again(
    without: tuple[RunDirectory, Answer], capsys: pytest.CaptureFixture[str]
) -> None:
    assert is_replayed(without[0], capsys)


@pytest.mark.parametrize("decisions", [0, 1, 20])
def test_it_is_resumed(
    without: tuple[RunDirectory, Answer], short_stage: Stage, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    decisions: int,
) -> None:
    """Cut off before the frame was there, after it was asked for, and long after that."""
    whole, cut = without[0], RunDirectory(tmp_path / "cut")
    cut.path.mkdir()
    pictures = sum(entry.fields["jpeg"]["bytes"] for record in list(Timeline(whole.journal).decisions())[:decisions]
                   for entry in record.observed if entry.type == "CameraPicture")
    (cut.path / "run.json").write_bytes((whole.path / "run.json").read_bytes())
    (cut.path / "camera.mjpeg").write_bytes((whole.path / "camera.mjpeg").read_bytes()[:pictures])
    cut.journal.write_bytes(b"".join(whole.journal.read_bytes().splitlines(keepends=True)[:decisions]))
    assert resume_mission(cut, find_remains(cut), stage=short_stage).outcome == "reached"
    assert [(e.ref, e.value) for e in told(cut)] == [(e.ref, e.value) for e in told(whole)]
    assert is_replayed(cut, capsys)


def test_why_names_the_revision_and_its_author(
    without: tuple[RunDirectory, Answer], capsys: pytest.CaptureFixture[str]
) -> None:
    (revision,) = told(without[0])
    for name in (revision.ref, DESK):
        assert main(["why", str(without[0].path), name]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert revision.ref in said and f"{DESK} is left out (what if)" in said and "the question what if" in said


def test_another_question_is_asked_of_it(without: tuple[RunDirectory, Answer]) -> None:
    """What was taken away already stays away, and is no difference."""
    answer = what_if(without[0], ["allens-office/bookshelf-1"], (), go_on=False)
    assert (answer.then, answer.now, answer.outcome.kind) == (None, None, "reached")
    assert answer.agreed == len(list(Timeline(without[0].journal).decisions()))


def test_a_camera_that_is_believed_to_be_tilted_makes_another_run(
    run: RunDirectory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One revision, before anybody acts; it is kept in run.json, replayed and asked about."""
    out = RunDirectory(tmp_path / "tilted")
    argv = ["replay", str(run.path), "--set", "camera.tilt_deg=0.3", "--out", str(out.path)]
    assert main(argv) == 0
    capsys.readouterr()
    (revision,) = told(out)
    assert (revision.ref, revision.cycle, revision.because) == ("CameraState-1.1", 1, ("CameraState-1.0",))
    assert revision.fields["mount"]["tilt_rad"] == pytest.approx(math.radians(0.3))
    used = {ref for record in Timeline(out.journal).decisions() for ref in record.used}
    assert "CameraState-1.1" in used and "CameraState-1.0" not in used
    assert json.loads((out.path / "run.json").read_text("utf-8"))["constants"] == [["camera.tilt_deg", "0.3"]]
    assert is_replayed(out, capsys)
    assert main(["why", str(out.path), "CameraState-1.1"]) == 0
    assert "what if" in capsys.readouterr().out


def test_a_camera_that_is_set_to_what_it_is_changes_nothing(run: RunDirectory) -> None:
    answer = what_if(run, (), [("camera.tilt_deg", "0"), ("wheels.increment_m", "0.6096")], go_on=False)
    assert (answer.then, answer.now, answer.revised, answer.outcome.kind) == (None, None, (), "reached")


def test_what_is_set_of_a_new_run_changes_what_is_believed_and_not_what_is_true(
    short_stage: Stage, run: RunDirectory, tmp_path: Path
) -> None:
    out = RunDirectory(tmp_path / "narrow")
    head = build_head(short_stage, 3, settings=(("wheels.increment_m", "0.5"), ("footprint.radius_m", "0.3")))
    assert run_mission(short_stage, 3, out=out.path, head=head).outcome == "reached"
    assert [entry.ref for entry in told(out)] == ["Wheels-1.1", "Footprint-1.1"]
    (then, now) = (json.loads((one.path / "run.json").read_text("utf-8")) for one in (run, out))
    assert (then["scenario"], then["robot"]) == (now["scenario"], now["robot"])
    longest = max(e.fields["move_m"] for r in Timeline(out.journal).decisions() for e in r.made
                  if e.type == "MotorCommand")
    assert longest <= 0.5 / (228.3 / 240.0) + 1e-9
