"""Settings of lines, regions, corners and template correlation (§1.2)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FeaturesSettings:
    """The numbers of lines, regions, corners and template correlation (§1.2)."""
