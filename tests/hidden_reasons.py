"""What an act read, and what it names: a view on which entries can be hidden, and the entries that reasons lead to."""

from __future__ import annotations

import re
from collections.abc import Collection, Hashable, Iterable, Iterator
from typing import Any, TypeVar

from blackboard import Blackboard, Change, Effect, Entry, Index, Post, Ref, Retract, View, kind_of, plain
from blackboard.board import TracedView
from harvey.wiring import load_kinds

T = TypeVar("T")
TRACED = frozenset(kind for kind in load_kinds().values() if kind_of(kind).traced)
ID = re.compile(r"'([A-Z][A-Za-z]+-[0-9]+)'")
"""An entry's id in a value that is written out."""


class HidingView(TracedView):
    """A view that records the ids of all that is read, and on which some entries are not there."""

    __slots__ = ("hidden", "read")

    def __init__(self, board: Blackboard, hidden: Collection[str] = ()) -> None:
        super().__init__(board, TRACED)
        self.hidden, self.read = frozenset(hidden), dict[str, Entry[Any]]()

    def get(self, id: str) -> Entry[Any] | None:
        return None if id in self.hidden else super().get(id)

    def __getitem__(self, id: str) -> Entry[Any]:
        if id in self.hidden:
            raise KeyError(id)
        return super().__getitem__(id)

    def all(self, kind: type[T]) -> tuple[Entry[T], ...]:
        return tuple(self._note(e) for e in View.all(self, kind) if e.id not in self.hidden)

    def newest_first(self, kind: type[T]) -> Iterator[Entry[T]]:
        return (self._note(e) for e in View.newest_first(self, kind) if e.id not in self.hidden)

    def having(self, index: Index[T], key: Hashable) -> tuple[Entry[T], ...]:
        return tuple(self._note(e) for e in View.having(self, index, key) if e.id not in self.hidden)

    def newest(self, index: Index[T], key: Hashable) -> Entry[T] | None:
        found = [e for e in View.having(self, index, key) if e.id not in self.hidden]
        return self._note(found[-1]) if found else None

    def since(self, kind: type[T], cycle: int) -> tuple[Entry[T], ...]:
        return tuple(self._note(e) for e in View.since(self, kind, cycle) if e.id not in self.hidden)

    def _note(self, entry: Entry[T]) -> Entry[T]:
        self.read[entry.id] = entry
        return super()._note(entry)


def describe(effects: Iterable[Effect]) -> list[str]:
    """What an act makes, without its reasons."""
    return [repr((type(e).__name__, None if isinstance(e, Post) else e.entry.id,
                  None if isinstance(e, Retract) else plain(e.value))) for e in effects]


def find_named(board: Blackboard, trigger: Change, effects: tuple[Effect, ...]) -> set[str]:
    """The ids of what an act names, of what that rests on, and of what the values of these refer to."""
    reasons: list[Any] = [trigger.entry, *(reason for e in effects for reason in e.because)]
    reasons += [e.entry for e in effects if not isinstance(e, Post)]
    named = {reason.id for reason in reasons if isinstance(reason, Entry | Ref)}
    named |= {ref.id for id in tuple(named) if (entry := board._current.get(id)) is not None for ref in entry.because}
    todo = list(named)
    while todo:
        entry = board._current.get(todo.pop())
        found = set() if entry is None else set(ID.findall(repr(plain(entry.value)))) - named
        named |= found
        todo += found
    return named


def list_unnamed(seen: HidingView, named: Collection[str], most: int) -> list[Entry[Any]]:
    """The newest of each kind of what was read and is neither named nor traced; so many kinds."""
    by_kind: dict[str, list[Entry[Any]]] = {}
    for entry in seen.read.values():
        if entry.id not in named and type(entry.value) not in TRACED:
            by_kind.setdefault(type(entry.value).__name__, []).append(entry)
    return [max(entries, key=lambda e: (e.cycle, e.id)) for entries in by_kind.values()][:most]
