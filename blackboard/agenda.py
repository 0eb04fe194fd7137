"""Agenda: the pending activations, found by the entry that triggered them and by how well they are rated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from heapq import heapify, heappop, heappush

from blackboard.activation import Activation, Obviated
from blackboard.level import Level

Ranked = tuple[float, int, Activation]
"""Sorts activations of one level: the best rated first, then the oldest; as numbers differ it goes no further."""


class Agenda:
    """Pending activations, one for each (source, entry).

    Each servo level has a heap. What was taken or dropped leaves its heap when it is at the top, or when more than half
    of the heap is of that kind; so adding and taking cost O(log n) on average, and nothing is ever searched.
    """

    def __init__(self) -> None:
        self._pending: dict[int, Activation] = {}
        self._by_entry: dict[str, list[Activation]] = {}
        self._heaps: tuple[list[Ranked], ...] = tuple([] for _ in Level)

    def add(self, activation: Activation) -> Obviated | None:
        """Add one; the pending activation of the same source on the same entry, if any, is replaced."""
        number, source, trigger, rating, _cycle = activation
        self._pending[number] = activation
        heap = self._heaps[source.level]
        heappush(heap, (-rating, number, activation))
        if len(heap) > 2 * len(self._pending) + 16:
            self._sift(heap)
        same = self._by_entry.get(trigger.entry.id)
        if same is None:
            self._by_entry[trigger.entry.id] = [activation]
            return None
        return self._beside(same, activation)

    def _beside(self, same: list[Activation], new: Activation) -> Obviated | None:
        """Add one to those of its entry, oldest first; there are as many as experts that it woke, so a list will do."""
        old = next((a for a in same if a.source is new.source), None)
        same.append(new)
        if same[-2].number > new.number:
            same.sort(key=_number)
        if old is None:
            return None
        same.remove(old)
        del self._pending[old.number]
        self._uncover(self._heaps[old.source.level])
        return Obviated(old, f"newer trigger {new.trigger.entry.ref}")

    def take(self, activation: Activation) -> None:
        """Remove one that is about to be executed, or that is dropped."""
        number, source, trigger, _rating, _cycle = activation
        del self._pending[number]
        self._uncover(self._heaps[source.level])
        id = trigger.entry.id
        same = self._by_entry[id]
        if len(same) > 1:
            same.remove(activation)
        else:
            del self._by_entry[id]

    def triggered_by(self, id: str) -> tuple[Activation, ...]:
        """Those whose trigger is a change of this entry, oldest first."""
        same = self._by_entry.get(id)
        return tuple(same) if same else ()

    def best(self, groups: Iterable[Iterable[Level]]) -> Activation | None:
        """The best rated, and of these the oldest, of the first group of levels that has any."""
        heaps = self._heaps
        for group in groups:
            best: Ranked | None = None
            for level in group:
                heap = heaps[level]
                if heap and (best is None or heap[0] < best):
                    best = heap[0]
            if best is not None:
                return best[2]
        return None

    def _uncover(self, heap: list[Ranked]) -> None:
        """Have one at the top that is pending."""
        pending = self._pending
        while heap and heap[0][1] not in pending:
            heappop(heap)

    def _sift(self, heap: list[Ranked]) -> None:
        heap[:] = [ranked for ranked in heap if ranked[1] in self._pending]
        heapify(heap)

    def __iter__(self) -> Iterator[Activation]:
        """Oldest first."""
        return iter(sorted(self._pending.values(), key=_number))

    def __len__(self) -> int:
        return len(self._pending)


def _number(activation: Activation) -> int:
    return activation.number
