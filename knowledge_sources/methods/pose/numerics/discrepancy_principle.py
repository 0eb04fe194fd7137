"""Few lines and a prior of unknown worth: Morozov's discrepancy principle."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

from knowledge_sources.settings.pose import PoseSettings

State = TypeVar("State")


def compute_max_chi2(freedom: float, settings: PoseSettings) -> float:
    """The largest sum of squares, over their variance, that noise of so many degrees of freedom leaves."""
    return freedom + settings.max_chi2_sigmas * math.sqrt(2.0 * freedom)


def solve_near_prior(
    prior: State,
    solve: Callable[[float], State],
    compute_chi2: Callable[[State], float],
    max_chi2: float,
    settings: PoseSettings,
) -> State:
    """The state nearest to the prior that explains the lines to their noise, by Morozov's discrepancy principle.

    Many poses fit few lines, and in directions of which they say little their noise would move the pose far. Nobody
    stated how good the prior is; so its weight is the largest one under which the lines are still explained, or fitted
    as well as any state near the prior does. The weight is found by bisection.

    Args:
        solve: the likeliest state where the prior weighs this many weak ones.
        compute_chi2: a state's sum of squared residuals over their variance.
        max_chi2: up to this the lines are explained.
    """
    if compute_chi2(prior) <= max_chi2:
        return prior
    best, low = solve(1.0), 0.0
    high = settings.max_prior_weight_log10 if compute_chi2(best) <= max_chi2 else low
    while high - low > settings.prior_weight_step_log10:
        middle = 0.5 * (low + high)
        trial = solve(10.0**middle)
        if compute_chi2(trial) <= max_chi2:
            best, low = trial, middle
        else:
            high = middle
    return best
