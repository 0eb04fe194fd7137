"""Agenda: the pending activations, found by the entry that triggered them and by how well they are rated."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from heapq import heapify, heappop, heappush
from typing import NamedTuple

from blackboard.change import Change
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level


class Activation(NamedTuple):
    """One knowledge source x one trigger.

    Attributes:
        number: sequence number; ties go by it.
        source: who would act.
        trigger: on what.
        rating: how well, 0..1.
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
"""So many queues of a level are kept whether or not they are empty."""


class Agenda:
    """Pending activations, one for each (source, entry).

    Adding, taking and finding the best cost the same however many are pending: sources give few different ratings, and
    those of one rating stand in a queue.
    """

    def __init__(self) -> None:
        self._count = 0
        self._by_entry: dict[str, Activation | list[Activation]] = {}  # mostly one; a list for each takes its time
        self._levels: tuple[_Queues, ...] = tuple(_Queues() for _ in Level)

    def add(self, activation: Activation) -> Obviated | None:
        """Add a new one; the pending activation of the same source on the same entry, if any, is replaced."""
        source, id = activation.source, activation.trigger.entry.id
        self._levels[source.level].add(activation)
        self._count += 1
        pending = self._by_entry.get(id)
        if pending is None:
            self._by_entry[id] = activation
            return None
        same = self._by_entry[id] = pending if isinstance(pending, list) else [pending]
        old = next((a for a in same if a.source is source), None)
        same.append(activation)
        if old is None:
            return None
        self.take(old)
        return Obviated(old, f"newer trigger {activation.trigger.entry.ref}")

    def put_back(self, activation: Activation) -> None:
        """Add one that was taken: by its age it stands before others."""
        self._levels[activation.source.level].put_back(activation)
        self._count += 1
        id = activation.trigger.entry.id
        self._by_entry[id] = sorted((*self.triggered_by(id), activation), key=_number)

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

    def best(self, groups: Iterable[Iterable[Level]]) -> Activation | None:
        """The best rated, and of these the oldest, of the first group of levels that has any."""
        levels = self._levels
        for group in groups:
            best = None
            for level in group:
                queues = levels[level]
                if queues.ratings:
                    first = queues.first()
                    if first is not None and (best is None or _rank(first) < _rank(best)):
                        best = first
            if best is not None:
                return best
        return None

    def __iter__(self) -> Iterator[Activation]:
        """Oldest first."""
        return iter(sorted((a for id in self._by_entry for a in self.triggered_by(id)), key=_number))

    def __len__(self) -> int:
        return self._count


class _Queues:
    """The activations of one level: a queue for each rating, oldest first, and a heap of those ratings.

    What is taken from the midst of a queue stays there until it comes to the front, or until more are gone than are
    left. A queue that has run empty stays until it comes to the top of the heap, or until there are twice as many
    queues as were needed when the empty ones were last closed.
    """

    __slots__ = ("_count", "_gone", "_most", "_queues", "ratings")

    def __init__(self) -> None:
        self._queues: dict[float, deque[Activation]] = {}
        self._gone: set[int] = set()
        self._count = 0
        self.ratings: list[float] = []
        self._most = SPARE

    def add(self, activation: Activation) -> None:
        queue = self._queues.get(activation.rating)
        if queue is None:
            queue = self._opened(activation.rating)
        queue.append(activation)
        self._count += 1

    def put_back(self, activation: Activation) -> None:
        if activation.number in self._gone:
            self._gone.remove(activation.number)
            self._count += 1
            return
        self.add(activation)
        rating = activation.rating
        self._queues[rating] = deque(sorted(self._queues[rating], key=_number))

    def take(self, activation: Activation) -> None:
        """The front of a queue is never gone."""
        queue, gone = self._queues[activation.rating], self._gone
        self._count -= 1
        if queue[0] is not activation:
            gone.add(activation.number)
            if len(gone) > self._count + SPARE:
                self._sweep()
            return
        queue.popleft()
        while gone and queue and queue[0].number in gone:
            gone.remove(queue.popleft().number)

    def first(self) -> Activation | None:
        """The best rated, and of these the oldest."""
        ratings, queues = self.ratings, self._queues
        while ratings:
            queue = queues[-ratings[0]]
            if queue:
                return queue[0]
            del queues[-heappop(ratings)]
        return None

    def _opened(self, rating: float) -> deque[Activation]:
        if len(self._queues) > self._most:
            self._close_empty()
        queue = self._queues[rating] = deque()
        heappush(self.ratings, -rating)
        return queue

    def _sweep(self) -> None:
        for rating, queue in self._queues.items():
            self._queues[rating] = deque(a for a in queue if a.number not in self._gone)
        self._gone.clear()

    def _close_empty(self) -> None:
        self._queues = {rating: queue for rating, queue in self._queues.items() if queue}
        self.ratings = [-rating for rating in self._queues]
        heapify(self.ratings)
        self._most = 2 * len(self._queues) + SPARE

    def __len__(self) -> int:
        """What it holds beside what is pending: queues, and activations that are gone."""
        return len(self._queues) + len(self._gone)


def _rank(activation: Activation) -> tuple[float, int]:
    return -activation.rating, activation.number


def _number(activation: Activation) -> int:
    return activation.number
