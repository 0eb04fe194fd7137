"""``harvey story``: runs that cannot be told are one error, whatever stands in their files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blackboard import Decision, Level, decision_line
from harvey.cli import main
from harvey.errors import BadInput
from logs.explain.questions_in_words import answers
from logs.explain.story import LOST, MOST_ROWS, MilestoneRow, milestone_lines, story_lines, tell_part, tell_run
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from scripted_turns import decisions

LINES = tuple(decision_line(decision) + "\n" for decision in decisions())


def run_of(folder: Path, journal: bytes) -> RunDirectory:
    (folder / "journal.jsonl").write_bytes(journal)
    return RunDirectory(folder)


@pytest.mark.parametrize("journal", [b"", b"\x00" * 4096, b"\n", b"{}\n", b"[]\n", b"\xff\xfe\n", b'{"cycle": 1}\n',
                                     b'{"cycle":1,"focus":3}\n', b"not a journal\n", b"{" * 5000 + b"\n"])
def test_what_is_no_journal_is_one_error(tmp_path: Path, journal: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["story", str(run_of(tmp_path, journal).path)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert len(printed.err.splitlines()) == 1 and str(tmp_path) in printed.err


@pytest.mark.parametrize("result", ['{"contacts": [{}]}', '{"contacts": 3}', "[]", "{", '{"milestones": 3}',
                                    '{"final_error_m": "near"}', '{"contacts": [{"cycle": 99, "locale": "", "x_m": 0,'
                                    ' "y_m": 0}]}'])
def test_what_is_no_result_is_one_error(tmp_path: Path, result: str, capsys: pytest.CaptureFixture[str]) -> None:
    run = run_of(tmp_path, "".join(LINES).encode())
    run.result.write_text(result, encoding="utf-8")
    assert main(["story", str(run.path)]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and len(printed.err.splitlines()) == 1 and "result.json" in printed.err


@given(st.integers(0, len(LINES) - 1), st.binary(min_size=1, max_size=40))
def test_foreign_bytes_in_any_line_are_one_error_or_change_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, line: int, foreign: bytes
) -> None:
    lines = [text.encode() for text in LINES]
    lines[line] = foreign.replace(b"\n", b"") + b"\n"
    run = run_of(tmp_path_factory.mktemp("foreign"), b"".join(lines))
    with pytest.raises(BadInput):
        tell_run(run, Timeline(run.journal))


@given(st.integers(1, len(LINES)), st.integers(0, 50))
def test_a_run_is_told_up_to_where_it_was_cut_off(
    tmp_path_factory: pytest.TempPathFactory, whole: int, more: int
) -> None:
    rest = LINES[whole].encode()[:more] if whole < len(LINES) else b""
    run = run_of(tmp_path_factory.mktemp("cut"), "".join(LINES[:whole]).encode() + rest)
    history = Timeline(run.journal)
    story = tell_run(run, history)
    end = f"failed in cycle {whole}." if whole == len(LINES) else f"cut off in cycle {whole}."
    assert story.opening[0].endswith(end) and (history.cut_off is None) is (whole == len(LINES))
    assert {s.cycle for section in story.sections for s in section.steps} <= {None, *history.cycles}


def test_a_line_that_the_story_has_no_need_of_is_checked_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    idle = decision_line(Decision(9, (), (), Level.ACTION, (), (), None, None, 0, (), ""))
    whole = "".join(LINES) + idle + "\n"
    assert main(["story", str(run_of(tmp_path, whole.encode()).path)]) == 0
    run = run_of(tmp_path, whole.replace('"cycle":9,"', '"cycle":9,"x').encode())
    capsys.readouterr()
    assert main(["story", str(run.path)]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and "journal.jsonl:9" in printed.err and len(printed.err.splitlines()) == 1


def test_an_older_run_with_other_fields_is_one_error(tmp_path: Path) -> None:
    lines = [json.loads(line) for line in LINES]
    lines[1]["made"][0]["value"] = {"verdict": "refuted"}
    run = run_of(tmp_path, "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines).encode())
    with pytest.raises(BadInput):
        tell_run(run, Timeline(run.journal))


def test_lost_and_found_are_told_with_place_and_reason(tmp_path: Path) -> None:
    run = run_of(tmp_path, "".join(LINES).encode())
    told = [sentence.text for sentence in tell_part(Timeline(run.journal), LOST, {}).steps]
    assert told[0].startswith("It was lost: M2 is refuted. It believed that it stood at (1.00, 2.00) m of kitchen")
    assert told[-1].startswith("It found out where it was, 1 cycle later: at (3.00, 1.00) m of kitchen")
    assert "2.24 m from where it had believed" in told[-1]


def test_of_a_long_table_all_that_was_not_verified_is_shown() -> None:
    judged = ((n, "refuted" if n in (3, 40) else "verified") for n in range(1, 4 * MOST_ROWS))
    rows = tuple(MilestoneRow(n, None, f"M{n}", verdict, 9, 8, 0.1, 0.0, 0.5, 0.01, ()) for n, verdict in judged)
    lines = list(milestone_lines(rows))
    assert lines[0] == f"Of {len(rows)} these {MOST_ROWS // 2 + 2}; --json has them all."
    assert sum("refuted" in line for line in lines) == 2
    assert len(lines) == 3 + MOST_ROWS // 2 + 2
    assert len(list(milestone_lines(rows[:MOST_ROWS]))) == 2 + MOST_ROWS
    assert list(milestone_lines(())) == ["There was none."]


def test_the_page_has_every_section_once(tmp_path: Path) -> None:
    run = run_of(tmp_path, "".join(LINES).encode())
    story = tell_run(run, Timeline(run.journal))
    lines = "\n".join(story_lines(story)).splitlines()
    for title in ("Milestones", *(section.headline for section in story.sections)):
        assert lines.count(title) == 1
    assert [line for line in lines if len(line) > 120] == []


@pytest.mark.parametrize(("question", "answer"), [
    ("when was it lost?", "In cycle 4: It was lost: "), ("What did it hit?", "It felt no contact."),
    ("was the door found shut?", "No picture was judged to tell whether a door is shut."),
    ("what is in the way?", "Nothing that the model lacks was found in the way."),
    ("why did you stop?", "The mission ended: failed, because camera unplugged.")])
def test_a_question_of_the_run_is_known_by_its_words(tmp_path: Path, question: str, answer: str) -> None:
    run = run_of(tmp_path, "".join(LINES).encode())
    assert next(iter(answers(Timeline(run.journal), question, None, run))).headline.startswith(answer)


def test_of_a_run_without_its_head_nobody_knows_the_truth(tmp_path: Path) -> None:
    run = run_of(tmp_path, "".join(LINES).encode())
    with pytest.raises(BadInput, match=r"run\.json"):
        list(answers(Timeline(run.journal), "how far off was it in truth", None, run))
