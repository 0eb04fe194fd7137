"""What was observed comes back from the journal as it was, to the bit: replay rests on it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Blackboard, Post, Quiescence, Ref, plain, registry_of
from blackboard.journal import change_record
from harvey.errors import BadInput
from logs.records import EntryRecord, Originals, effect_of, value_of
from scripted_mission import HOUSE
from world_models.actuator import ActuatorModel
from world_models.building.locale_frame import FrameAnswer, FrameChange, FrameRequest, LocaleFrame
from world_models.entries import CameraPicture, Command, Footprint, MotionReport, Outcome, RideReport, Wheels
from world_models.entries.entry_kinds import KINDS
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frame_store import FrameStore

KNOWN = registry_of((), KINDS)
HOUSE_STORE = FrameStore(read_world(Source.parse(HOUSE, "house.toml")), "of the house")
numbers = st.floats(allow_nan=False) | st.integers(-3, 3)
headings = st.floats(-7.0, 7.0)
covariances = st.tuples(*[st.tuples(numbers, numbers, numbers)] * 3)
positive = st.floats(0.01, 1.0)
names = st.lists(st.text(max_size=5), max_size=2).map(tuple)


@st.composite
def locale_frames(draw: st.DrawFn) -> LocaleFrame:
    """The frames of the house, with its door open or shut."""
    frame = HOUSE_STORE.frame(draw(st.sampled_from(tuple(HOUSE_STORE.world.locales))))
    by = draw(st.text(max_size=5))
    return frame.with_changes(FrameChange("shut", d.name, by) for d in frame.doorways if draw(st.booleans()))


observations = st.one_of(
    st.builds(MotionReport, numbers, numbers, numbers, numbers),
    st.builds(RideReport, st.text(max_size=5), st.text(max_size=5), numbers, numbers),
    st.builds(CameraPicture, st.binary(max_size=20), st.integers(0, 9), numbers, st.text(max_size=5)),
    st.builds(Command, st.text(max_size=9), headings, st.none() | headings, covariances),
    st.builds(Quiescence, st.integers(0, 10**6)),
    st.builds(Outcome, st.text(max_size=9), st.text(max_size=9)),
    st.builds(Footprint, positive, positive),
    st.builds(Wheels, st.builds(ActuatorModel, reach=st.floats(0.1, 2.0)), st.booleans()),
    st.builds(FrameRequest, names, names, names, st.sampled_from(("asked", "answered")),
              st.lists(st.builds(FrameAnswer, st.text(max_size=5), names, st.text(max_size=5)), max_size=2).map(tuple)),
    locale_frames(),
)


def recorded(value: Any) -> EntryRecord:
    """As the journal tells of its posting."""
    change = Blackboard().apply([Post(value, (Ref("Leg-2", 3),))], author="body", cycle=4)[0]
    data = json.loads(json.dumps(change_record(change)))
    return EntryRecord(data["change"], data["entry"], data["type"], data["author"], tuple(data["because"]),
                       data["value"], 5, True)


def originals(*frames: CameraPicture) -> Originals:
    return Originals({frame.number: frame.jpeg for frame in frames}, HOUSE_STORE)


def originals_of(value: Any) -> Originals:
    return originals(value) if isinstance(value, CameraPicture) else originals()


@settings(deadline=None, max_examples=200)
@given(observations)
def test_an_observation_comes_back_as_it_was(value: Any) -> None:
    again = value_of(recorded(value), KNOWN, *originals_of(value))
    assert type(again) is type(value)
    assert json.dumps(plain(again)) == json.dumps(plain(value))
    effect = effect_of(recorded(value), originals_of(value), Blackboard().view, KNOWN)
    assert isinstance(effect, Post)
    assert effect.because == (Ref("Leg-2", 3),)


@settings(deadline=None, max_examples=100)
@given(observations, st.data())
def test_a_value_of_other_fields_is_refused(value: Any, data: st.DataObject) -> None:
    record = recorded(value)
    key = data.draw(st.sampled_from(sorted(record.fields)))
    other = data.draw(st.sampled_from([{}, [1, 2], [[1]]]))
    lacking = {k: v for k, v in record.fields.items() if k != key}
    for broken in (lacking, {**record.fields, key: other}, {**record.fields, "x": 1}):
        with pytest.raises(BadInput, match="expected"):
            value_of(replace(record, fields=broken), KNOWN, *originals_of(value))


@given(st.binary(max_size=9), st.binary(max_size=9))
def test_a_picture_must_be_the_one_that_was_seen(seen: bytes, kept: bytes) -> None:
    record = recorded(CameraPicture(seen, 7, 0.5))
    if hashlib.sha256(seen).digest() == hashlib.sha256(kept).digest():
        assert value_of(record, KNOWN, *originals(CameraPicture(kept, 7, 0.5))).jpeg == seen
        return
    with pytest.raises(BadInput, match="another one"):
        value_of(record, KNOWN, *originals(CameraPicture(kept, 7, 0.5)))
    with pytest.raises(BadInput, match="picture 7"):
        value_of(record, KNOWN, *originals(CameraPicture(seen, 8, 0.5)))
