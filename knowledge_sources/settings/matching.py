"""Settings of line matching (§6.1)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MatchingSettings:
    """The numbers of line matching (§6.1)."""
