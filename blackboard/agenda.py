"""Agenda: the pending activations, found by the entry that triggered them and by how well they are rated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import IntEnum
from heapq import heapify, heappop, heappush
from typing import NamedTuple

from blackboard.change import Change
from blackboard.knowledge_source import KnowledgeSource


class Activation(NamedTuple):
    """One knowledge source x one trigger.

    Attributes:
        number: sequence number; ties go by it.
        source: who would act.
        trigger: on what.
        rating: how urgent, 0..1.
        cycle: when it was activated.
    """

    number: int
    source: KnowledgeSource
    trigger: Change
    rating: float
    cycle: int


class Obviated(NamedTuple):
    """An activation that was dropped, and why."""

    activation: Activation
    reason: str


SPARE = 16
"""So many activations that are gone may stand in the heap of a level however few are left."""


class Agenda:
    """Pending activations, one for each (source, entry): a trigger is stale as soon as its entry is revised."""

    def __init__(self, levels: Iterable[IntEnum]) -> None:
        self._count = 0
        self._by_entry: dict[str, Activation | list[Activation]] = {}  # mostly one; a list for each takes its time
        self._levels: dict[IntEnum, _Ranked] = {level: _Ranked() for level in levels}

    def add(self, activation: Activation) -> None:
        """Add a new one."""
        self._levels[activation.source.level].add(activation)
        self._count += 1
        id = activation.trigger.entry.id
        pending = self._by_entry.get(id)
        if pending is None:
            self._by_entry[id] = activation
        elif isinstance(pending, list):
            pending.append(activation)
        else:
            self._by_entry[id] = [pending, activation]

    def put_back(self, activation: Activation) -> None:
        """Add one that was taken: by its age it stands before others."""
        self.add(activation)
        id = activation.trigger.entry.id
        self._by_entry[id] = sorted(self.triggered_by(id), key=_number)

    def take(self, activation: Activation) -> None:
        """Remove one that is about to be executed, or that is dropped."""
        self._levels[activation.source.level].take(activation)
        self._count -= 1
        id = activation.trigger.entry.id
        same = self._by_entry[id]
        if isinstance(same, list) and len(same) > 1:
            same.remove(activation)
        else:
            del self._by_entry[id]

    def triggered_by(self, id: str) -> tuple[Activation, ...]:
        """Those whose trigger is a change of this entry, oldest first."""
        same = self._by_entry.get(id)
        if same is None:
            return ()
        return tuple(same) if isinstance(same, list) else (same,)

    def best(self, groups: Iterable[Iterable[IntEnum]]) -> Activation | None:
        """The best rated, and of these the oldest, of the first group of levels that has any."""
        for group in groups:
            firsts = [first for level in group if (first := self._levels[level].first()) is not None]
            if firsts:
                return min(firsts)[2]
        return None

    def __iter__(self) -> Iterator[Activation]:
        """Oldest first."""
        return iter(sorted((a for id in self._by_entry for a in self.triggered_by(id)), key=_number))

    def __len__(self) -> int:
        return self._count


Place = tuple[float, int, Activation]
"""Where an activation stands: best rated first, then oldest."""


class _Ranked:
    """The activations of one level as a heap. What is taken from its midst stays until it comes to the front, or until
    more are gone than are left."""

    __slots__ = ("_gone", "_heap")

    def __init__(self) -> None:
        self._heap: list[Place] = []
        self._gone: set[int] = set()

    def add(self, activation: Activation) -> None:
        if activation.number in self._gone:
            self._gone.remove(activation.number)  # it still stands there
        else:
            heappush(self._heap, (-activation.rating, activation.number, activation))

    def take(self, activation: Activation) -> None:
        """The front of the heap is never gone."""
        heap, gone = self._heap, self._gone
        if heap[0][2] is not activation:
            gone.add(activation.number)
            if 2 * len(gone) > len(heap) + SPARE:
                self._heap = [place for place in heap if place[1] not in gone]
                heapify(self._heap)
                gone.clear()
            return
        heappop(heap)
        while gone and heap and heap[0][1] in gone:
            gone.remove(heappop(heap)[1])

    def first(self) -> Place | None:
        """The best rated, and of these the oldest."""
        return self._heap[0] if self._heap else None

    def __len__(self) -> int:
        """With what is gone."""
        return len(self._heap)


def _number(activation: Activation) -> int:
    return activation.number
