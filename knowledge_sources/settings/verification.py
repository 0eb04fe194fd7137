"""Settings of evidence for a pose, and what a milestone needs to be verified."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class VerificationSettings:
    """The numbers of evidence for a pose, and what a milestone needs to be verified."""
