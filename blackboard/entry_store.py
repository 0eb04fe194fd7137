"""EntryStore: the current entries of one type, in order of posting, and the indexes over them."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable, Collection, Hashable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from blackboard.entry import Entry

T_contra = TypeVar("T_contra", contravariant=True)


@dataclass(frozen=True, slots=True, eq=False)
class Index(Generic[T_contra]):
    """A question that is asked often: which entries of a type have a certain key?

    The board keeps the answer from the first time that it is asked, and brings it up to date with every change. Declare
    an index once, beside the questions that use it, and not anew for each question.

    Attributes:
        kind: the class of the values.
        key: what they are found by, a pure function of the value; None leaves an entry out.
        word: what the entries are that are not left out, for people: "open".
    """

    kind: type[Any]
    key: Callable[[T_contra], Hashable | None]
    word: str = ""


Entries = tuple[Entry[Any], ...]


class EntryStore:
    """Everything of one type that is believed now.

    Posting, revising and removing take the same time however many entries there are, but for the order within a key,
    which takes a bisection. Reading takes as long as its answer.
    """

    __slots__ = ("_indexes", "_times", "entries")

    def __init__(self) -> None:
        self.entries: dict[str, Entry[Any]] = {}
        self._indexes: dict[Index[Any], _Buckets] = {}
        self._times: _Times | None = None

    def put(self, entry: Entry[Any]) -> None:
        """A new entry, or a new revision of one."""
        if self._indexes:
            old = self.entries.get(entry.id)
            for buckets in self._indexes.values():
                buckets.replace(old, entry)
        self.entries[entry.id] = entry
        if self._times is not None:
            self._times.note(entry)

    def remove(self, id: str) -> Entry[Any]:
        """Take an entry away, and give back its last revision."""
        old = self.entries.pop(id)
        for buckets in self._indexes.values():
            buckets.replace(old, None)
        return old

    def having(self, index: Index[Any], key: Hashable) -> Bucket | None:
        """The entries with a key; None where there is none."""
        return (self._indexes.get(index) or self._made(index)).get(key)

    def keys(self, index: Index[Any]) -> Collection[Hashable]:
        """The keys that some entry has."""
        return (self._indexes.get(index) or self._made(index)).keys()

    def since(self, cycle: int) -> Entries:
        """Entries whose current revision is of a cycle or later, in the order in which they were written."""
        if self._times is None:
            self._times = _Times(self.entries)
        return self._times.since(cycle)

    def _made(self, index: Index[Any]) -> _Buckets:
        made = self._indexes[index] = _Buckets(index)
        for entry in self.entries.values():
            made.replace(None, entry)
        return made


class Bucket:
    """The entries that have one key, one at least: by number of posting, and those numbers in order."""

    __slots__ = ("_entries", "_numbers")

    def __init__(self) -> None:
        self._numbers: list[int] = []
        self._entries: dict[int, Entry[Any]] = {}

    def put(self, entry: Entry[Any]) -> None:
        number = _number(entry)
        if number not in self._entries:
            insort(self._numbers, number)
        self._entries[number] = entry

    def drop(self, entry: Entry[Any]) -> None:
        number = _number(entry)
        del self._entries[number]
        del self._numbers[bisect_left(self._numbers, number)]

    def newest(self) -> Entry[Any]:
        return self._entries[self._numbers[-1]]

    def __iter__(self) -> Iterator[Entry[Any]]:
        return map(self._entries.__getitem__, self._numbers)

    def __reversed__(self) -> Iterator[Entry[Any]]:
        return map(self._entries.__getitem__, reversed(self._numbers))

    def __len__(self) -> int:
        return len(self._numbers)


class _Buckets:
    """One index: a bucket for each key that some entry has."""

    __slots__ = ("_buckets", "_key")

    def __init__(self, index: Index[Any]) -> None:
        self._key = index.key
        self._buckets: dict[Hashable, Bucket] = {}

    def get(self, key: Hashable) -> Bucket | None:
        return self._buckets.get(key)

    def keys(self) -> Collection[Hashable]:
        return self._buckets.keys()

    def replace(self, old: Entry[Any] | None, new: Entry[Any] | None) -> None:
        """An entry was revised, posted (no old one) or taken away (no new one)."""
        before = None if old is None else self._key(old.value)
        after = None if new is None else self._key(new.value)
        if before is not None and old is not None and before != after:
            bucket = self._buckets[before]
            bucket.drop(old)
            if not bucket:
                del self._buckets[before]
        if after is not None and new is not None:
            if after not in self._buckets:
                self._buckets[after] = Bucket()
            self._buckets[after].put(new)


class _Times:
    """What was written when: revisions in the order of their cycles; those that are no longer current are skipped.

    When more than half are not current they are left out for good, so its size follows the number of entries.
    """

    __slots__ = ("_cycles", "_entries", "_written")

    def __init__(self, entries: dict[str, Entry[Any]]) -> None:
        self._entries = entries
        self._written = sorted(entries.values(), key=_cycle)
        self._cycles = [entry.cycle for entry in self._written]

    def note(self, entry: Entry[Any]) -> None:
        self._written.append(entry)
        self._cycles.append(entry.cycle)
        if len(self._written) > 2 * len(self._entries) + 16:
            self._written = [e for e in self._written if self._is_current(e)]
            self._cycles = [e.cycle for e in self._written]

    def since(self, cycle: int) -> Entries:
        written = self._written[bisect_left(self._cycles, cycle):]
        return tuple(entry for entry in written if self._is_current(entry))

    def _is_current(self, entry: Entry[Any]) -> bool:
        return self._entries.get(entry.id) is entry


def _cycle(entry: Entry[Any]) -> int:
    return entry.cycle


def _number(entry: Entry[Any]) -> int:
    """Of its posting among those of its type; ``Goal-12`` is the twelfth goal."""
    return int(entry.id.rpartition("-")[2])
