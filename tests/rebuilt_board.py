"""The board of a recorded run, rebuilt entry by entry from its journal, and acts that are run again on it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from blackboard import (
    Blackboard,
    Change,
    Effect,
    Entry,
    MissingEntryError,
    Post,
    Posted,
    Ref,
    Retracted,
    Revised,
    kind_of,
)
from blackboard.board import TracedView
from blackboard.journal import change_record
from harvey.agent import build_agent
from harvey.runner.replay import open_originals
from harvey.testing import answer
from harvey.wiring import KNOWLEDGE_SOURCES, build, load_kinds
from knowledge_sources.settings import DEFAULT
from logs.records import DecisionRecord, EntryRecord, Originals, as_line, cycle_of_writing, effect_of, ref_of
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from logs.timeline import Timeline

KINDS = load_kinds()
TRACED = frozenset(kind for kind in KINDS.values() if kind_of(kind).traced)
SOURCES = {source.called(): source for source in KNOWLEDGE_SOURCES}
CHANGES: Mapping[str, type[Change]] = {kind.__name__: kind for kind in (Posted, Revised, Retracted)}


@dataclass(frozen=True)
class Act:
    """What a knowledge source makes of a board.

    Attributes:
        made: the changes as the journal writes them, one JSON text.
        used: the revisions of traced kinds that it read.
    """

    made: str
    used: frozenset[str]


@dataclass
class RebuiltBoard:
    """A board as a journal tells it.

    Attributes:
        originals: what the journal names only by reference: pictures, and frames of a world that was read again.
        board: the board itself; entries: every revision that was ever on it.
    """

    originals: Originals
    board: Blackboard = field(default_factory=Blackboard)
    entries: dict[Ref, Entry[Any]] = field(default_factory=dict)

    def put(self, record: EntryRecord) -> None:
        """Apply one change of the journal."""
        effect = effect_of(record, self.originals, self.board.view, KINDS)
        (change,) = self.board.apply([effect], author=record.author, cycle=cycle_of_writing(record))
        assert str(change.entry.ref) == record.ref
        self.entries[change.entry.ref] = change.entry

    def act_again(self, decision: DecisionRecord) -> Act:
        """The act of a decision on the board as it is now, by a new knowledge source; what it lacks it asks for."""
        chosen = decision.chosen
        assert chosen is not None
        view, trigger = TracedView(self.board, TRACED), CHANGES[chosen.kind](self.entries[ref_of(chosen.trigger)])
        try:
            effects = answer(build(SOURCES[chosen.source], DEFAULT), view, trigger) or ()
        except MissingEntryError as missing:
            effects = (Post(missing.request, (trigger.entry,)),)
        changes = _apply_aside(self.board, effects, chosen.source, decision.cycle)
        return Act(as_line([change_record(change) for change in changes]), frozenset(map(str, view.used)))

    @contextmanager
    def revised(self, entry: Entry[Any], value: Any) -> Iterator[None]:
        """A while in which an entry has another value, in a revision of its own."""
        self._set(Entry(entry.id, entry.revision + 1, value, "test", entry.cycle, (entry.ref,)))
        try:
            yield
        finally:
            self._set(entry)

    def _set(self, entry: Entry[Any]) -> None:
        self.board._current[entry.id] = entry
        self.board._store(type(entry.value)).put(entry)


def recorded_act(decision: DecisionRecord) -> Act:
    """The act of a decision as the journal has it."""
    return Act(as_line(decision.data["made"]), frozenset(decision.used))


def open_board(run: RunDirectory) -> RebuiltBoard:
    """An empty board for a run, with its world read again."""
    return RebuiltBoard(open_originals(run, build_agent(RunHead.read(run.path)).store))


def rebuild(run: RunDirectory) -> Iterator[tuple[RebuiltBoard, DecisionRecord]]:
    """Each decision of a run in which somebody acted, with the board as the act saw it."""
    rebuilt = open_board(run)
    for decision in Timeline(run.journal).decisions():
        for record in decision.observed:
            rebuilt.put(record)
        if decision.chosen is not None:
            yield rebuilt, decision
        for record in decision.made:
            rebuilt.put(record)


def _apply_aside(board: Blackboard, effects: Iterable[Effect], author: str, cycle: int) -> tuple[Change, ...]:
    """The changes that effects would make of a board, which stays as it is."""
    aside = Blackboard()
    aside._current.update(board._current)
    aside._numbers.update(board._numbers)
    for effect in effects:
        if not isinstance(effect, Post):
            aside._store(type(effect.entry.value)).put(effect.entry)
    return aside.apply(effects, author=author, cycle=cycle)
