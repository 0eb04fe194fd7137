"""The recording of a real mission in which things go wrong: everything that the journal has is in it."""

from __future__ import annotations

import json

import pytest
from jsonschema import Draft202012Validator

from docs.tools.site.journal import SCHEMA
from journals import read_decisions, read_journal
from logs.reader import read_frames, read_series
from logs.recording.paths import CHAPTERS, HARVEY, TABLE, WHY
from logs.run_directory import RunDirectory
from recorded_runs import Recorded


@pytest.fixture(scope="module")
def run(recorded: Recorded) -> RunDirectory:
    """Unplugged, pushed aside and kidnapped in the hallway."""
    return recorded("hallway")


def test_every_field_of_every_decision_is_in_the_recording(run: RunDirectory) -> None:
    from_journal, from_recording = list(read_journal(run.journal)), read_decisions(run.recording)
    assert len(from_journal) == len(from_recording) > 100
    for kept, drawn in zip(from_journal, from_recording, strict=True):
        assert kept.keys() == drawn.keys()
        for field, value in kept.items():
            assert drawn[field] == value, f"cycle {kept['cycle']}: {field}"


def test_every_line_of_the_journal_is_as_the_schema_says(run: RunDirectory) -> None:
    validator = Draft202012Validator(json.loads(SCHEMA.read_text(encoding="utf-8")))
    faults = [fault for record in read_journal(run.journal) for fault in validator.iter_errors(record)]
    assert [fault.message[:300] for fault in faults] == []


def test_a_line_of_the_journal_without_one_field_of_a_value_is_not(run: RunDirectory) -> None:
    validator = Draft202012Validator(json.loads(SCHEMA.read_text(encoding="utf-8")))
    record = next(record for record in read_journal(run.journal) if record["made"])
    fields = record["made"][0]["value"]
    for name in [*fields]:
        kept = fields.pop(name)
        assert not validator.is_valid(record), name
        fields[name] = kept
    assert validator.is_valid(record)


def test_every_picture_is_in_the_recording(run: RunDirectory) -> None:
    frames = read_frames(run.recording)
    assert b"".join(frames[number] for number in sorted(frames)) == run.camera.read_bytes()


def test_every_decision_has_its_sentence(run: RunDirectory) -> None:
    cycles = [record["cycle"] for record in read_journal(run.journal)]
    told = read_series(run.recording, TABLE, "TextLog:text")
    assert [cycle for cycle, _ in told] == cycles
    assert all(text for _, text in told)


def test_the_story_tells_what_went_wrong(run: RunDirectory) -> None:
    """The turning points in the recording are those in the journal, and the truth beside them."""
    turns = read_series(run.recording, CHAPTERS, "TextLog:level")
    for verdict in ("verified", "refuted"):
        judged = [record["cycle"] for record in read_journal(run.journal) for change in record["made"]
                  if change["type"] == "Certificate" and change["value"]["verdict"] == verdict]
        assert [cycle for cycle, word in turns if word == verdict] == judged
    words = [word for _, word in turns]
    assert words.count("fault") == 2, "it begins and it ends"
    assert "in truth" in words and "lost" in words and "found" in words
    assert words.index("in truth") < words.index("lost") < words.index("found")
    activities = [word for _, word in read_series(run.recording, HARVEY, "StateChange:state")]
    assert {"drives", "doubts", "is lost", "is in trouble"} <= set(activities)
    assert activities[-1] == json.loads(run.result.read_text())["outcome"]


def test_the_headline_follows_the_mood(run: RunDirectory) -> None:
    headlines = [text.splitlines()[0] for _, text in read_series(run.recording, WHY, "TextDocument:text")]
    assert all(line.startswith("### ") for line in headlines)
    assert any(line.startswith("### Lost") for line in headlines)
    assert headlines[-1].startswith("### The end: ")
