"""Activation: a knowledge source that could answer a trigger (a KSAR, in the older words)."""

from __future__ import annotations

from typing import NamedTuple

from blackboard.change import Change
from blackboard.knowledge_source import KnowledgeSource


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
