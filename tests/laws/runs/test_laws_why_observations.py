"""What was observed comes back from the journal as it was, to the bit: replay rests on it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard.board import Blackboard
from blackboard.change import Quiescence
from blackboard.effect import Post
from blackboard.entry import Ref
from blackboard.journal import change_record, plain
from blackboard.scheduler import registry_of
from harvey.errors import BadInput
from harvey.run_files.observations import effect_of, value_of
from harvey.run_files.records import EntryRecord
from world_models.entries.body import Frame, MotionReport, RideReport
from world_models.entries.kinds import KINDS
from world_models.entries.task import Command, Outcome

KNOWN = registry_of((), KINDS)
numbers = st.floats(allow_nan=False) | st.integers(-3, 3)
headings = st.floats(-7.0, 7.0)
covariances = st.tuples(*[st.tuples(numbers, numbers, numbers)] * 3)
observations = st.one_of(
    st.builds(MotionReport, numbers, numbers, numbers, numbers),
    st.builds(RideReport, st.text(max_size=5), st.text(max_size=5), numbers, numbers),
    st.builds(Frame, st.binary(max_size=20), st.integers(0, 9), numbers, st.text(max_size=5)),
    st.builds(Command, st.text(max_size=9), headings, st.none() | headings, covariances),
    st.builds(Quiescence, st.integers(0, 10**6)),
    st.builds(Outcome, st.text(max_size=9), st.text(max_size=9)),
)


def recorded(value: Any) -> EntryRecord:
    """As the journal tells of its posting."""
    change = Blackboard().apply([Post(value, (Ref("Leg-2", 3),))], author="body", cycle=4)[0]
    data = json.loads(json.dumps(change_record(change)))
    return EntryRecord(data["change"], data["entry"], data["type"], data["author"], tuple(data["because"]),
                       data["value"], 5, True)


def pictures(value: Any) -> dict[int, bytes]:
    return {value.number: value.jpeg} if isinstance(value, Frame) else {}


@settings(deadline=None, max_examples=200)
@given(observations)
def test_an_observation_comes_back_as_it_was(value: Any) -> None:
    again = value_of(recorded(value), pictures(value), KNOWN)
    assert type(again) is type(value)
    assert json.dumps(plain(again)) == json.dumps(plain(value))
    effect = effect_of(recorded(value), pictures(value), Blackboard().view, KNOWN)
    assert isinstance(effect, Post)
    assert effect.because == (Ref("Leg-2", 3),)


@settings(deadline=None, max_examples=100)
@given(observations, st.data())
def test_a_value_of_other_fields_is_refused(value: Any, data: st.DataObject) -> None:
    record = recorded(value)
    key = data.draw(st.sampled_from(sorted(record.value)))
    other = data.draw(st.sampled_from([{}, [1, 2], [[1]]]))
    lacking = {k: v for k, v in record.value.items() if k != key}
    for broken in (lacking, {**record.value, key: other}, {**record.value, "x": 1}):
        with pytest.raises(BadInput, match="expected"):
            value_of(replace(record, value=broken), pictures(value), KNOWN)


@given(st.binary(max_size=9), st.binary(max_size=9))
def test_a_picture_must_be_the_one_that_was_seen(seen: bytes, kept: bytes) -> None:
    record = recorded(Frame(seen, 7, 0.5))
    if hashlib.sha256(seen).digest() == hashlib.sha256(kept).digest():
        assert value_of(record, {7: kept}, KNOWN).jpeg == seen
        return
    with pytest.raises(BadInput, match="another one"):
        value_of(record, {7: kept}, KNOWN)
    with pytest.raises(BadInput, match="picture 7"):
        value_of(record, {8: seen}, KNOWN)
