"""Settings of the knowledge sources of the goal level (§2)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class GoalSettings:
    """The numbers of the knowledge sources of the goal level (§2)."""
