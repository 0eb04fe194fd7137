"""Few lines and a prior of unknown worth: move it no further than the lines' noise demands."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

State = TypeVar("State")

UNUSUAL = 3.0
"""Standard deviations by which the sum of squares may exceed its mean where the lines are explained."""
MOST_PULL, NEAR_ENOUGH = 10.0, 0.1
"""Logarithms (base 10): the greatest weight of a prior, in weak ones, that is tried, and how closely it is found."""


def most_unexplained(freedom: float) -> float:
    """The greatest sum of squares, over their variance, that noise of so many degrees of freedom leaves."""
    return freedom + UNUSUAL * math.sqrt(2.0 * freedom)


def least_move(
    prior: State, pulled: Callable[[float], State], unexplained: Callable[[State], float], allowed: float
) -> State:
    """The state nearest to the prior that explains the lines to their noise, or as well as any near it does.

    Few lines are fitted to a hair by many poses, and in directions of which they say little their noise would carry the
    pose far. How good the prior is nobody said; so its weight is the greatest under which the lines are explained
    (Morozov's discrepancy principle).

    Args:
        pulled: the likeliest state where the prior weighs so many weak ones. unexplained: a state's sum of squares.
    """
    if unexplained(prior) <= allowed:
        return prior
    best, low = pulled(1.0), 0.0
    high = MOST_PULL if unexplained(best) <= allowed else low
    while high - low > NEAR_ENOUGH:
        middle = 0.5 * (low + high)
        trial = pulled(10.0**middle)
        if unexplained(trial) <= allowed:
            best, low = trial, middle
        else:
            high = middle
    return best
