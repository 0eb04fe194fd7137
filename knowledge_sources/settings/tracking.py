"""Settings of following landmarks from frame to frame (§5)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """The numbers of following landmarks from frame to frame (§5)."""
