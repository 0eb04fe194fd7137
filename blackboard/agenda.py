"""Agenda: the pending activations, found by the entry that triggered them and by how well they are rated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from heapq import heapify, heappop, heappush

from blackboard.activation import Activation, Obviated
from blackboard.level import Level

Ranked = tuple[float, int]
"""Sorts activations of one level: the best rated first, then the oldest."""


class Agenda:
    """Pending activations, one for each (source, entry).

    Each servo level has a heap. What was taken or dropped stays in its heap until it comes to the top, or until more
    than half of the heap is of that kind; so adding and taking cost O(log n) on average, and nothing is ever searched.
    """

    def __init__(self) -> None:
        self._pending: dict[int, Activation] = {}
        self._by_entry: dict[str, dict[str, Activation]] = {}
        self._heaps: tuple[list[Ranked], ...] = tuple([] for _ in Level)

    def add(self, activation: Activation) -> Obviated | None:
        """Add one; the pending activation of the same source on the same entry, if any, is replaced."""
        entry, number = activation.trigger.entry, activation.number
        same = self._by_entry.setdefault(entry.id, {})
        old = same.get(activation.source.name)
        if old is not None:
            del self._pending[old.number]
        same[activation.source.name] = self._pending[number] = activation
        self._push(activation)
        return Obviated(old, f"newer trigger {entry.ref}") if old else None

    def take(self, activation: Activation) -> None:
        """Remove one that is about to be executed, or that is dropped."""
        del self._pending[activation.number]
        id = activation.trigger.entry.id
        same = self._by_entry[id]
        del same[activation.source.name]
        if not same:
            del self._by_entry[id]

    def triggered_by(self, id: str) -> tuple[Activation, ...]:
        """Those whose trigger is a change of this entry, oldest first."""
        same = self._by_entry.get(id)
        return tuple(sorted(same.values(), key=_number)) if same else ()

    def best(self, groups: Iterable[Iterable[Level]]) -> Activation | None:
        """The best rated, and of these the oldest, of the first group of levels that has any."""
        for group in groups:
            best: Ranked | None = None
            for level in group:
                head = self._head(self._heaps[level])
                if head is not None and (best is None or head < best):
                    best = head
            if best is not None:
                return self._pending[best[1]]
        return None

    def _head(self, heap: list[Ranked]) -> Ranked | None:
        while heap and heap[0][1] not in self._pending:
            heappop(heap)
        return heap[0] if heap else None

    def _push(self, activation: Activation) -> None:
        heap = self._heaps[activation.source.level]
        heappush(heap, (-activation.rating, activation.number))
        if len(heap) > 2 * len(self._pending) + 16:
            heap[:] = [ranked for ranked in heap if ranked[1] in self._pending]
            heapify(heap)

    def __iter__(self) -> Iterator[Activation]:
        """Oldest first."""
        return iter(sorted(self._pending.values(), key=_number))

    def __len__(self) -> int:
        return len(self._pending)


def _number(activation: Activation) -> int:
    return activation.number
