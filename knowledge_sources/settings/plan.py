"""Settings of the knowledge sources of the plan level (§4, §6)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """The numbers of the knowledge sources of the plan level (§4, §6)."""
