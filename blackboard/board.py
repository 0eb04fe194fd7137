"""Blackboard: applies effects. View: answers questions. An instance, never a global."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from blackboard.change import Change, Posted, Retracted, Revised, always
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry, Ref

T = TypeVar("T")


class StaleError(Exception):
    """An effect named a revision that is not the current one; nothing of its act was applied."""


class Blackboard:
    """The current revision of every entry, indexed by the type of its value."""

    def __init__(self) -> None:
        self._current: dict[str, Entry[Any]] = {}
        self._by_type: dict[type[Any], dict[str, Entry[Any]]] = {}
        self._numbers: dict[type[Any], int] = {}

    def apply(self, effects: Iterable[Effect], *, author: str, cycle: int) -> tuple[Change, ...]:
        """Carry out the effects of one act, all or none.

        Raises:
            StaleError: a Revise or Retract names a revision that is no longer current.
            ValueError: a value of another type than the entry's, or a reason that is no entry and no earlier effect.
        """
        acts = tuple(effects)
        self._refuse_stale(acts)
        self._refuse_malformed(acts)
        made: dict[int, Ref] = {}
        changes = []
        for effect in acts:
            change = self._apply_one(effect, author, cycle, self._reasons(effect, made))
            made[id(effect)] = change.entry.ref
            changes.append(change)
        return tuple(changes)

    def _refuse_stale(self, acts: tuple[Effect, ...]) -> None:
        touched: set[str] = set()
        for effect in acts:
            if isinstance(effect, Post):
                continue
            now = self._current.get(effect.entry.id)
            if now is None or now.revision != effect.entry.revision or effect.entry.id in touched:
                again = effect.entry.id in touched
                state = "touched twice by this act" if again else f"now {now.ref}" if now else "retracted"
                raise StaleError(f"{effect.entry.ref} is {state}")
            touched.add(effect.entry.id)

    @staticmethod
    def _refuse_malformed(acts: tuple[Effect, ...]) -> None:
        earlier: set[int] = set()
        for effect in acts:
            for reason in effect.because:
                if not isinstance(reason, Ref | Entry) and id(reason) not in earlier:
                    expected = "because to hold entries or earlier effects of the same act"
                    raise ValueError(f"expected {expected}, got {reason!r}")
            if isinstance(effect, Revise) and type(effect.value) is not type(effect.entry.value):
                raise ValueError(f"expected {effect.entry.ref} to stay a {type(effect.entry.value).__name__}, "
                                 f"got a {type(effect.value).__name__}")
            earlier.add(id(effect))

    @staticmethod
    def _reasons(effect: Effect, made: dict[int, Ref]) -> tuple[Ref, ...]:
        named = (r if isinstance(r, Ref) else r.ref if isinstance(r, Entry) else made[id(r)] for r in effect.because)
        return tuple(dict.fromkeys(named))

    def _apply_one(self, effect: Effect, author: str, cycle: int, because: tuple[Ref, ...]) -> Change:
        if isinstance(effect, Post):
            kind = type(effect.value)
            number = self._numbers[kind] = self._numbers.get(kind, 0) + 1
            entry = Entry(f"{kind.__name__}-{number}", 0, effect.value, author, cycle, because)
            self._store(entry)
            return Posted(entry)
        if isinstance(effect, Revise):
            entry = Entry(effect.entry.id, effect.entry.revision + 1, effect.value, author, cycle, because)
            self._store(entry)
            return Revised(entry)
        last = self._current.pop(effect.entry.id)
        del self._by_type[type(last.value)][last.id]
        return Retracted(last)

    def _store(self, entry: Entry[Any]) -> None:
        self._current[entry.id] = entry
        self._by_type.setdefault(type(entry.value), {})[entry.id] = entry

    @property
    def view(self) -> View:
        return View(self)


class View:
    """Reads, and nothing else. What is read is immutable, so a view may be handed to anyone."""

    __slots__ = ("_board",)

    def __init__(self, board: Blackboard) -> None:
        self._board = board

    def get(self, id: str) -> Entry[Any] | None:
        """The current revision of an entry, or None."""
        return self._board._current.get(id)

    def __getitem__(self, id: str) -> Entry[Any]:
        """The current revision of an entry that must be there.

        Raises:
            KeyError: it is not on the board.
        """
        return self._board._current[id]

    def is_current(self, entry: Entry[Any]) -> bool:
        now = self.get(entry.id)
        return now is not None and now.revision == entry.revision

    def all(self, kind: type[T]) -> tuple[Entry[T], ...]:
        """Current entries of a type, oldest first."""
        return tuple(self._board._by_type.get(kind, {}).values())

    def newest_first(self, kind: type[T]) -> Iterator[Entry[T]]:
        """Current entries of a type, newest posting first, read one by one."""
        return reversed(self._board._by_type.get(kind, {}).values())

    def latest(self, kind: type[T], where: Callable[[T], bool] = always) -> Entry[T] | None:
        """The newest posting of a type that satisfies a predicate, or None."""
        return next((entry for entry in self.newest_first(kind) if where(entry.value)), None)

    def where(self, kind: type[T], predicate: Callable[[T], bool]) -> tuple[Entry[T], ...]:
        """Current entries of a type that satisfy a predicate, oldest first."""
        return tuple(entry for entry in self.all(kind) if predicate(entry.value))

    def __len__(self) -> int:
        return len(self._board._current)
