"""Results of experiments that are kept: what stands in them, and when they are stale."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from docs.tools import status
from experiments import results
from experiments.report import Finding, Report
from experiments.results import (
    Result,
    build_result,
    count_commits_since,
    find_commit,
    is_stale,
    read_results,
    write_result,
)
from harvey.cli import main

CLAIMS: tuple[tuple[str, Finding], ...] = (("at least 9 of 10: 7 of 10", "fails"), ("none lost", "proved"))
REPORT = Report("Doors", ("what", "ours"), (("a", 1),), claims=CLAIMS)
OLD = Result("doors", "Doors", "--quick", 3, "2001-01-01T00:00:00+00:00", 1.0, "0123abcd", CLAIMS)


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the project with three commits to its code and one to its documents."""
    monkeypatch.setattr(results, "ROOT", tmp_path)
    git(tmp_path, "init", "-q")
    for name in ("sim/a.py", "sim/b.py", "docs/c.md", "harvey/d.py"):
        change(tmp_path / name)
        git(tmp_path, "add", "-A")
        git(tmp_path, "-c", "user.name=x", "-c", "user.email=x@y", "commit", "-qm", name)
    return tmp_path


def git(where: Path, *words: str) -> None:
    subprocess.run(["git", "-C", where, *words], check=True, capture_output=True)


def change(path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text("changed\n", encoding="utf-8")


def test_a_result_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    made = build_result("doors", REPORT, "--quick", 3, 61.26)
    write_result(made, tmp_path / "doors.json")
    assert list(read_results(tmp_path)) == [made]
    assert made.claims == CLAIMS and made.seconds == 61.3


def test_a_result_is_stale_when_many_commits_have_changed_the_code_since(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert count_commits_since(OLD.date) == 3  # documents are not counted
    assert not is_stale(OLD)
    monkeypatch.setattr(results, "STALE_AFTER", 2)
    assert is_stale(OLD)
    assert not is_stale(replace(OLD, date="2099-01-01T00:00:00+00:00"))


def test_a_commit_has_a_plus_where_the_code_was_changed_since(repository: Path) -> None:
    commit = find_commit()
    assert len(commit) == 8
    change(repository / "docs" / "c.md")
    (repository / "docs" / "c.md").write_text("other\n", encoding="utf-8")
    assert find_commit() == commit
    (repository / "sim" / "a.py").write_text("other\n", encoding="utf-8")
    assert find_commit() == f"{commit}+"


def test_nothing_is_known_of_a_copy_without_history(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results, "ROOT", tmp_path)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert find_commit() == "" and count_commits_since(OLD.date) is None and not is_stale(OLD)


def test_the_table_says_what_failed_what_was_not_driven_and_what_is_stale(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_result(OLD, tmp_path / "doors.json")
    monkeypatch.setattr(status, "RESULTS", tmp_path)
    monkeypatch.setattr(status, "is_stale", lambda result: True)
    lines = status.describe_experiments().splitlines()
    assert lines[0].endswith("Of 2 claims 1 are proved, 0 are not contradicted, 1 fail.")
    row = next(line for line in lines if "7 of 10" in line)
    assert row.startswith("| `doors` | at least 9 of 10: 7 of 10 | **fails** |")
    assert "| `--quick --seed 3`, 2001-01-01, 0123abcd; **stale**" in row
    assert any(line.startswith("| `soak` |") and "not driven" in line for line in lines)


def test_rows_stand_in_a_document_as_they_were_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = (("60% wrong: a|b", 0.123456, None), ("70% wrong", 3, "x"))
    made = replace(OLD, columns=("what", "ours", "peer"), rows=rows)
    write_result(made, tmp_path / "doors.json")
    assert list(read_results(tmp_path)) == [made]
    monkeypatch.setattr(status, "RESULTS", tmp_path)
    head, _, columns, _, row = status.describe_rows("doors", "60%").splitlines()
    assert head == "`harvey experiment doors --quick`, 2001-01-01, commit 0123abcd:"
    assert (columns, row) == ("| what | ours | peer |", r"| 60% wrong: a\|b | 0.1235 | - |")


def test_the_command_writes_what_it_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "figure12.json"
    assert main(["experiment", "figure12", "--out", str(out)]) == 0
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["experiment"] == "figure12" and found["claims"] and {word for _, word in found["claims"]} == {"proved"}
    assert main(["experiment", "figure12", "--out", str(tmp_path / "nowhere" / "x.json")]) == 2
    assert "nowhere" in capsys.readouterr().err
