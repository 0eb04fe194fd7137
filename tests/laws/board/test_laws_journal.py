"""Lines of the journal: plain, complete, and the same bytes for the same decision."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Decision, Post, Retract, Revise, Scheduler, decision_line, decision_record, plain
from blackboard.journal import entry_record
from strategies import Note, Scripted, run


class Colour(Enum):
    RED = "r"


class Size(IntEnum):
    LARGE = 3


@dataclass(frozen=True, slots=True)
class Holder:
    held: Any
    other: Any = None


scalars = st.none() | st.booleans() | st.integers() | st.text() | st.floats(allow_nan=False, allow_infinity=False)
trees = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=3) | st.tuples(inner, inner) | st.dictionaries(st.text(max_size=3), inner)
    | st.builds(Holder, inner, inner),
    max_leaves=8,
)


def jsonable(value: Any) -> Any:
    """What JSON must give back, said in another way than ``plain`` says it."""
    if isinstance(value, Holder):
        return {"held": jsonable(value.held), "other": jsonable(value.other)}
    if isinstance(value, dict):
        return {key: jsonable(v) for key, v in value.items()}
    return [jsonable(v) for v in value] if isinstance(value, list | tuple) else value


@settings(deadline=None)
@given(value=trees)
def test_plain_values_come_back_exactly(value: Any) -> None:
    assert json.loads(json.dumps(plain(value), allow_nan=False)) == jsonable(value)


class Named(NamedTuple):
    first: Any
    second: Any


@dataclass(frozen=True)
class Empty:
    pass


@dataclass(frozen=True)
class Fraction(float):
    """A value that is two things at once."""

    part: int = 1


arrays = st.builds(
    lambda rows, kind: np.array(rows, kind),
    st.lists(st.lists(st.integers(0, 9), min_size=2, max_size=2), max_size=3),
    st.sampled_from((float, np.float32, int, np.uint8, bool, object)),
)
oddities = st.sampled_from(
    (math.inf, -math.inf, math.nan, -0.0, 1e300, 5e-324, Colour.RED, Size.LARGE, b"", b"abc", Empty(), np.float64(0.5),
     np.int64(3), np.bool_(True), np.array([0.5, math.nan]), np.array(2.5), Named(1, 0.1), Fraction(0.5), 10**400,
     {1: 2})
) | arrays
everything = st.recursive(
    scalars | oddities,
    lambda inner: st.lists(inner, max_size=4) | st.lists(inner, max_size=4).map(tuple) | st.builds(Named, inner, inner)
    | st.dictionaries(st.text(max_size=3), inner, max_size=3) | st.builds(Holder, inner, inner)
    | st.builds(Note, st.text()),
    max_leaves=10,
)


@settings(deadline=None, max_examples=300)
@given(value=everything)
def test_plain_values_are_json_types_and_nothing_is_left_to_the_encoder(value: Any) -> None:
    assert json.loads(json.dumps(plain(value), allow_nan=False)) == plain(value)


@given(row=st.lists(st.floats(), max_size=6))
def test_floats_in_a_row_are_written_as_one_by_one(row: list[float]) -> None:
    for value in (row, tuple(row), np.array(row)):
        assert json.dumps(plain(value), allow_nan=False) == json.dumps([plain(x) for x in row], allow_nan=False)


@given(value=st.binary())
def test_bytes_are_told_by_length_and_digest(value: bytes) -> None:
    assert plain(value) == {"bytes": len(value), "sha256": hashlib.sha256(value).hexdigest()}


@given(rows=st.lists(st.tuples(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9)), min_size=1, max_size=4))
def test_arrays_become_lists(rows: list[tuple[float, float]]) -> None:
    assert plain(np.array(rows)) == [list(row) for row in rows]
    assert plain(np.float32(0.5)) == 0.5 and plain(np.int64(3)) == 3 and plain(np.bool_(True)) is True


@pytest.mark.parametrize(
    ("value", "expected"),
    [(math.inf, "inf"), (-math.inf, "-inf"), (math.nan, "nan"), (Colour.RED, "red"), (Size.LARGE, "large")],
)
def test_what_json_has_no_word_for(value: Any, expected: str) -> None:
    assert plain(Holder(value))["held"] == expected


@pytest.mark.parametrize("value", [{1, 2}, frozenset("ab"), object(), print, Holder, 1j])
def test_values_without_a_fixed_order_or_form_are_refused(value: Any) -> None:
    with pytest.raises(ValueError, match="expected a value of plain data"):
        plain(Holder(value))


def decisions() -> list[Decision]:
    """A small run in which something is posted, revised, retracted, obviated, refused and raised."""

    def work(view: Any, trigger: Any) -> Any:
        text = trigger.entry.value.text
        if text == "raise":
            raise ArithmeticError("too\nbad")
        if text == "post":
            yield Post(Note("retract"), (trigger.entry,))
            yield Revise(trigger.entry, Note("done"), (trigger.entry,))
        if text == "retract":
            yield Retract(trigger.entry)

    scheduler = Scheduler([Scripted("worker", act=work), Scripted("slow", rate=0.1)])
    scheduler.post([Post(Note(text)) for text in ("post", "raise", "größer ☃\n")], "user")
    return run(scheduler)


def test_a_decision_is_one_line_with_the_same_keys_in_the_same_order() -> None:
    lines = [decision_line(d) for d in decisions()]
    assert len(lines) > 3 and not any("\n" in line for line in lines)
    keys = {tuple(json.loads(line)) for line in lines}
    assert keys == {(
        "cycle", "focus", "observed", "seen", "activated", "obviated", "chosen", "runner_up", "pending", "made",
        "refused",
    )}
    assert lines == [decision_line(d) for d in decisions()]


def test_a_line_is_the_json_text_of_its_record() -> None:
    for decision in decisions():
        record = json.dumps(decision_record(decision), separators=(",", ":"), allow_nan=False)
        assert decision_line(decision) == record


def test_a_retraction_says_what_it_rests_on() -> None:
    def doubt(view: Any, trigger: Any) -> Any:
        yield Retract(view["Note-1"], (trigger.entry,))

    scheduler = Scheduler([Scripted("doubter", act=doubt, where=lambda note: note.text == "no")])
    scheduler.post([Post(Note("yes")), Post(Note("no"))], "user")
    (record,) = (c for d in run(scheduler) for c in json.loads(decision_line(d))["made"])
    assert (record["entry"], record["because"], record["retracted_because"]) == ("Note-1.0", [], ["Note-2.0"])


def test_every_revision_stands_in_full_in_exactly_one_line() -> None:
    kept = decisions()
    records = [json.loads(decision_line(d)) for d in kept]
    told = [c for r in records for c in (*r["observed"], *r["made"]) if c["change"] != "Retracted"]
    assert len({c["entry"] for c in told}) == len(told) == 5
    entries = [c.entry for d in kept for c in (*d.observed, *d.made) if type(c).__name__ != "Retracted"]
    for record, entry in zip(told, entries, strict=True):
        assert record == {"change": record["change"], **entry_record(entry)}
        assert record["value"] == {"text": entry.value.text} and record["type"] == "Note"
        assert record["because"] == [str(ref) for ref in entry.because]
    assert {ref for r in records for ref in r["seen"]} == {c["entry"] for c in told}


def test_what_was_chosen_and_what_came_next_are_told_with_their_ratings() -> None:
    first = json.loads(decision_line(decisions()[0]))
    assert first["chosen"] == {
        "number": 1, "source": "worker", "level": "plan", "trigger": "Note-1.0", "kind": "Posted", "rating": 0.5,
        "since": 1,
    }
    assert (first["runner_up"]["source"], first["runner_up"]["number"]) == ("worker", 3)


def test_another_decision_gives_another_line() -> None:
    decision = decisions()[0]
    others = [decision._replace(**{name: value}) for name, value in {
        "cycle": 99, "chosen": None, "runner_up": None, "pending": 99, "made": (), "refused": "stale", "activated": (),
        "observed": (), "seen": (),
    }.items()]
    assert len({decision_line(d) for d in (decision, *others)}) == len(others) + 1
