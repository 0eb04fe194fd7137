"""Asking an expert again: could it have acted in a cycle, and if not, what did it find on the board?

The board as it stood is put together from the journal, and the expert's own ``rate`` is asked once more. That is honest
as far as ``rate`` is what it has to be, a pure function of the board; no act is repeated and no picture is looked at.
"""

from __future__ import annotations

import dataclasses
import inspect
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from blackboard.board import Blackboard, View
from blackboard.change import Change, Posted, Quiescence, Retracted, Revised
from blackboard.effect import Effect, Post, Retract, Revise
from blackboard.entry import Entry, Ref
from blackboard.index import Index
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import WORDS, Level
from blackboard.servoing import Discrepancy
from harvey.errors import BadInput
from harvey.run_files.records import EntryRecord
from harvey.why.history import History
from harvey.why.links import words
from world_models import actuator
from world_models.entries import body, location, percepts, task

TYPES: Mapping[str, type[Any]] = {
    name: kind
    for module in (actuator, body, location, percepts, task) for name, kind in vars(module).items()
    if isinstance(kind, type)
} | {"Discrepancy": Discrepancy, "Quiescence": Quiescence}
KINDS: Mapping[str, type[Change]] = {"Posted": Posted, "Revised": Revised, "Retracted": Retracted}


def why_absent(history: History, expert: KnowledgeSource, cycle: int) -> Iterator[str]:
    """Why an expert was not among those that could act in a cycle, in sentences.

    Raises:
        BadInput: the run has no such cycle, or a value of the journal is not of its type.
    """
    name = words(expert.name)
    seen = changes(history, cycle)
    woken = [change for change in seen if any(watch.sees(change) for watch in expert.watches)]
    if not woken:
        watched = ", ".join(dict.fromkeys(f"{w.value_type.__name__} {_kinds(w.kinds)}" for w in expert.watches))
        came = ", ".join(f"{change.entry.ref} {change.kind.lower()}" for change in seen) or "nothing"
        yield (f"Nothing that the {name} watches for came in cycle {cycle}. It watches for some of: {watched}; what"
               f" came: {came}.")
        return
    board = board_at(history, cycle)
    for change in woken:
        yield from _asked(expert, board, change)


def _asked(expert: KnowledgeSource, board: Blackboard, change: Change) -> Iterator[str]:
    name, ref = words(expert.name), change.entry.ref
    if not isinstance(change, Retracted) and not board.view.is_current(change.entry):
        now = board.view.get(change.entry.id)
        yield f"{ref} would have woken the {name}, but was {f'{now.ref} already' if now else 'withdrawn already'}."
        return
    view = AskedView(board)
    rating = expert.rate(view, change)
    if rating is not None:
        yield f"{ref} woke the {name}; asked again, it says that it could have acted, rated {rating:.2f}."
        return
    yield f"{ref} woke the {name}, but it could not act. What it asked of the board, and found:"
    yield from (f"  {question}: {', '.join(dict.fromkeys(answers)) or 'nothing'}" for question, answers in view.asked)
    if view.asked:
        yield "The last of these decided."


def _kinds(kinds: Iterable[type[Change]]) -> str:
    return "/".join(kind.__name__.lower() for kind in kinds)


class AskedView(View):
    """A view that remembers what was asked of it, in the words of knowledge_sources.questions, and the answers."""

    __slots__ = ("asked",)

    def __init__(self, board: Blackboard) -> None:
        super().__init__(board)
        self.asked: list[tuple[str, list[str]]] = []

    def _note(self, what: str, found: Iterable[Entry[Any] | None]) -> None:
        question = _question() or what
        if not self.asked or self.asked[-1][0] != question:
            self.asked.append((question, []))
        self.asked[-1][1].extend(str(e.ref) for e in found if e is not None)

    def get(self, id: str) -> Entry[Any] | None:
        found = super().get(id)
        self._note(id, (found,))
        return found

    def latest(self, kind: type[Any], where: Callable[[Any], bool] = lambda _: True) -> Entry[Any] | None:
        found = super().latest(kind, where)
        self._note(f"the newest {kind.__name__} of some kind", (found,))
        return found

    def where(self, kind: type[Any], predicate: Callable[[Any], bool]) -> tuple[Entry[Any], ...]:
        found = super().where(kind, predicate)
        self._note(f"every {kind.__name__} of some kind", found)
        return found

    def newest(self, index: Index[Any], key: Any) -> Entry[Any] | None:
        found = super().newest(index, key)
        self._note(f"the newest {index.kind.__name__} with {key}", (found,))
        return found

    def having(self, index: Index[Any], key: Any) -> tuple[Entry[Any], ...]:
        found = super().having(index, key)
        self._note(f"every {index.kind.__name__} with {key}", found)
        return found


def _question() -> str:
    """The name of the outermost question that is being asked, with its level if it has one; "" for a plain read."""
    frame, found = inspect.currentframe(), ""
    while frame is not None:
        if frame.f_globals.get("__name__") == "knowledge_sources.questions":
            level = frame.f_locals.get("level")
            found = words(frame.f_code.co_name) + (f" ({WORDS[level]} level)" if isinstance(level, Level) else "")
        frame = frame.f_back
    return found


def changes(history: History, cycle: int) -> tuple[Change, ...]:
    """What a cycle took up: what the one before had made, and what came from outside. Raises BadInput."""
    decision = history.decision(cycle)
    outside = {r.ref for r in decision.observed}
    before = [r for r in history.made(cycle - 1) if r.ref in decision.seen and r.ref not in outside]
    return tuple(KINDS.get(r.change, Posted)(entry_of(r)) for r in (*before, *decision.observed))


def board_at(history: History, cycle: int) -> Blackboard:
    """The board as experts saw it when they were asked in a cycle. Raises BadInput."""
    told: list[EntryRecord] = []
    for one in history.cycles:
        if one > cycle:
            break
        decision = history.decision(one)
        told += (*decision.observed, *(decision.made if one < cycle else ()))
    last = {record.id: record for record in told}
    values = {id: entry_of(record).value for id, record in last.items()}  # older revisions cannot be seen any more
    board = Blackboard()
    for record in told:
        board.apply([_effect(board, record, values[record.id])], author=record.author, cycle=_written(record))
    return board


def _effect(board: Blackboard, record: EntryRecord, value: Any) -> Effect:
    if record.change == "Posted":
        return Post(value, _refs(record.because))
    entry = board.view.get(record.id)
    if entry is None:
        raise BadInput(f"{record.ref}: expected it on the board in cycle {record.cycle}, where it is not")
    if record.change == "Retracted":
        return Retract(entry, _refs(record.retracted_because))
    return Revise(entry, value, _refs(record.because))


def _written(record: EntryRecord) -> int:
    """In which cycle it was put on the board; what comes from outside is taken up in the next."""
    return record.cycle - record.observed


def entry_of(record: EntryRecord) -> Entry[Any]:
    """An entry as it stood on the board, but for the bytes of pictures, which the journal does not keep.

    Raises:
        BadInput: the value is of a type that is not known, or does not fit it.
    """
    if record.type not in TYPES:
        raise BadInput(f"{record.ref}: expected a value of a type of this version, got a {record.type}")
    try:
        value = _restored(record.value, TYPES[record.type])
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(f"{record.ref}: expected a {record.type} as this version has it, got another: {error}") from None
    id, _, revision = record.ref.rpartition(".")
    return Entry(id, int(revision), value, record.author, _written(record), _refs(record.because))


def _refs(texts: tuple[str, ...]) -> tuple[Ref, ...]:
    return tuple(Ref(text.rpartition(".")[0], int(text.rpartition(".")[2])) for text in texts)


def _restored(value: Any, hint: Any) -> Any:
    """A value of the type that a hint names, from JSON types."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        return None if value is None else _restored(value, next(a for a in args if a is not type(None)))
    if origin is np.ndarray:
        return np.array(value, dtype=typing.get_args(args[1])[0])
    if origin is tuple:
        kinds = args[:1] * len(value) if Ellipsis in args else args
        return tuple(_restored(item, kind) for item, kind in zip(value, kinds, strict=True))
    if hint is bytes:
        return b""
    if hint is Level:
        return Level[str(value).upper()]
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        hints = typing.get_type_hints(hint)
        return hint(**{name: _restored(item, hints[name]) for name, item in value.items()})
    return float(value) if hint is float else value
