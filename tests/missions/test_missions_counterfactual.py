"""What would have been: a mind without an expert, a landmark or a segment, told what the recorded run observed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from harvey.again.counterfactual import what_if
from harvey.cli import main
from harvey.errors import BadInput
from harvey.mission import run_mission
from harvey.records import DecisionRecord, read_records
from harvey.run_directory import RunDirectory
from knowledge_sources import tolerances
from sim.assembly import Stage

SEEN, BEHIND, FAR = "allens-office/desk", "allens-office/bookshelf-1", "robot-laboratory/long-bench"
"""A landmark that milestones show, one that the robot has at its back, and one in another room."""


@pytest.fixture(scope="module")
def run(short_stage: Stage, tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    out = tmp_path_factory.mktemp("runs") / "run"
    assert run_mission(short_stage, 3, out=out).outcome == "reached"
    return RunDirectory(out)


def rests_on(records: list[DecisionRecord], landmark: str) -> int:
    """How many decisions come before the first that makes something which names the landmark."""
    made = (json.dumps([entry.value for entry in record.made]) for record in records)
    return next((n for n, text in enumerate(made) if json.dumps(landmark) in text), len(records))


@pytest.mark.parametrize("landmark", [SEEN, BEHIND, FAR])
def test_without_a_landmark_only_decisions_change_that_rest_on_it(run: RunDirectory, landmark: str) -> None:
    """Law: before the first decision that names it all are the same to the byte; one never named changes none."""
    records = list(read_records(run.journal))
    answer = what_if(run, [landmark], (), go_on=False)
    assert answer.agreed >= rests_on(records, landmark)
    if rests_on(records, landmark) == len(records):
        assert (answer.agreed, answer.parting, answer.outcome.kind) == (len(records), None, "reached")
    else:
        assert answer.agreed < len(records)


def test_one_landmark_is_rested_on_and_two_are_not(run: RunDirectory) -> None:
    records = list(read_records(run.journal))
    assert rests_on(records, SEEN) == 2
    assert rests_on(records, BEHIND) == rests_on(records, FAR) == len(records)


def test_nothing_changed_means_nothing_differs(run: RunDirectory, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(run.path), "--set", "servo.plan=on"]) == 0
    assert "nothing would have changed" in capsys.readouterr().out


def test_without_an_expert_the_simulated_robot_goes_on_by_itself(
    run: RunDirectory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "otherwise"
    assert main(["replay", str(run.path), "--without", "correlator_tracker", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "as recorded:              reached" in printed and "the simulated robot went on by itself" in printed
    records, others = (list(read_records(d / "journal.jsonl")) for d in (run.path, out))
    assert not any(e.author == "correlator_tracker" for record in others for e in record.made)
    same = next(n for n, (a, b) in enumerate(zip(records, others, strict=False)) if a.line != b.line)
    assert same > 3
    assert main(["replay", str(out)]) == 0
    assert "all the same, byte for byte" in capsys.readouterr().out
    assert main(["diff", str(run.path), str(out)]) == 1
    assert f"agree for {same} decisions" in capsys.readouterr().out


def test_without_a_segment(run: RunDirectory) -> None:
    answer = what_if(run, ["frame 0 segment 3"], (), go_on=False)
    assert answer.then is not None and answer.now is not None
    then, now = (next(e.value for e in d.made if e.type == "Segments") for d in (answer.then, answer.now))
    assert now["segments_px"] == [s for n, s in enumerate(then["segments_px"]) if n != 3]


def test_where_it_parts_the_record_no_longer_answers(run: RunDirectory) -> None:
    before = tolerances.SIGMAS
    answer = what_if(run, (), [("motor.LOOKAHEAD_M", "0.2")], go_on=False)
    assert answer.outcome.kind == "unfinished"
    assert answer.parting is not None and answer.parting.now is not None and answer.parting.then is not None
    parted = answer.parting.then, answer.parting.now
    then, now = ([e.value for e in d.made if e.type == "MotorCommand"] for d in parted)
    assert then != now
    assert before == tolerances.SIGMAS


@pytest.mark.parametrize(("without", "settings", "word"), [
    (["desk"], (), "allens-office/desk"),
    ([], [("motor.LOOKAHED_M", "1")], "motor.LOOKAHEAD_M"),
    ([], [("motor.LOOKAHEAD_M", "far")], "expected a number"),
    ([], [("servo.plan", "3")], "expected on or off"),
    ([], [("servo.plans", "on")], "plan"),
])
def test_what_is_not_there_is_answered_with_what_is(
    run: RunDirectory, without: list[str], settings: list[tuple[str, str]], word: str
) -> None:
    with pytest.raises(BadInput, match=word):
        what_if(run, without, settings)
