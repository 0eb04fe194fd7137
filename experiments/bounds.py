"""Bounds of a rate: what so many of so many prove of it, by Clopper and Pearson, one-sided."""

from __future__ import annotations

from scipy.stats import beta

CONFIDENCE = 0.95


def at_most(found: int, of: int) -> float:
    """The upper bound of a rate: 0 of 1,000 proves 0.3 %; nothing is proved by none."""
    _check(found, of)
    return 1.0 if found == of else float(beta.ppf(CONFIDENCE, found + 1, of - found))


def at_least(found: int, of: int) -> float:
    """The lower bound of a rate."""
    return 1.0 - at_most(of - found, of)


def _check(found: int, of: int) -> None:
    if not 0 <= found <= of:
        raise ValueError(f"expected 0 to {of} of {of}, got {found}")
