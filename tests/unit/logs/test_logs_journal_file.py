"""The journal on disk: written before anything follows, read back line by line."""

from pathlib import Path

import pytest

from blackboard import Decision, decision_line, decision_record
from journals import read_journal
from logs.journal_file import HELD_LINES, JournalFile, is_acted_on
from scripted_mission import play


def play_to(path: Path, *, sync: bool = False) -> list[Decision]:
    decisions: list[Decision] = []
    journal = JournalFile(path, sync=sync)
    play([journal, decisions.append])
    journal.close()
    return decisions


@pytest.mark.parametrize("sync", [False, True])
def test_every_decision_comes_back(tmp_path: Path, sync: bool) -> None:
    decisions = play_to(tmp_path / "journal.jsonl", sync=sync)
    assert decisions
    assert list(read_journal(tmp_path / "journal.jsonl")) == [decision_record(d) for d in decisions]


def test_what_is_not_in_the_file_follows_from_what_is(tmp_path: Path) -> None:
    """Held back are only decisions after the last that took up an observation, or on which a port acts."""
    path = tmp_path / "journal.jsonl"
    decisions: list[Decision] = []
    held: list[int] = []

    def sink(decision: Decision) -> None:
        decisions.append(decision)
        there = path.read_text().splitlines()
        assert there == [decision_line(d) for d in decisions[: len(there)]]
        late = decisions[len(there):]
        assert not any(d.observed or is_acted_on(d) for d in late)
        held.append(len(late))

    play([JournalFile(path), sink])
    assert 0 < max(held) < HELD_LINES and 0 in held


def test_what_is_held_back_is_not_much(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    journal, decisions = JournalFile(path, sync=False), []
    play([decisions.append])
    silent = decisions[0]._replace(observed=(), made=())
    for number in range(1, 3 * HELD_LINES + 2):
        journal(silent._replace(cycle=number))
        assert len(path.read_bytes().splitlines()) == number // HELD_LINES * HELD_LINES
    journal.close()
    assert [d["cycle"] for d in read_journal(path)] == list(range(1, 3 * HELD_LINES + 2))


def test_what_is_drawn_is_told_in_the_words_of_the_journal(tmp_path: Path) -> None:
    """Every reader of a line gets it, and the file has the same lines in the same order."""
    path = tmp_path / "journal.jsonl"
    journal = JournalFile(path)
    drawn: list[str] = []
    play([journal, lambda decision: drawn.append(journal.line(decision))])
    journal.close()
    assert path.read_text().splitlines() == drawn


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
    decisions = play_to(path)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + lines[1][:9])
    journal = JournalFile(path, keep=len(lines[0]))
    for decision in decisions[1:]:
        journal(decision)
    journal.close()
    assert path.read_bytes() == b"".join(lines)


def test_a_full_disk_is_told_with_the_name_of_the_file() -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")
    with pytest.raises(OSError, match=r"cannot write the journal.*No space left.*/dev/full"):
        play([JournalFile(full)])
