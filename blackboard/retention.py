"""Retention: which entries leave memory, so that a board does not grow with the time that it runs.

What is forgotten was posted, seen and journalled long ago, and nobody can need it any more: the rules that say so are
handed over by who wires the experts. The law (tests/laws/board/test_laws_retention.py): with and without them the
decisions are the same, to the byte. A forgotten revision can still be read in the archive.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from blackboard.agenda import Agenda
from blackboard.board import Blackboard, View
from blackboard.change import Change, Posted, always
from blackboard.entry import Entry

T_contra = TypeVar("T_contra", contravariant=True)


def never(_view: View, _entry: Entry[Any]) -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Forget(Generic[T_contra]):
    """Lets go of entries of a type.

    An entry that a pending activation was triggered by always stays; so do types for which there is no rule.

    Attributes:
        kind: the class of the values.
        keep: the newest postings, so many, stay.
        when: of the older ones only those go of which this holds; pure.
        unless: those stay that something else on the board still needs; pure, and asked anew until it does not.
    """

    kind: type[Any]
    keep: int = 1
    when: Callable[[T_contra], bool] = always
    unless: Callable[[View, Entry[Any]], bool] = never


class Retention:
    """Carries out the rules, a little in each cycle."""

    def __init__(self, rules: Sequence[Forget[Any]]) -> None:
        """Raises ValueError where two rules are for one type."""
        self._shelves = {rule.kind: _Aging(rule) for rule in rules}
        if len(self._shelves) != len(rules):
            raise ValueError(f"expected one rule for each type, got {[rule.kind.__name__ for rule in rules]}")

    def sweep(self, seen: Iterable[Change], board: Blackboard, agenda: Agenda) -> None:
        """Take note of what was posted, and forget what is due. Takes as long as there are changes."""
        for change in seen:
            aging = self._shelves.get(type(change.entry.value)) if isinstance(change, Posted) else None
            if aging is not None:
                aging.sweep(change.entry.id, board, agenda)


class _Aging:
    """The entries of one type, by age: the newest, and those that go when nobody needs them.

    Two of the older ones are looked at for each one that is posted, so they never are many more than those in need.
    """

    def __init__(self, rule: Forget[Any]) -> None:
        self._rule = rule
        self._newest: deque[str] = deque()
        self._older: deque[str] = deque()

    def sweep(self, posted: str, board: Blackboard, agenda: Agenda) -> None:
        self._newest.append(posted)
        if len(self._newest) > self._rule.keep:
            self._older.append(self._newest.popleft())
        for _ in range(min(2, len(self._older))):
            id = self._older.popleft()
            entry = board.view.get(id)
            if entry is None:
                continue
            if self._may_go(entry, board.view, agenda):
                board.forget(id)
            else:
                self._older.append(id)

    def _may_go(self, entry: Entry[Any], view: View, agenda: Agenda) -> bool:
        rule = self._rule
        return rule.when(entry.value) and not agenda.triggered_by(entry.id) and not rule.unless(view, entry)
