"""What would have been: an agent without a source, a landmark or a segment, given what the run observed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from harvey.cli import main
from harvey.errors import BadInput
from harvey.replay.counterfactual import what_if
from harvey.simulation.simulated_run import build_head, run_mission
from knowledge_sources.settings import list_rows
from logs.records import DecisionRecord
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from recorded_runs import Recorded
from sim.stage import Stage

SEEN, BEHIND, FAR = "allens-office/desk", "allens-office/bookshelf-1", "robot-laboratory/long-bench"
"""A landmark that milestones show, one that the robot has at its back, and one in another room."""


@pytest.fixture(scope="module")
def run(recorded: Recorded) -> RunDirectory:
    return recorded("office")


def rests_on(records: list[DecisionRecord], landmark: str) -> int:
    """How many decisions come before the first that makes something which names the landmark."""
    made = (json.dumps([entry.fields for entry in record.made]) for record in records)
    return next((n for n, text in enumerate(made) if json.dumps(landmark) in text), len(records))


@pytest.mark.parametrize("landmark", [SEEN, BEHIND, FAR])
def test_without_a_landmark_only_decisions_change_that_rest_on_it(run: RunDirectory, landmark: str) -> None:
    """Law: before the first decision that names it all are the same to the byte; one never named changes none."""
    records = list(Timeline(run.journal).decisions())
    answer = what_if(run, [landmark], (), go_on=False)
    assert answer.agreed >= rests_on(records, landmark)
    if rests_on(records, landmark) == len(records):
        assert (answer.agreed, answer.parting, answer.outcome.kind) == (len(records), None, "reached")
    else:
        assert answer.agreed < len(records)


def test_one_landmark_is_rested_on_and_two_are_not(run: RunDirectory) -> None:
    records = list(Timeline(run.journal).decisions())
    waits = [record.cycle for record in records[:8] if any(e.type == "FrameRequest" for e in record.made)]
    assert rests_on(records, SEEN) == 3 + len(waits) == 8  # that it is looked for, what is expected, and the verdict
    assert rests_on(records, BEHIND) == rests_on(records, FAR) == len(records)


def test_nothing_changed_means_nothing_differs(run: RunDirectory, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(run.path), "--set", "servo.plan=on"]) == 0
    assert "nothing would have changed" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["action.creep_speed_m_per_s", "plan.max_leg_m", "floor.use_ranges"])
def test_a_setting_set_to_its_default_changes_nothing(run: RunDirectory, name: str) -> None:
    value = next(row.value for row in list_rows() if row.name == name)
    answer = what_if(run, (), [(name, str(value).lower())], go_on=False)
    assert (answer.then, answer.now, answer.outcome.kind) == (None, None, "reached")


def test_a_run_with_other_settings_is_decided_again_with_them(
    short_stage: Stage, run: RunDirectory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They are kept in run.json, so that replay, resume and why use them."""
    other = RunDirectory(tmp_path / "other")
    run_mission(short_stage, 3, out=other.path, head=build_head(short_stage, 3, settings=(("plan.max_leg_m", "1.5"),)))
    assert json.loads((other.path / "run.json").read_text("utf-8"))["constants"] == [["plan.max_leg_m", "1.5"]]
    assert other.journal.read_bytes() != run.journal.read_bytes()
    assert main(["replay", str(other.path)]) == 0
    assert "all the same, byte for byte" in capsys.readouterr().out


def test_without_an_expert_the_simulated_robot_goes_on_by_itself(
    run: RunDirectory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "otherwise"
    assert main(["replay", str(run.path), "--without", "correlator_tracker", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"{out / 'ways.png'}: both ways on the plan")
    with Image.open(out / "ways.png") as picture:
        colours = set(map(tuple, np.asarray(picture.convert("RGB")).reshape(-1, 3).tolist()))
    assert {(0x1F, 0x77, 0xB4), (0xFF, 0x7F, 0x0E)} <= colours
    assert "as recorded:              reached" in printed and "the simulated robot went on by itself" in printed
    records, others = (list(Timeline(d / "journal.jsonl").decisions()) for d in (run.path, out))
    assert not any(e.author == "correlator_tracker" for record in others for e in record.made)
    same = next(n for n, (a, b) in enumerate(zip(records, others, strict=False)) if a.line != b.line)
    assert same > 3
    assert main(["replay", str(out)]) == 0
    assert "all the same, byte for byte" in capsys.readouterr().out
    assert main(["diff", str(run.path), str(out)]) == 1
    assert f"agree for {same} decisions" in capsys.readouterr().out


def test_without_a_segment(run: RunDirectory) -> None:
    answer = what_if(run, ["CameraPicture-1 segment 3"], (), go_on=False)
    assert answer.then is not None and answer.now is not None
    then, now = (next(e.fields for e in d.made if e.type == "Segments") for d in (answer.then, answer.now))
    assert now["segments_px"] == [s for n, s in enumerate(then["segments_px"]) if n != 3]


def test_a_segment_has_the_number_that_it_had_before_another_was_taken(run: RunDirectory, tmp_path: Path) -> None:
    """Segments are told apart by their numbers in the run as it was, also in a run that tells what would have been."""
    fewer = RunDirectory(tmp_path / "fewer")
    answer = what_if(run, ["CameraPicture-1 segment 3"], (), out=fewer, go_on=False)
    assert answer.then is not None
    last = len(next(e.fields for e in answer.then.made if e.type == "Segments")["segments_px"]) - 1
    assert what_if(fewer, [f"CameraPicture-1 segment {last}"], (), go_on=False).agreed == answer.agreed
    with pytest.raises(BadInput, match=f"0 to {last}, got {last + 1}"):
        what_if(fewer, [f"CameraPicture-1 segment {last + 1}"], (), go_on=False)


def test_nothing_is_lost_where_the_question_cannot_be_answered(
    run: RunDirectory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither an older run at --out, nor, where that is its own place, the run itself."""
    shutil.copytree(run.path, tmp_path / "older")
    before = {path.name: path.read_bytes() for path in run.path.iterdir()}
    for out, without, told in (("older", "CameraPicture-999 segment 3", "expected a frame"),
                               ("older", "desk-that-is-not", "expected"),
                               (str(run.path), "plan_adjuster", "expected another directory")):
        argv = ["replay", str(run.path), "--without", without, "--out", str(tmp_path / out)]
        assert main(argv) == 2
        assert told in capsys.readouterr().err
        assert {path.name: path.read_bytes() for path in (tmp_path / out).iterdir()} == before


def test_where_it_parts_the_record_no_longer_answers(run: RunDirectory) -> None:
    answer = what_if(run, (), [("action.creep_speed_m_per_s", "0.05")], go_on=False)
    assert answer.outcome.kind == "unfinished"
    assert answer.parting is not None
    then, now = ([e.fields for e in d.made if e.type == "MotorCommand"] for d in answer.parting if d is not None)
    assert then != now


@pytest.mark.parametrize(("without", "settings", "word"), [
    (["desk"], (), "allens-office/desk"),
    ([], [("action.max_lookss", "1")], "action.max_looks"),
    ([], [("action.max_looks", "far")], "expected a whole number"),
    ([], [("servo.plan", "3")], "expected on or off"),
    ([], [("servo.plans", "on")], "plan"),
    (["CameraPicture-999 segment 3"], (),
     r"CameraPicture-999 segment 3: expected a frame of the run, CameraPicture-1 to CameraPicture-\d+,"
     r" got CameraPicture-999"),
    (["line_finder", "CameraPicture-1 segment 9999"], (), r"expected a segment of CameraPicture-1, 0 to \d+, got 9999"),
    (["CameraPicture-2 segment 0"], (),
     r"expected a frame in which segments were looked for, CameraPicture-1 and CameraPicture-\d+, got CameraPicture-2"),
])
def test_what_is_not_there_is_answered_with_what_is(
    run: RunDirectory, without: list[str], settings: list[tuple[str, str]], word: str
) -> None:
    with pytest.raises(BadInput, match=word):
        what_if(run, without, settings)
