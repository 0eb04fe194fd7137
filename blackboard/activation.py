"""Activation: a knowledge source that could answer a trigger (a KSAR, in the older words)."""

from __future__ import annotations

from dataclasses import dataclass

from blackboard.change import Change
from blackboard.knowledge_source import KnowledgeSource


@dataclass(frozen=True, slots=True)
class Activation:
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

    @property
    def key(self) -> tuple[str, str]:
        """A newer trigger on the same entry replaces the pending one of the same source."""
        return self.source.name, self.trigger.entry.id


@dataclass(frozen=True, slots=True)
class Obviated:
    """An activation that was dropped, and why."""

    activation: Activation
    reason: str
