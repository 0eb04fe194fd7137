"""Settings of finding the robot when no pose is known."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LocalizationSettings:
    """The numbers of finding the robot when no pose is known."""
