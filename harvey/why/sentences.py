"""What a recorded entry says: the sentence of its own kind, or its fields where the run is of another version."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

from blackboard.change import Quiescence
from blackboard.kinds import Registry
from blackboard.servoing import Discrepancy
from harvey.errors import BadInput
from harvey.run_files.observations import entry_of
from harvey.run_files.records import EntryRecord
from world_models import words
from world_models.entries.kinds import KINDS

T = TypeVar("T")
OWN = Registry((*KINDS, Discrepancy, Quiescence))
"""The kinds that come with the project: no knowledge source needs to be loaded to read them."""


_GIVEN: ContextVar[Registry] = ContextVar("given", default=OWN)


@contextmanager
def knowing(kinds: Registry) -> Iterator[None]:
    """For a while, also the kinds that the calling program brought."""
    before = _GIVEN.set(kinds)
    try:
        yield
    finally:
        _GIVEN.reset(before)


def kinds_for(record: EntryRecord) -> Registry:
    """The kinds that are known here; those of other packages are loaded only for an entry that needs them."""
    if record.type in OWN:
        return OWN
    if record.type in (given := _GIVEN.get()):
        return given
    from harvey.wiring import load_kinds

    return load_kinds()


def value_of(record: EntryRecord, kind: type[T]) -> T:
    """The value that a record tells, of the kind that it must be of. Raises BadInput where it is of another version."""
    value = entry_of(record, kinds_for(record)).value
    if not isinstance(value, kind):
        raise BadInput(f"{record.ref}: expected a {kind.__name__}, got a {type(value).__name__}")
    return value


def sentence(record: EntryRecord) -> str:
    """One sentence, without the entry's name and without a full stop."""
    try:
        text = words.sentence(entry_of(record, kinds_for(record)).value)
    except (BadInput, ValueError, TypeError, OverflowError):  # a kind, or fields, that this version does not know
        text = words.fields(record.value)
    return f"{text}; no longer believed" if record.change == "Retracted" else text
