"""Settings of the pose solvers (§6.2)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PoseSettings:
    """The numbers of the pose solvers (§6.2)."""
