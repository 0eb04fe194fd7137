"""Retention: which entries leave memory, so that a board does not grow with the time that it runs.

How long entries of a kind stay is said where the kind is defined (:class:`blackboard.kinds.Kind`). What leaves was
posted, seen and journalled long ago, and no decision can need it any more. The law
(tests/laws/board/test_laws_retention.py): with and without retention the decisions are the same, to the byte; but what
comes by request is asked for again when it is needed again (tests/laws/board/test_laws_missing_entries.py). A revision
that left can still be read in the journal.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any

from blackboard.agenda import Agenda
from blackboard.board import Blackboard
from blackboard.change import Change, Posted
from blackboard.entry import Entry, Ref
from blackboard.kinds import Kind, nothing


class Retention:
    """Removes from memory what may leave, a little in each cycle."""

    def __init__(self, kinds: Mapping[type[Any], Kind]) -> None:
        self._ages = {value_type: _Ages(kind.keep) for value_type, kind in kinds.items() if kind.keep is not None}
        self._kinds = kinds
        self._held: tuple[Change, ...] = ()
        self._needing = tuple(value_type for value_type, kind in kinds.items() if kind.needs is not nothing)

    def sweep(
        self, seen: Iterable[Change], board: Blackboard, agenda: Agenda, *, hold: bool = False
    ) -> tuple[Ref, ...]:
        """Note what was posted, and remove what is due; its last revisions. The time follows the number of changes.

        With ``hold`` all stays: an act waits for what it asked for, and may need anything that is there. What would
        have been due then is due afterwards.
        """
        if hold:
            self._held += tuple(seen)
            return ()
        left: list[Ref] = []
        for change in chain(self._held, seen):
            ages = self._ages.get(type(change.entry.value)) if isinstance(change, Posted) else None
            if ages is None:
                continue
            for id in ages.due(change.entry.id):
                entry = board.view.get(id)
                if entry is None:
                    continue
                if self._may_leave(entry, board, agenda):
                    board.forget(id)
                    left.append(entry.ref)
                else:
                    ages.put_back(id)
        self._held = ()
        return tuple(left)

    def _may_leave(self, entry: Entry[Any], board: Blackboard, agenda: Agenda) -> bool:
        kind, view = self._kinds[type(entry.value)], board.view
        if not kind.when(entry.value) or agenda.triggered_by(entry.id) or kind.unless(view, entry):
            return False
        return not any(entry.id in self._kinds[value_type].needs(other.value)
                       for value_type in self._needing for other in view.all(value_type))


class _Ages:
    """The entries of one kind by age: the newest, which stay, and the older ones.

    Two of the older ones are looked at for each that is posted, so there are never many more of them than must stay.
    """

    def __init__(self, keep: int) -> None:
        self._keep = keep
        self._newest: deque[str] = deque()
        self._older: deque[str] = deque()

    def due(self, posted: str) -> list[str]:
        """The ids to look at now that one more was posted."""
        self._newest.append(posted)
        if len(self._newest) > self._keep:
            self._older.append(self._newest.popleft())
        return [self._older.popleft() for _ in range(min(2, len(self._older)))]

    def put_back(self, id: str) -> None:
        self._older.append(id)
