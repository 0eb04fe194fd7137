"""EntryStore: the current entries of one type, in order of posting, and the indexes over them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass
from itertools import takewhile
from typing import Any, Generic, TypeVar

from blackboard.entry import Entry

T_contra = TypeVar("T_contra", contravariant=True)


@dataclass(frozen=True, slots=True, eq=False)
class Index(Generic[T_contra]):
    """A question that is asked often: which entries of a type have a certain key?

    The board keeps the answer from the first time that it is asked, and brings it up to date with every change. Declare
    an index once, next to the questions that use it, and not again for each question.

    Attributes:
        kind: the class of the values.
        key: what they are found by, a pure function of the value; None leaves an entry out.
        word: what the entries are that are not left out, for people: "open".
    """

    kind: type[Any]
    key: Callable[[T_contra], Hashable | None]
    word: str = ""


class EntryStore:
    """Everything of one type that is believed now."""

    __slots__ = ("_indexes", "_written", "entries")

    def __init__(self) -> None:
        self.entries: dict[str, Entry[Any]] = {}  # in order of posting
        self._written: dict[str, Entry[Any]] = {}  # the same in the order in which their current revisions were
        self._indexes: dict[Index[Any], dict[Hashable, dict[str, Entry[Any]]]] = {}

    def put(self, entry: Entry[Any]) -> None:
        """A new entry, or a new revision of one."""
        for index, filed in self._indexes.items():
            _file(index, filed, self.entries.get(entry.id), entry)
        self.entries[entry.id] = entry
        self._written.pop(entry.id, None)
        self._written[entry.id] = entry

    def remove(self, id: str) -> Entry[Any]:
        """Take an entry away, and give back its last revision."""
        del self._written[id]
        old = self.entries.pop(id)
        for index, filed in self._indexes.items():
            _file(index, filed, old, None)
        return old

    def having(self, index: Index[Any], key: Hashable) -> list[Entry[Any]]:
        """The entries with a key, in order of posting."""
        found = self._filed(index).get(key, {}).values()
        return list(found) if len(found) < 2 else sorted(found, key=_number)

    def newest(self, index: Index[Any], key: Hashable) -> Entry[Any] | None:
        """The newest posting with a key, or None."""
        found = self._filed(index).get(key, {}).values()
        return max(found, key=_number) if len(found) > 1 else next(iter(found), None)

    def keys(self, index: Index[Any]) -> Collection[Hashable]:
        """The keys that some entry has."""
        return self._filed(index).keys()

    def since(self, cycle: int) -> tuple[Entry[Any], ...]:
        """Entries whose current revision is of a cycle or later, in the order in which they were written."""
        newest_first = takewhile(lambda entry: entry.cycle >= cycle, reversed(self._written.values()))
        return tuple(newest_first)[::-1]

    def _filed(self, index: Index[Any]) -> dict[Hashable, dict[str, Entry[Any]]]:
        if index not in self._indexes:
            filed = self._indexes[index] = {}
            for entry in self.entries.values():
                _file(index, filed, None, entry)
        return self._indexes[index]


def _file(
    index: Index[Any], filed: dict[Hashable, dict[str, Entry[Any]]], old: Entry[Any] | None, new: Entry[Any] | None
) -> None:
    """An entry was revised, posted (no old one) or taken away (no new one)."""
    before = None if old is None else index.key(old.value)
    after = None if new is None else index.key(new.value)
    if before is not None and old is not None and before != after:
        del filed[before][old.id]
        if not filed[before]:
            del filed[before]
    if after is not None and new is not None:
        filed.setdefault(after, {})[new.id] = new


def _number(entry: Entry[Any]) -> int:
    """Of its posting among those of its type; ``Goal-12`` is the twelfth goal."""
    return int(entry.id.rpartition("-")[2])
