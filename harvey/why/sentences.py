"""What a recorded entry says: the sentence of its own kind, or its fields where the run is of another version."""

from __future__ import annotations

from blackboard.change import Quiescence
from blackboard.kinds import Registry
from blackboard.servoing import Discrepancy
from harvey.errors import BadInput
from harvey.run_files.observations import entry_of
from harvey.run_files.records import EntryRecord
from world_models import words
from world_models.entries import KINDS

OWN = Registry((*KINDS, Discrepancy, Quiescence))
"""The kinds that come with the project: no knowledge source needs to be loaded to read them."""


def kinds_for(record: EntryRecord) -> Registry:
    """The kinds that are known here; those of other packages are loaded only for an entry that needs them."""
    if record.type in OWN:
        return OWN
    from harvey.wiring import known_kinds

    return known_kinds()


def sentence(record: EntryRecord) -> str:
    """One sentence, without the entry's name and without a full stop."""
    try:
        text = words.sentence(entry_of(record, kinds_for(record)).value)
    except (BadInput, ValueError, TypeError, OverflowError):  # a kind, or fields, that this version does not know
        text = words.fields(record.value)
    return f"{text}; no longer believed" if record.change == "Retracted" else text
