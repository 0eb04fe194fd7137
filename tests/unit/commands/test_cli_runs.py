"""The command line on a short recorded run: run, why, replay, diff, and being stopped."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from harvey.campaign.mission_task import Task, run_task
from harvey.campaign.workers import Workers, map_cases
from harvey.cli import main
from harvey.commands.command import parse_pairs, parse_seeds
from harvey.errors import BadInput, Terminated
from harvey.wiring import load_kinds
from journals import read_decisions, read_journal
from logs.decided_by import arithmetic, deciding_code
from logs.disk import Appended
from logs.explain.phrases import sentence
from logs.records import entry_of
from logs.timeline import Timeline
from world_models import words
from world_models.files.toml.mission import ROOT
from world_models.frames import Pose2

SHORT = ["--set", "limits.max_cycles=40"]


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A mission that was given 40 cycles, in 6 of which an act only asks for locale frames, and its trace."""
    out, printed = tmp_path_factory.mktemp("runs") / "short", io.StringIO()
    with redirect_stdout(printed):
        assert main(["run", "lab-to-allens-office", *SHORT, "--out", str(out), "--trace"]) == 1
    return out, printed.getvalue()


@pytest.fixture(scope="module")
def run(told: tuple[Path, str]) -> Path:
    return told[0]


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """Two seeds of the same, and what was printed."""
    out, printed, progress = tmp_path_factory.mktemp("runs") / "both", io.StringIO(), io.StringIO()
    with redirect_stdout(printed), redirect_stderr(progress):
        assert main(["run", "lab-to-allens-office", *SHORT, "--seed", "0..1", "--out", str(out)]) == 1
    return out, printed.getvalue(), progress.getvalue()


def test_a_run_leaves_its_files(run: Path) -> None:
    assert sorted(p.name for p in run.iterdir()) == [
        "camera.mjpeg", "journal.jsonl", "recording.rrd", "result.json", "run.json"]
    assert json.loads((run / "result.json").read_text())["outcome"] == "failed"
    head = json.loads((run / "run.json").read_text())
    assert (head["kind"], head["name"], head["seed"]) == ("simulator", "lab-to-allens-office", 0)
    assert head["scenario"]["limits"] == {"max_cycles": 40}


def test_without_a_recording_it_decides_the_same_and_is_drawn_later(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert main(["run", "lab-to-allens-office", *SHORT, "--no-recording", "--out", str(out)]) == 1
    assert f"recording     none; harvey repair {out} draws it" in capsys.readouterr().out
    assert not (out / "recording.rrd").exists()
    assert (out / "journal.jsonl").read_bytes() == (run / "journal.jsonl").read_bytes()
    assert main(["repair", str(out)]) == 0
    assert read_decisions(out / "recording.rrd") == read_decisions(run / "recording.rrd")


def test_why_goes_down_to_the_command(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(run), "motorcommand-1", "--depth", "99"]) == 0
    out = capsys.readouterr().out
    assert "Harvey was told to turn" in out
    assert "made from match LineMatch-" in out
    assert "MotorCommand-1.0: turn" in out
    assert "the user asked for (ptrans (robot-laboratory (16,2,0))" in out
    assert "CameraPicture-1.0: picture of 0.1 s into the run; to verify a milestone" in out


def test_why_at_a_cycle_tells_what_it_did(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(run), "--at", "1"]) == 0
    out = capsys.readouterr().out
    assert "chooses   interpreter (goal) on Command-1.0" in out
    assert "Decided in cycle 1 by the interpreter" in out
    assert main(["why", str(run), "--at", "1000"]) == 2
    assert "cycles 1 to" in capsys.readouterr().err


def test_an_unknown_entry_is_answered_with_near_ones(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(run), "MotrCommand-1"]) == 2
    assert "MotorCommand-1" in capsys.readouterr().err


def test_every_kind_of_entry_has_its_own_sentence(run: Path) -> None:
    records = [r for d in Timeline(run / "journal.jsonl").decisions() for r in (*d.observed, *d.made)]
    assert len({r.type for r in records}) >= 15
    for record in records:
        said = words.sentence(entry_of(record, load_kinds()).value)
        assert len(said) > 5 and sentence(record).startswith(said)


def test_replay_decides_the_same_to_the_byte(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(run)]) == 0
    decisions = sum(1 for _ in read_journal(run / "journal.jsonl"))
    assert f"{decisions} decisions decided again" in capsys.readouterr().out


def copied(run: Path, to: Path, *, journal: str) -> Path:
    """The run with another journal."""
    to.mkdir()
    for name in ("camera.mjpeg", "recording.rrd", "result.json", "run.json"):
        (to / name).write_bytes((run / name).read_bytes())
    (to / "journal.jsonl").write_text(journal, encoding="utf-8", newline="\n")
    return to


def test_replay_finds_a_journal_that_was_tampered_with(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = (run / "journal.jsonl").read_text().splitlines(keepends=True)
    changed = next(number for number, line in enumerate(lines) if '"rating":0.8' in line)
    lines[changed] = lines[changed].replace('"rating":0.8', '"rating":0.7')
    assert main(["replay", str(copied(run, tmp_path / "forged", journal="".join(lines)))]) == 1
    out = capsys.readouterr().out
    assert f"agree for {changed} decisions." in out
    assert "rated 0.7" in out and "rated 0.8" in out
    assert "decided by the same code as this" in out


def test_replay_refuses_pictures_that_the_journal_did_not_see(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = (run / "journal.jsonl").read_text()
    seen = journal.partition('"sha256":"')[2][:64]
    forged = copied(run, tmp_path / "forged", journal=journal.replace(seen, "0" * 64))
    assert main(["replay", str(forged)]) == 2
    err = capsys.readouterr().err
    assert "camera.mjpeg, bytes 0 to" in err
    assert "another one for number 0" in err


@pytest.mark.parametrize("left", [0, 5000])
def test_replay_names_a_camera_file_that_is_too_short(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], left: int
) -> None:
    short = copied(run, tmp_path / "short", journal=(run / "journal.jsonl").read_text())
    pictures = (short / "camera.mjpeg").read_bytes()
    (short / "camera.mjpeg").write_bytes(pictures[:left])
    told = rf"camera.mjpeg: expected (\d+) bytes of pictures that the journal tells of, got {left}"
    for more in ([], ["--without", "plan_adjuster", "--record-only"]):
        assert main(["replay", str(short), *more]) == 2
        found = re.search(told, capsys.readouterr().err)
        assert found is not None and left < int(found[1]) <= len(pictures)  # the last may have come after the end


def test_a_run_that_was_cut_off_says_so_first(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (run / "journal.jsonl").read_text().splitlines(keepends=True)
    cut = str(copied(run, tmp_path / "cut", journal="".join(lines[:20]) + lines[20][:9]))
    assert main(["why", cut]) == 0
    assert capsys.readouterr().out.startswith(
        f"The run was cut off in cycle 20, before it had an outcome: harvey resume {cut} goes on with it.\n")
    assert main(["why", cut, "--json"]) == 0
    told = capsys.readouterr()
    assert "cut off in cycle 20" in told.err
    assert json.loads(told.out)[0]["ref"]
    for asked in ([str(run)], [cut, "CameraPicture-1"], [cut, "--at", "3"]):
        assert main(["why", *asked]) == 0
        assert "cut off" not in "".join(capsys.readouterr())


def test_a_run_that_is_still_driven_is_not_called_cut_off(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = (run / "journal.jsonl").read_text().splitlines(keepends=True)
    driven = copied(run, tmp_path / "driven", journal="".join(lines[:20]))
    journal = driven / "journal.jsonl"
    writer = Appended(journal, "journal", keep=journal.stat().st_size)
    assert main(["why", str(driven)]) == 0
    assert capsys.readouterr().out.startswith("The run is still going on, in cycle 20 or later.\n")
    writer.close()
    assert main(["why", str(driven)]) == 0
    assert capsys.readouterr().out.startswith("The run was cut off in cycle 20")


def headed(run: Path, to: Path, **head: Any) -> Path:
    """The run with something else at its head."""
    again = copied(run, to, journal=(run / "journal.jsonl").read_text())
    (again / "run.json").write_text(json.dumps(json.loads((run / "run.json").read_text()) | head))
    return again


@pytest.mark.parametrize(("head", "words", "set_differently"), [
    ({"harvey": "0.0.1"}, "was decided by version 0.0.1 of harvey, and this is", "decided by"),
    ({"code": "0123456789abcdef"}, "was decided by other code than this (0123456789abcdef by its run.json, and here",
     "decided by"),
    ({"arithmetic": "abacus"}, "was calculated on another processor (abacus, and this is",
     "calculated on different processors"),
])
def test_a_run_of_another_program_is_called_that(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], head: dict[str, str], words: str,
    set_differently: str,
) -> None:
    """A note where nothing differs; where something does, that may be why."""
    other = headed(run, tmp_path / "other", **head)
    assert main(["replay", str(other)]) == 0
    assert words in capsys.readouterr().out
    assert main(["diff", str(run), str(other)]) == 0
    out = capsys.readouterr().out
    assert f"note: the second run {words}" in out
    assert "first run was" not in out
    assert set_differently in out.partition("set differently: ")[2]
    text = (other / "journal.jsonl").read_text()
    (other / "journal.jsonl").write_text(text.replace('"rating":0.8', '"rating":0.7', 1))
    assert main(["replay", str(other)]) == 1
    assert f"The run {words}" in capsys.readouterr().out
    assert main(["resume", str(other)]) == 1  # it has an outcome
    lines = text.splitlines(keepends=True)
    (other / "journal.jsonl").write_text("".join(lines[:20]).replace('"rating":0.8', '"rating":0.7', 1))
    assert main(["resume", str(other)]) == 2
    err = capsys.readouterr().err
    assert f"note: the run {words}" in err
    assert "is not decided again as it was" in err


def test_diff_names_each_setting_that_differs_once_and_nothing_else(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    head = json.loads((run / "run.json").read_text())
    scenario = {**head["scenario"], "servo": {"goal": False}}
    other = headed(run, tmp_path / "other", scenario=scenario, servo={**head["servo"], "goal": False})
    text = (other / "journal.jsonl").read_text()
    (other / "journal.jsonl").write_text(text.replace('"rating":0.8', '"rating":0.7', 1))
    assert main(["diff", str(run), str(other)]) == 1
    out = capsys.readouterr().out
    assert "set differently: servo.goal: True against False; scenario.servo.goal: nothing against False\n" in out
    assert out.count("scenario.servo.goal") == 1 and "description" not in out


def test_a_run_that_is_older_than_the_names_of_its_code_and_arithmetic_is_read(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    older = headed(run, tmp_path / "older")
    data = json.loads((older / "run.json").read_text())
    assert data.pop("code") == deciding_code()
    assert data.pop("arithmetic") == arithmetic()
    (older / "run.json").write_text(json.dumps(data))
    assert main(["replay", str(older)]) == 0
    assert "note" not in capsys.readouterr().out
    assert main(["diff", str(run), str(older)]) == 0
    assert "decided by" not in capsys.readouterr().out
    text = (older / "journal.jsonl").read_text()
    (older / "journal.jsonl").write_text(text.replace('"rating":0.8', '"rating":0.7', 1))
    assert main(["replay", str(older)]) == 1
    assert "The program may have changed since the run was made" in capsys.readouterr().out


@pytest.mark.parametrize("head", [None, "{", "[]", '{"kind": "simulator"}'])
def test_diff_names_a_head_that_cannot_be_read(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], head: str | None
) -> None:
    spoilt = copied(run, tmp_path / "spoilt", journal=(run / "journal.jsonl").read_text())
    (spoilt / "run.json").unlink()
    if head is not None:
        (spoilt / "run.json").write_text(head)
    for pair in ((run, spoilt), (spoilt, run)):
        assert main(["diff", *map(str, pair)]) == 2
        assert f"{spoilt / 'run.json'}: expected" in capsys.readouterr().err


def test_diff_names_the_first_decision_that_differs(
    run: Path, both: tuple[Path, str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["diff", str(run), str(both[0] / "0")]) == 0
    assert "agree in all" in capsys.readouterr().out
    assert main(["diff", str(run), str(both[0] / "1")]) == 1
    out = capsys.readouterr().out
    assert "agree for 15 decisions." in out
    assert "The first observation that differs is CameraPicture-1.0" in out
    assert "seed: 0 against 1" in out


def test_trace_prints_every_cycle(told: tuple[Path, str]) -> None:
    printed = told[1]
    assert [f"\n{n:5}  " in f"\n{printed}" for n in range(1, 31)] == [True] * 30
    assert "posted Goal-1.0" in printed


def test_the_check_foresees_the_milestones_that_come(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "lab-to-allens-office", "--check"]) == 0
    out = capsys.readouterr().out
    rows = [line for line in out.splitlines() if line.endswith("clear")]
    assert len(rows) >= 10
    assert "ends: reached" in out
    came = [r.fields for d in Timeline(run / "journal.jsonl").decisions() for r in d.made
            if r.type == "Milestone" and r.fields["status"] == "verified"]
    assert len(came) >= 2
    for row, milestone in zip(rows, came, strict=False):
        assert row.startswith(f"{milestone['what']} ")
        assert f" {len(milestone['expected'])} " in row


def test_a_plan_whose_milestones_show_nothing_fails_the_check(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "lab-to-allens-office", "--check", "--set", "camera.mount_tilt_deg=85"]) == 1
    table, _, summary = capsys.readouterr().out.partition("the dry run of lab-to-allens-office ")
    unseen = table.count("not testable")
    assert unseen > 0
    assert summary.startswith("may not reach its goal: of ") and f"{unseen} milestones not testable" in summary
    assert "verified" not in summary


def test_several_seeds_make_a_table_and_workers_do_not_matter(run: Path, both: tuple[Path, str, str]) -> None:
    out, printed, progress = both
    assert "0 of 2 reached" in printed
    assert "2 of 2: " in progress
    assert (run / "journal.jsonl").read_bytes() == (out / "0" / "journal.jsonl").read_bytes()


def test_a_mistake_in_a_worker_comes_back(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(BadInput, match="servo"):
        list(map_cases(run_task, [Task("bump", (("servo.acton", "off"),), 0, tmp_path)], Workers(1)))


STOPS = [(KeyboardInterrupt, 130, "interrupted"), (Terminated, 143, "terminated")]


@pytest.mark.parametrize(("raised", "code", "word"), STOPS)
def test_being_stopped_is_told_in_a_line(
    raised: type[BaseException], code: int, word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stopped(*_args: object, **_kwargs: object) -> None:
        raise raised

    here = Pose2(0.0, 0.0, 0.0)
    monkeypatch.setattr("harvey.campaign.mission_task.run_mission", stopped)
    monkeypatch.setattr("harvey.campaign.mission_task.build_stage", lambda scenario: SimpleNamespace(
        scenario=scenario, world=None, start_world=here, goal_world=here))
    assert main(["run", "bump", "--out", str(tmp_path / "run")]) == code
    assert word in capsys.readouterr().err


def test_sigterm_closes_the_recording(tmp_path: Path) -> None:
    out = tmp_path / "run"
    argv = [sys.executable, "-m", "harvey.cli", "run", "lab-to-allens-office", "--out", str(out)]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(argv, stderr=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stderr is not None
        begun, first = process.stderr.readline(), process.stderr.readline()
        process.send_signal(signal.SIGTERM)
        rest = process.stderr.read()
    assert "lab-to-allens-office seed 0" in begun
    assert "1 milestone verified" in first
    assert process.returncode == 143
    assert rest.endswith(f"harvey: terminated; what was recorded is kept; harvey resume {out} goes on with it\n")
    assert "Traceback" not in rest
    assert json.loads((out / "result.json").read_text())["outcome"] == "unfinished"
    journal = list(read_journal(out / "journal.jsonl"))
    assert len(journal) >= 7
    assert len(read_decisions(out / "recording.rrd")) >= len(journal) - 1


def test_seeds_and_settings_are_read() -> None:
    assert parse_seeds("3") == (3,)
    assert parse_seeds("0..4") == (0, 1, 2, 3, 4)
    assert parse_seeds("7,1..2,7") == (7, 1, 2)
    assert parse_pairs(["a.b=off", "goal=(x=1)"]) == (("a.b", "off"), ("goal", "(x=1)"))


def test_a_mission_by_a_relative_name_is_asked_and_goes_on_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("flat.toml", "flat-sim.toml"):
        (tmp_path / name).write_text((ROOT / "docs" / "flat" / name).read_text())
    monkeypatch.chdir(tmp_path)
    assert main(["run", "flat-sim.toml", *SHORT, "--out", "made"]) == 1
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert main(["replay", "../made"]) == 0
    assert main(["replay", "../made", "--set", "plan.max_leg_m=0.4"]) == 0
    assert "the simulated robot went on by itself" in capsys.readouterr().out
    whole = (tmp_path / "made" / "journal.jsonl").read_bytes()
    (tmp_path / "made" / "journal.jsonl").write_bytes(whole[:len(whole) // 2])
    assert main(["resume", "../made"]) == 1
    assert (tmp_path / "made" / "journal.jsonl").read_bytes().startswith(whole[:len(whole) // 2].rpartition(b"\n")[0])
