"""Settings of the knowledge sources of the action level (§5)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ActionSettings:
    """The numbers of the knowledge sources of the action level (§5)."""
