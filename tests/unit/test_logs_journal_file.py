"""The journal on disk: written before anything follows, read back line by line."""

import json
from pathlib import Path

import pytest

from blackboard.journal import Decision, decision_line, decision_record
from logs import disk
from logs.journal_file import JournalError, JournalFile, read_journal
from rehearsal import play
from world_models.body import Look, MotorCommand


def played(path: Path, *, forced: bool = False) -> list[Decision]:
    decisions: list[Decision] = []
    journal = JournalFile(path, forced=lambda _decision: forced)
    play([journal, decisions.append])
    journal.close()
    return decisions


@pytest.mark.parametrize("forced", [False, True])
def test_every_decision_comes_back(tmp_path: Path, forced: bool) -> None:
    decisions = played(tmp_path / "journal.jsonl", forced=forced)
    assert decisions
    assert list(read_journal(tmp_path / "journal.jsonl")) == [decision_record(d) for d in decisions]


def test_a_line_is_in_the_file_before_the_next_sink_is_told(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    seen: list[bool] = []
    play([JournalFile(path), lambda d: seen.append(path.read_text().splitlines()[-1] == decision_line(d))])
    assert seen and all(seen)


def test_the_remembered_line_is_that_of_the_decision(tmp_path: Path) -> None:
    journal = JournalFile(tmp_path / "journal.jsonl")
    decisions: list[Decision] = []
    play([decisions.append])
    first, second = decisions[:2]
    journal(first)
    assert journal.line(second) == decision_line(second)
    assert journal.line(first) == decision_line(first)


def test_it_goes_on_behind_what_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    decisions = played(path)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + lines[1][:9])
    journal = JournalFile(path, keep=len(lines[0]))
    for decision in decisions[1:]:
        journal(decision)
    journal.close()
    assert path.read_bytes() == b"".join(lines)


def test_what_a_port_will_act_on_is_on_the_disk_before_it_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    forced: list[int] = []
    monkeypatch.setattr(disk.os, "fsync", forced.append)
    journal = JournalFile(tmp_path / "journal.jsonl")
    decisions: list[Decision] = []

    def sink(decision: Decision) -> None:
        before = len(forced)
        journal(decision)
        assert (len(forced) > before) == any(isinstance(c.entry.value, MotorCommand | Look) for c in decision.made)
        decisions.append(decision)

    play([sink])
    journal.close()
    assert 0 < len(forced) < len(decisions)


def test_a_truncated_last_line_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    count = len(played(path))
    path.write_bytes(path.read_bytes()[:-7])
    records = list(read_journal(path))
    assert len(records) == count
    assert records[-1] == {"truncated": count}


@pytest.mark.parametrize("line", ["{", "[1]", '{"cycle": "one"}', "\\xff"])
def test_a_malformed_line_is_named(tmp_path: Path, line: str) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_text(json.dumps({"cycle": 1}) + "\n" + line + "\n" + json.dumps({"cycle": 2}) + "\n")
    with pytest.raises(JournalError, match=r"journal\.jsonl:2: expected a"):
        list(read_journal(path))


def test_bytes_that_are_no_text_are_named(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_bytes(b"\xff\xfe\x00\n")
    with pytest.raises(JournalError, match=r"journal\.jsonl:1: expected a decision"):
        list(read_journal(path))


def test_a_full_disk_is_told_with_the_name_of_the_file() -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")
    with pytest.raises(OSError, match=r"cannot write the journal.*No space left.*/dev/full"):
        play([JournalFile(full)])
