"""What a story is made of: sentences, each with the cycle that it tells of, in sections."""

from __future__ import annotations

from dataclasses import dataclass

from harvey.run_files.records import EntryRecord
from harvey.why.decisions import time_at
from harvey.why.history import History


@dataclass(frozen=True, slots=True)
class Sentence:
    """Something that happened.

    Attributes:
        text: one sentence or two.
        cycle: when; None for what is so during the whole run.
        time_s: since the run began, by the body's clock; None where nothing told it.
        refs: the entries that say so; none for what only the simulator knows.
    """

    text: str
    cycle: int | None = None
    time_s: float | None = None
    refs: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a story under its title."""

    title: str
    sentences: tuple[Sentence, ...]


def sentence_of(history: History, text: str, record: EntryRecord, *others: EntryRecord | None) -> Sentence:
    """A sentence that a record tells, in its cycle; ``others`` say so too."""
    refs = dict.fromkeys(one.ref for one in (record, *others) if one is not None)
    return Sentence(text, record.cycle, time_at(history, record.cycle), tuple(refs))
