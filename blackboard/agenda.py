"""Agenda: the pending activations."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from blackboard.activation import Activation, Obviated


class Agenda:
    """Pending activations in order of their numbers, one for each (source, entry)."""

    def __init__(self) -> None:
        self._pending: dict[tuple[str, str], Activation] = {}

    def add(self, activation: Activation) -> Obviated | None:
        """Add one; the pending activation of the same source on the same entry, if any, is replaced."""
        old = self._pending.pop(activation.key, None)
        self._pending[activation.key] = activation
        return Obviated(old, f"newer trigger {activation.trigger.entry.ref}") if old else None

    def take(self, activation: Activation) -> None:
        """Remove one that is about to be executed."""
        del self._pending[activation.key]

    def obviate(self, holds: Callable[[Activation], bool]) -> tuple[Obviated, ...]:
        """Drop those that no longer hold."""
        gone = [a for a in self if not holds(a)]
        for activation in gone:
            del self._pending[activation.key]
        return tuple(Obviated(a, "trigger no longer holds") for a in gone)

    def __iter__(self) -> Iterator[Activation]:
        return iter(tuple(self._pending.values()))

    def __len__(self) -> int:
        return len(self._pending)
