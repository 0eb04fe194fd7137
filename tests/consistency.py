"""Whether errors are as large as stated: the normalised error squared (NEES) within its chi-square band.

And a hall, for the laws that ask it.

Source: Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*, §5.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from world_models.frames import Pose2, wrap_angle

Array = NDArray[np.float64]
P_OUTSIDE = 1e-3
"""Probability that an honest estimator is outside one end of its band."""
P_UNNOTICED = 0.05
"""How likely variances that are to be found may pass before all draws are made."""


def build_hall() -> Array:
    """Door posts, lintels and long edges ahead of the robot (n, 2, 3)."""
    lines = [[[1.5, y, z], [15.0, y, z]] for y in (-1.2, 1.2) for z in (0.0, 2.4)]
    for x in (3.0, 5.5, 8.0, 11.0):
        for y in (-1.2, 1.2):
            far = x + 0.9
            lines += [[[x, y, 0.0], [x, y, 2.1]], [[far, y, 0.0], [far, y, 2.1]], [[x, y, 2.1], [far, y, 2.1]]]
    return np.array(lines)


def compute_error(found: Pose2, truth: Pose2) -> Array:
    """(3,) error in x [m], y [m], heading [rad]."""
    return np.array([found.x_m - truth.x_m, found.y_m - truth.y_m, wrap_angle(found.heading_rad - truth.heading_rad)])


def compute_nees(error: Any, covariance: Any) -> float:
    """Squared error (d,) in units of its covariance (d, d)."""
    e = np.asarray(error, float)
    return float(e @ np.linalg.solve(np.asarray(covariance, float), e))


def assert_consistent(errors: Iterable[float], freedom: int, *, most_surplus: float = 1.0, most: float = 1.0) -> None:
    """The mean NEES is within the chi-square band of as many independent draws.

    Args:
        errors: one NEES a draw. freedom: unknowns of a draw.
        most_surplus: by how much the stated variance may be too large, where the method promises no more than a bound.
        most: by how much the variance may be too small; 1: not at all.
    """
    values = np.array(list(errors))
    count = freedom * len(values)
    mean = float(values.mean()) / freedom
    low, high = (float(chi2.ppf(p, count)) / count for p in (P_OUTSIDE, 1.0 - P_OUTSIDE))
    assert mean <= most * high, f"overconfident: errors squared are {mean:.2f} times the stated, not {most * high:.2f}"
    assert mean >= low / most_surplus, (
        f"underconfident: errors squared are {mean:.2f} times the stated, at least {low / most_surplus:.2f}")


def assert_soon_consistent(
    draw: Callable[[int], float], draws: int, freedom: int, *, most_surplus: float = 1.0, most: float = 1.0
) -> None:
    """The same of the draws of seeds from 0, which end as soon as the outcome is clear (Wald's sequential test).

    Clear is that variances are not so far off that the whole band would find it nine times in ten. An honest estimator
    takes about half of the draws; one that is so far off is found in 89 of 100 cases.

    Args:
        draw: the NEES of a seed. draws: so many at most.
    """
    whole, errors = freedom * draws, list[float]()
    low, high = (float(chi2.ppf(p, whole)) for p in (P_OUTSIDE, 1.0 - P_OUTSIDE))
    too_small, too_large = high / float(chi2.ppf(0.1, whole)), float(chi2.ppf(0.9, whole)) / low
    for seed in range(draws):
        errors.append(draw(seed))
        total, count = sum(errors), freedom * len(errors)
        if (_compare(total / most, count, too_small) < P_UNNOTICED
                and _compare(total * most_surplus, count, 1.0 / too_large) < P_UNNOTICED):
            return
    assert_consistent(errors, freedom, most_surplus=most_surplus, most=most)


def _compare(total: float, count: int, times: float) -> float:
    """How much likelier so many errors squared are with ``times`` the variances that are stated than with these."""
    return math.exp(-0.5 * count * math.log(times) - 0.5 * total * (1.0 / times - 1.0))
