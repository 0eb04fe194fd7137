"""The command line with input that cannot be used: one sentence and exit code 2, never a traceback."""

from __future__ import annotations

import gc
import json
import socket
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from harvey.cli import GC_THRESHOLDS, main
from harvey.commands import MODULES
from harvey.commands.world_command import VERBS
from logs.run_directory import JOURNAL_VERSION, check_version, prepare_directory
from sim.scenario import SCENARIOS
from world_models.entries import Outcome

DECISION = {"cycle": 1, "focus": "action", "observed": [], "seen": [], "activated": [], "obviated": [], "chosen": None,
            "runner_up": None, "pending": 0, "made": [], "refused": ""}

HEAD = {"kind": "simulator", "name": "bump", "seed": 0, "world": "", "world_sha256": "", "robot": {}, "servo": {},
        "command": {}, "without": [], "constants": [], "scenario": {}, "folder": "", "body": "simulated",
        "harvey": version("harvey"), "journal_version": JOURNAL_VERSION}


SMALL_WORLD = """name = "cottage"
units = "feet"
[finishes]
brown = { colour = [0.5, 0.3, 0.2] }
[parts]
table = [ { x = [0, 3], y = [0, 2], z = [0, 2.5], finish = "brown" } ]
[locales.kitchen]
kind = "room"
size = [10, 8]
things = [ { part = "table", at = [4, 3] } ]
[locales.hall]
kind = "room"
at = [10.5, 0]
outline = [[0, 0], [6, 0], [6, 8], [0, 8]]
[doors]
kitchen-door = { between = ["kitchen", "hall"], wall = "east", along = 4, open = true }
"""


def journalled(folder: Path, *lines: str | bytes) -> str:
    """A run directory with this journal."""
    folder.mkdir(exist_ok=True)
    (folder / "run.json").write_text(json.dumps(HEAD))
    (folder / "journal.jsonl").write_bytes(b"".join(
        (line.encode() if isinstance(line, str) else line) + b"\n" for line in lines))
    return str(folder)


def said(capsys: pytest.CaptureFixture[str], argv: list[str]) -> tuple[int, str]:
    code = main(argv)
    return code, capsys.readouterr().err


@pytest.mark.parametrize(("argv", "told"), [
    (["run", "lab-to-alens-office"], "lab-to-allens-office"),
    (["run", "lab-to-alens-office", "--check"], "lab-to-allens-office"),
    (["run", "nowhere/mission.toml"], "No such file"),
    (["run", "bump", "--seed", "5..2"], "0..19"),
    (["run", "bump", "--seed", "-1"], "--seed"),
    (["run", "bump", "--seed", "x"], "'x'"),
    (["run", "bump", "--seed", "0..99999999"], "--seed"),
    (["run", "bump", "--set", "servo.action"], "key=value"),
    (["run", "bump", "--set", "=off"], "key=value"),
    (["run", "bump", "--set", "servo.acton=off"], "servo.action"),
    (["run", "bump", "--set", "servo.action=maybe"], "true or false"),
    (["run", "bump", "--set", "limits.max_cycles=-3"], "above 0"),
    (["run", "bump", "--seed", "0..1", "--trace"], "one seed"),
    (["run", "bump", "--nonsense"], "--nonsense"),
    (["run", "bump", "--check", "--live"], "--check: expected it without --live"),
    (["run", "bump", "--check", "--go-on"], "--check: expected it without --go-on"),
    (["run", "."], "scenario: expected a name or a TOML file, got the directory ."),
    (["emulate", "denning", "--scenario", "bump", "--camera-port", "99999"], "expected a port from 0 to 65535"),
    (["view", "nowhere"], "does not exist"),
    (["why", "nowhere"], "does not exist"),
    (["replay", "nowhere"], "does not exist"),
    (["diff", "nowhere", "nowhere"], "does not exist"),
    (["why", "runs", "--at", "soon"], "soon"),
    (["why", "runs", "--depth", "-1"], "--depth"),
    (["world", "check", "nowhere.toml"], "No such file"),
    (["world", "check", "nowhere"], "research_center"),
    (["experiment", "levles"], "levels"),
    (["experiment", "levels", "--seed", "-4"], "--seed"),
    (["nonsense"], "invalid choice"),
    ([], "COMMAND"),
])
def test_bad_input_is_named(argv: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
                            monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    code, err = said(capsys, argv)
    assert code == 2
    assert told in err


def test_a_scenario_that_is_not_there_is_named_before_anything_begins(capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, ["run", "nosuch"])[1].startswith("harvey: scenario: expected one of")
    assert gc.get_threshold() != GC_THRESHOLDS, "the process goes on with its own"


def test_a_port_in_use_is_named_before_a_base_is_there(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["emulate", "denning", "--scenario", "bump", "--camera-port", port]) == 2
    out, err = capsys.readouterr()
    told = f"harvey: --camera-port {port}: expected a free port, got: Address already in use\n"
    assert out == "" and err.endswith(told)


@pytest.mark.parametrize("argv", [["why"], ["why", "--check"], ["why", "--at", "1"]])
@pytest.mark.parametrize("journal", [b"\0" * 3000, b'{"cycle":' + b"1" * 6000 + b',"focus":"plan"}\n',
                                     b'{"cycle":1,"pending":' + b"1" * 6000 + b"}\n"])
def test_a_journal_that_is_none_is_refused(
    argv: list[str], journal: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "journal.jsonl").write_bytes(journal)
    code, err = said(capsys, [argv[0], str(tmp_path), *argv[1:]])
    assert code == 2 and err.count("\n") == 1


@pytest.mark.parametrize("command", MODULES)
def test_every_command_teaches_by_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    out = capsys.readouterr().out
    assert f"harvey {command}" in out.partition("examples:")[2]


@pytest.mark.parametrize("verb", [verb.name for verb in VERBS])
def test_every_verb_of_world_teaches_by_example(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["world", verb, "--help"]) == 0
    assert f"harvey world {verb}" in capsys.readouterr().out.partition("examples:")[2]


def test_a_verb_refuses_the_options_of_another(capsys: pytest.CaptureFixture[str]) -> None:
    code, err = said(capsys, ["world", "check", "two_ways", "--out", "plan.svg"])
    assert code == 2 and "harvey world check: expected no '--out' here" in err


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"harvey {version('harvey')}\n"


def test_the_list_names_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    out = capsys.readouterr().out
    assert "lab-to-allens-office" in out
    assert "Figure 17" in out
    assert "levels" in out


@pytest.mark.parametrize(("line", "told"), [
    ("{", "JSON"),
    ("[1]", "JSON object"),
    (b"\xff\xfe", "journal.jsonl:2"),
    ('{"cycle": 2}', "'focus'"),
    (json.dumps({**DECISION, "cycle": "two"}), "cycle"),
    (json.dumps({**DECISION, "cycle": 2, "made": [3]}), "'change'"),
    (json.dumps({**DECISION, "cycle": 2, "seen": [3]}), "seen"),
    (json.dumps({**DECISION, "cycle": 2, "chosen": {"number": 1}}), "'source'"),
    ("[" * 100_000, "journal.jsonl:2"),
])
def test_a_corrupt_line_of_a_journal_is_named(
    line: str | bytes, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = journalled(tmp_path / "run", json.dumps(DECISION), line)
    for argv in (["why", run], ["diff", run, run]):
        code, err = said(capsys, argv)
        assert code == 2
        assert "journal.jsonl:2" in err
        assert told in err


@pytest.mark.parametrize(("cycles", "told"), [
    ((1, 2, 2, 3), "journal.jsonl:3: expected cycle 3, got 2 (a line is there twice"),
    ((1, 3, 4), "journal.jsonl:2: expected cycle 2, got 3 (a line is missing"),
    ((2, 3), "journal.jsonl:1: expected cycle 1, got 2 (a line is missing"),
])
@pytest.mark.parametrize("spaces", [False, True])
def test_a_line_that_is_missing_or_there_twice_is_named(
    cycles: tuple[int, ...], told: str, spaces: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """However the lines are written; every cycle has its line."""
    written = (", ", ": ") if spaces else (",", ":")
    run = journalled(tmp_path / "run", *(json.dumps({**DECISION, "cycle": n}, separators=written) for n in cycles))
    before = (tmp_path / "run" / "journal.jsonl").read_bytes()
    for argv in (["why", run], ["diff", run, run], ["replay", run], ["resume", run], ["repair", run]):
        code, err = said(capsys, argv)
        assert code == 2
        assert told in err, argv
    assert (tmp_path / "run" / "journal.jsonl").read_bytes() == before


def test_a_line_that_was_cut_off_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = journalled(tmp_path / "whole", json.dumps(DECISION))
    cut = journalled(tmp_path / "cut", json.dumps(DECISION))
    with (tmp_path / "cut" / "journal.jsonl").open("ab") as file:
        file.write(b'{"cycle": 2, "foc')
    assert main(["diff", whole, cut]) == 0
    assert "all of their 1 decision" in capsys.readouterr().out


def test_an_empty_journal_is_no_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, err = said(capsys, ["why", journalled(tmp_path / "run")])
    assert code == 2
    assert "journal.jsonl: expected at least one decision, got none" in err


def test_a_directory_of_runs_is_told_apart_from_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    journalled(tmp_path / "3", json.dumps(DECISION))
    code, err = said(capsys, ["why", str(tmp_path)])
    assert code == 2
    assert str(tmp_path / "3") in err


def test_a_run_does_not_overwrite_other_things(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    for out in (tmp_path, tmp_path / "thesis.tex", tmp_path / "thesis.tex" / "below"):
        code, err = said(capsys, ["run", "bump", "--out", str(out)])
        assert code == 2
        assert "thesis.tex" in err
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def headed(folder: Path, name: str, seed: int) -> str:
    """A run directory that says of what scenario and seed it is."""
    (Path(journalled(folder, json.dumps(DECISION))) / "run.json").write_text(json.dumps({"name": name, "seed": seed}))
    return str(folder)


def test_a_run_of_something_else_is_moved_aside_and_one_of_the_same_goes(tmp_path: Path) -> None:
    headed(tmp_path / "kept", "bump", 3)
    assert prepare_directory(tmp_path / "kept", "bump", 4) == (tmp_path / "kept", tmp_path / "kept-older-1")
    headed(tmp_path / "kept", "hallway-kidnap", 4)
    assert prepare_directory(tmp_path / "kept", "bump", 4) == (tmp_path / "kept", tmp_path / "kept-older-2")
    headed(tmp_path / "kept", "bump", 4)
    assert prepare_directory(tmp_path / "kept", "bump", 4) == (tmp_path / "kept", None)
    assert not any((tmp_path / "kept").iterdir())
    for number, name in ((1, "bump"), (2, "hallway-kidnap")):
        assert json.loads((tmp_path / f"kept-older-{number}" / "run.json").read_text())["name"] == name
        assert (tmp_path / f"kept-older-{number}" / "journal.jsonl").exists()


def test_no_run_is_put_into_another(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = headed(tmp_path / "one", "bump", 0)
    code, err = said(capsys, ["run", "bump", "--seed", "0..1", "--out", run])
    assert code == 2 and f"got one in the run {run}" in err


def test_what_would_have_been_does_not_replace_what_was(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = headed(tmp_path / "one", "bump", 0)
    code, err = said(capsys, ["replay", run, "--set", "servo.plan=off", "--out", f"{run}/../one"])
    assert code == 2 and "another directory" in err
    assert (tmp_path / "one" / "journal.jsonl").exists()


@pytest.mark.parametrize("command", ["view", "why", "replay", "resume"])
def test_what_is_no_run_is_not_taken_for_its_neighbours(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    headed(tmp_path / "one", "bump", 0)
    code, err = said(capsys, [command, str(tmp_path / "oen")])
    assert code == 2 and "does not exist" in err
    (tmp_path / "notes.txt").write_text("of my own")
    code, err = said(capsys, [command, str(tmp_path / "notes.txt")])
    assert code == 2 and "expected a run directory or a file of one" in err


@pytest.mark.parametrize(("key", "value"), [("milestones", 3), ("outcome", 7), ("final_error_m", "far")])
def test_a_result_of_other_types_is_named(
    key: str, value: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [headed(tmp_path / name, "bump", 0) for name in ("one", "two")]
    (tmp_path / "one" / "result.json").write_text(json.dumps({key: value}))
    code, err = said(capsys, ["report", *runs, "--out", str(tmp_path / "both.html")])
    assert code == 2 and f"{tmp_path / 'one' / 'result.json'}: {key}: expected" in err


def test_a_recording_is_not_opened_where_there_is_no_screen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    (tmp_path / "recording.rrd").write_bytes(b"RRF2")
    code, err = said(capsys, ["view", str(tmp_path)])
    assert code == 1
    assert str(tmp_path / "recording.rrd") in err


@st.composite
def damaged(draw: st.DrawFn, text: bytes) -> bytes:
    """Something like the text, with a few bytes lost, added, changed, or pieces swapped."""
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(text)))
        end = min(len(text), at + draw(st.sampled_from([0, 1, 3, 20, 200])))
        piece = draw(st.binary(max_size=3) | st.sampled_from([b"=", b"[", b"]", b'"', b"-1e99", b"nan"]))
        text = text[:at] + piece + text[end:]
    return text


MUTANTS = settings(deadline=None, max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])


@MUTANTS
@given(data=st.data())
def test_a_damaged_scenario_never_ends_in_a_traceback(
    data: st.DataObject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("harvey.campaign.mission_task.build_stage", lambda scenario: SimpleNamespace(scenario=scenario))
    monkeypatch.setattr("harvey.dry_run.dry_run", lambda *_known: ((), Outcome("reached", "")))
    file = tmp_path / "mission.toml"
    file.write_bytes(data.draw(damaged((SCENARIOS / "hallway-kidnap.toml").read_bytes())))
    assert main(["run", str(file), "--check"]) in (0, 2)


@MUTANTS
@given(data=st.data())
def test_a_damaged_world_never_ends_in_a_traceback(data: st.DataObject, tmp_path: Path) -> None:
    file = tmp_path / "world.toml"
    file.write_bytes(data.draw(damaged(SMALL_WORLD.encode())))
    assert main(["world", "check", str(file)]) in (0, 2)


@pytest.mark.parametrize("argv", [
    ["why", "RUN"], ["why", "RUN", "when was it lost?"], ["why", "RUN", "--not", "motor"], ["story", "RUN"],
    ["replay", "RUN"], ["replay", "RUN", "--without", "motor"], ["resume", "RUN"], ["repair", "RUN"],
    ["diff", "RUN", "RUN"], ["report", "RUN"], ["report", "RUN", "RUN"], ["view", "RUN"],
    ["export", "RUN", "--csv", "OUT"],
])
@pytest.mark.parametrize("older", [1, 2, 4, "3", None])
def test_a_journal_of_another_version_is_refused_by_all_who_read_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], argv: list[str], older: object
) -> None:
    """None: as the first version had it, which did not name one. Nothing is written."""
    run = Path(journalled(tmp_path / "run", json.dumps(DECISION)))
    check_version(run)
    (run / "run.json").write_text(json.dumps({key: value for key, value in HEAD.items() if key != "journal_version"} | (
        {} if older is None else {"journal_version": older})))
    before = sorted(tmp_path.rglob("*"))
    code, words = said(capsys, [{"RUN": str(run), "OUT": str(tmp_path / "out")}.get(word, word) for word in argv])
    got = 1 if older is None else older
    wanted = f"expected a run whose journal is of version {JOURNAL_VERSION}, got version {got}"
    assert code == 2 and wanted in words and words.count("\n") <= 1
    assert sorted(tmp_path.rglob("*")) == before
