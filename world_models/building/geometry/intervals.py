"""Intervals on a line."""

from __future__ import annotations

from collections.abc import Sequence

Interval = tuple[float, float]
"""(low, high)."""


def subtract_intervals(whole: Interval, taken: Sequence[Interval], min_length: float) -> list[Interval]:
    """The pieces of ``whole`` outside all ``taken`` intervals, at least ``min_length`` long, in order."""
    pieces, at = [], whole[0]
    for low, high in sorted(taken):
        if low > at:
            pieces.append((at, min(low, whole[1])))
        at = max(at, high)
    pieces.append((at, whole[1]))
    return [(low, high) for low, high in pieces if high - low >= min_length]
