"""Kinds of entries: marked once, where they are defined; and no request reaches a port before it is written."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import (
    Change,
    Effect,
    Post,
    Quiescence,
    Registry,
    Role,
    Scheduler,
    inference,
    kind_of,
    observation,
    registry_of,
    request,
)
from blackboard.kinds import Kind, NotAKindError, is_kind
from harvey.runner.ports import BodyPort, WorldPort
from harvey.wiring import knowledge_sources
from journals import read_journal
from logs import disk
from logs.journal_file import JournalFile
from strategies import Note, Scripted
from world_models.entries import Discrepancy
from world_models.entries.entry_kinds import KINDS
from world_models.words import sentence

ALL = (*KINDS, Discrepancy, Quiescence)


@request()
@dataclass(frozen=True, slots=True)
class OpenGripper:
    """A request that this test invents."""

    width_m: float


@observation()
@dataclass(frozen=True, slots=True)
class GripperReport:
    """And the answer to it."""

    width_m: float


REQUESTS = (OpenGripper, *(kind for kind in KINDS if kind_of(kind).role is Role.REQUEST))


def example(kind: type[Any]) -> Any:
    """Some value of a kind; its fields are not looked at."""
    value = object.__new__(kind)
    for field in dataclasses.fields(kind):
        object.__setattr__(value, field.name, 1.0 if field.type == "float" else "x")
    return value


class Gripper:
    """A port that notes what the journal on the disk has when it is asked."""

    name = "gripper"

    def __init__(self, journal: Path, forced: list[int], sync: bool) -> None:
        self._journal, self._forced, self._sync = journal, forced, sync
        self.asked: list[str] = []

    def answer(self, change: Change) -> Iterable[Effect]:
        written = [made["entry"] for record in read_journal(self._journal) for made in record["made"]]
        assert str(change.entry.ref) in written and len(self._forced) == self._sync
        self.asked.append(change.entry.id)
        self._forced.clear()
        yield Post(GripperReport(0.1), (change.entry,))


@settings(deadline=None, max_examples=40)
@given(kinds=st.lists(st.sampled_from((*REQUESTS, Note)), min_size=1, max_size=6), sync=st.booleans())
def test_no_request_reaches_a_port_before_it_is_written(kinds: list[type[Any]], sync: bool) -> None:
    """And forced onto the disk, once, if and only if that is asked for.

    For every registered request, one that this test invents too; what is no request reaches no port at all.
    """
    values = [Note("a") if kind is Note else example(kind) for kind in kinds]

    def act(_view: Any, trigger: Change) -> Iterable[Effect]:
        at = int(trigger.entry.value.text)
        yield Post(values[at], (trigger.entry,))
        if at + 1 < len(values):
            yield Post(Note(str(at + 1)), (trigger.entry,))

    forced: list[int] = []
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(disk.os, "fsync", forced.append)
        path = Path(folder) / "journal.jsonl"
        journal, gripper = JournalFile(path, sync=sync), Gripper(path, forced, sync)
        source = Scripted("asker", Note, act, where=lambda note: note.text.isdigit(), writes=(*REQUESTS, Note))
        scheduler = Scheduler([source], ports=[gripper], sinks=[journal], kinds=(GripperReport,))
        scheduler.post([Post(Note("0"))], "user")
        while scheduler.step() is not None:
            pass
        journal.close()
    assert not forced
    assert [id.rpartition("-")[0] for id in gripper.asked] == [kind.__name__ for kind in kinds if kind is not Note]


def test_every_kind_that_is_watched_or_written_is_registered() -> None:
    sources = knowledge_sources()
    registry = registry_of(sources, KINDS)
    assert set(registry.values()) == set(ALL)
    for source in sources:
        assert {watch.value_type for watch in source.on} | set(source.writes) <= set(registry.values())


@pytest.mark.parametrize("kind", ALL, ids=lambda kind: kind.__name__)
def test_every_kind_says_what_it_is_in_one_sentence_of_its_own(kind: type[Any]) -> None:
    assert is_kind(kind) and kind.__doc__ and callable(kind.__dict__.get("sentence"))


def test_what_a_knowledge_source_writes_from_outside_is_an_observation_or_a_request() -> None:
    """Nobody on the board makes up what a port alone can know; it may close a fault, correct a frame, learn of the
    camera and of the wheels, take up what was told.
    """
    only_revised = {"BodyFault", "CameraState", "LocaleFrame", "UserReport", "Redirection", "Wheels"}
    sources = knowledge_sources()
    written = {kind for source in sources for kind in source.writes}
    posted_by_ports = {kind for kind in ALL if kind_of(kind).role is Role.OBSERVATION}
    assert {kind.__name__ for kind in written & posted_by_ports} == only_revised


def test_an_unmarked_type_is_refused_before_anything_runs() -> None:
    @dataclass(frozen=True)
    class Unmarked:
        number: int

    for source in (Scripted("watcher", Unmarked), Scripted("writer", writes=(Unmarked,))):
        with pytest.raises(NotAKindError, match="expected a kind of entry, got Unmarked: mark it with @request"):
            Scheduler([source])


def test_a_mark_is_not_inherited_and_only_frozen_dataclasses_can_be_marked() -> None:
    class Child(Note):
        pass

    assert not is_kind(Child)
    with pytest.raises(TypeError, match="expected a frozen dataclass, got dict"):
        inference()(dict)


def test_two_kinds_of_one_name_are_refused() -> None:
    other = inference()(dataclass(frozen=True)(type("Note", (), {"__annotations__": {"text": str}})))
    with pytest.raises(ValueError, match="kinds of different names"):
        Registry([Note, other])


def test_the_ports_answer_requests_only_and_each_request_is_answered_by_one() -> None:
    answered = [kind.__name__ for port in (BodyPort, WorldPort) for kind in port.acts_on]
    assert sorted(answered) == sorted(kind.__name__ for kind in REQUESTS[1:])
    assert all(kind_of(kind).role is Role.REQUEST for kind in (*BodyPort.acts_on, *WorldPort.acts_on))


def test_a_kind_without_a_sentence_is_told_by_its_fields_with_their_units() -> None:
    assert sentence(OpenGripper(0.25)) == "width = 0.25 m"
    assert Kind(Role.INFERENCE).keep is None
