"""Settings of routes, clearance and the steering law (§5)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """The numbers of routes, clearance and the steering law (§5)."""
