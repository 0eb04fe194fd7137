"""Agenda: the pending activations, few at a time, found by what triggered them and by their rating."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import IntEnum
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


class Agenda:
    """Pending activations, one for each (source, entry): a trigger is stale as soon as its entry is revised."""

    def __init__(self) -> None:
        self._pending: dict[int, Activation] = {}  # by number

    def add(self, activation: Activation) -> None:
        """Add a new one, or put back one that was taken."""
        self._pending[activation.number] = activation

    def take(self, activation: Activation) -> None:
        """Remove one that is about to be executed, or that is dropped."""
        del self._pending[activation.number]

    def triggered_by(self, id: str) -> tuple[Activation, ...]:
        """Those whose trigger is a change of this entry, oldest first."""
        return tuple(activation for activation in self if activation.trigger.entry.id == id)

    def best(self, groups: Iterable[Iterable[IntEnum]]) -> Activation | None:
        """The best rated, and of these the oldest, of the first group of levels that has any."""
        for group in groups:
            found = [activation for activation in self._pending.values() if activation.source.level in group]
            if found:
                return min(found, key=lambda activation: (-activation.rating, activation.number))
        return None

    def __iter__(self) -> Iterator[Activation]:
        """Oldest first."""
        return iter(sorted(self._pending.values(), key=lambda activation: activation.number))

    def __len__(self) -> int:
        return len(self._pending)
