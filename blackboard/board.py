"""Blackboard: applies effects. View: answers questions. An instance, never a global."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

from blackboard.change import Change, Posted, Retracted, Revised
from blackboard.effect import Effect, Post, Retract, Revise
from blackboard.entry import Entry, Ref, new_tuple
from blackboard.entry_store import EntryStore, Index
from blackboard.kinds import always

T = TypeVar("T")
Reasons = tuple[Ref, ...]


class StaleError(Exception):
    """An effect named a revision that is not the current one; nothing of its act was applied."""


class Blackboard:
    """The current revision of every entry; an entry store for each type of value."""

    def __init__(self) -> None:
        self._current: dict[str, Entry[Any]] = {}
        self._stores: dict[type[Any], EntryStore] = {}
        self._numbers: dict[type[Any], int] = {}
        self.current: Mapping[str, Entry[Any]] = self._current
        self.view = View(self)

    def apply(self, effects: Iterable[Effect], *, author: str, cycle: int) -> tuple[Change, ...]:
        """Carry out the effects of one act, all or none.

        Raises:
            StaleError: a Revise or Retract names a revision that is no longer current.
            ValueError: a value of another type than the entry's, or a reason that is no entry and no earlier effect.
        """
        acts = tuple(effects)
        if len(acts) == 1:
            self._refuse_faulty(acts[0], (), ())
            return (self._apply_one(acts[0], author, cycle, {}),)
        self._refuse_together(acts)
        made: dict[int, Change] = {}
        changes = []
        for effect in acts:
            change = made[id(effect)] = self._apply_one(effect, author, cycle, made)
            changes.append(change)
        return tuple(changes)

    def _refuse_together(self, acts: tuple[Effect, ...]) -> None:
        earlier: set[int] = set()
        touched: set[str] = set()
        for effect in acts:
            self._refuse_faulty(effect, earlier, touched)
            earlier.add(id(effect))
            if not isinstance(effect, Post):
                touched.add(effect.entry.id)

    def _refuse_faulty(self, effect: Effect, earlier: Collection[int], touched: Collection[str]) -> None:
        for reason in effect.because:
            if not isinstance(reason, Ref | Entry) and id(reason) not in earlier:
                expected = "because to hold entries or earlier effects of the same act"
                raise ValueError(f"expected {expected}, got {reason!r}")
        if isinstance(effect, Post):
            return
        seen = effect.entry
        if self._current.get(seen.id) is not seen or seen.id in touched:
            self._refuse_stale(seen, touched)
        if isinstance(effect, Revise) and type(effect.value) is not type(seen.value):
            raise ValueError(f"expected {seen.ref} to stay a {type(seen.value).__name__}, "
                             f"got a {type(effect.value).__name__}")

    def _refuse_stale(self, seen: Entry[Any], touched: Collection[str]) -> None:
        """Refuse what is stale; what is not the entry on the board, but equal to it, is as good."""
        now = self._current.get(seen.id)
        if now is None or now.revision != seen.revision or seen.id in touched:
            state = f"now {now.ref}" if now else "retracted"
            raise StaleError(f"{seen.ref} is {'touched twice by this act' if seen.id in touched else state}")

    @staticmethod
    def _reasons(reasons: tuple[Any, ...], made: Mapping[int, Change]) -> Reasons:
        if len(reasons) == 1 and isinstance(reasons[0], Entry):
            return (new_tuple(Ref, reasons[0][:2]),)
        named = [r.ref if isinstance(r, Entry) else r if isinstance(r, Ref) else made[id(r)].entry.ref for r in reasons]
        return tuple(dict.fromkeys(named))

    def _apply_one(self, effect: Effect, author: str, cycle: int, made: Mapping[int, Change]) -> Change:
        because = self._reasons(effect.because, made) if effect.because else ()
        if isinstance(effect, Retract):
            return new_tuple(Retracted, (self._remove(effect.entry.id), because))
        value = effect.value
        kind = type(value)
        if isinstance(effect, Revise):
            id, revision = effect.entry.id, effect.entry.revision + 1
        else:
            number = self._numbers[kind] = self._numbers.get(kind, 0) + 1
            id, revision = f"{kind.__name__}-{number}", 0
        entry = self._current[id] = new_tuple(Entry, (id, revision, value, author, cycle, because))
        (self._stores.get(kind) or self._store(kind)).put(entry)
        return new_tuple(Revised if revision else Posted, (entry, ()))

    def __str__(self) -> str:
        """What is believed now, an entry a line, oldest first."""
        return "\n".join(f"{e.ref}: {e.value} (by {e.author}, cycle {e.cycle})" for e in self._current.values())

    def follow(self, change: Change) -> None:
        """Take over a change that was made on another board, as one that a journal or a recorder tells of."""
        entry = change.entry
        if not isinstance(change, Retracted):
            self._current[entry.id] = entry
            self._store(type(entry.value)).put(entry)
        elif entry.id in self._current:
            self._remove(entry.id)

    def forget(self, id: str) -> None:
        """Let go of an entry that nobody can need any more. That is no change: it wakes nobody.

        Raises:
            KeyError: it is not on the board.
        """
        self._remove(id)

    def _remove(self, id: str) -> Entry[Any]:
        last = self._current.pop(id)
        return self._store(type(last.value)).remove(id)

    def _store(self, kind: type[Any]) -> EntryStore:
        store = self._stores.get(kind)
        if store is None:
            store = self._stores[kind] = EntryStore()
        return store


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
        now = self._board._current.get(entry.id)
        return now is entry or (now is not None and now.revision == entry.revision)

    def all(self, kind: type[T]) -> tuple[Entry[T], ...]:
        """Current entries of a type, oldest first."""
        return tuple(self._board._store(kind).entries.values())

    def newest_first(self, kind: type[T]) -> Iterator[Entry[T]]:
        """Current entries of a type, newest posting first, read one by one."""
        return reversed(self._board._store(kind).entries.values())

    def latest(self, kind: type[T], where: Callable[[T], bool] = always) -> Entry[T] | None:
        """The newest posting of a type that satisfies a predicate, or None; :meth:`newest` asks no other."""
        if where is always:
            return next(self.newest_first(kind), None)
        return next((entry for entry in self.newest_first(kind) if where(entry.value)), None)

    def where(self, kind: type[T], predicate: Callable[[T], bool]) -> tuple[Entry[T], ...]:
        """Current entries of a type that satisfy a predicate, oldest first; :meth:`having` asks no other."""
        return tuple(entry for entry in self.all(kind) if predicate(entry.value))

    def having(self, index: Index[T], key: Hashable) -> tuple[Entry[T], ...]:
        """Current entries that an index files under a key, oldest first."""
        return tuple(self._board._store(index.kind).having(index, key))

    def newest(self, index: Index[T], key: Hashable) -> Entry[T] | None:
        """The newest posting that an index files under a key, or None."""
        store = self._board._stores.get(index.kind)
        return None if store is None else store.newest(index, key)

    def keys(self, index: Index[T]) -> Collection[Hashable]:
        """The keys under which an index files something now."""
        store = self._board._stores.get(index.kind)
        return () if store is None else store.keys(index)

    def since(self, kind: type[T], cycle: int) -> tuple[Entry[T], ...]:
        """Current entries of a type whose current revision was written in a cycle or later, in that order."""
        return self._board._store(kind).since(cycle)

    def __len__(self) -> int:
        return len(self._board._current)


class TracedView(View):
    """A view that notes which revisions of some kinds are read.

    Attributes:
        used: their names.
    """

    __slots__ = ("_kinds", "used")

    def __init__(self, board: Blackboard, kinds: Collection[type[Any]] | None) -> None:
        """``kinds``: which; None: all."""
        super().__init__(board)
        self._kinds = kinds
        self.used: set[Ref] = set()

    def get(self, id: str) -> Entry[Any] | None:
        found = self._board._current.get(id)
        return None if found is None else self._note(found)

    def __getitem__(self, id: str) -> Entry[Any]:
        return self._note(self._board._current[id])

    def all(self, kind: type[T]) -> tuple[Entry[T], ...]:
        return tuple(map(self._note, super().all(kind)))

    def newest_first(self, kind: type[T]) -> Iterator[Entry[T]]:
        return map(self._note, super().newest_first(kind))

    def having(self, index: Index[T], key: Hashable) -> tuple[Entry[T], ...]:
        return tuple(map(self._note, super().having(index, key)))

    def newest(self, index: Index[T], key: Hashable) -> Entry[T] | None:
        found = super().newest(index, key)
        return None if found is None else self._note(found)

    def since(self, kind: type[T], cycle: int) -> tuple[Entry[T], ...]:
        return tuple(map(self._note, super().since(kind, cycle)))

    def _note(self, entry: Entry[T]) -> Entry[T]:
        if self._kinds is None or type(entry.value) in self._kinds:
            self.used.add(entry.ref)
        return entry
