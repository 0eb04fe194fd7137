"""The noise of lines or points of which only those near enough are kept: larger than the kept ones show.

A line or point has two residuals of the normal law. Of all of them the part F2, chi-squared's law with two degrees of
freedom, is kept, and of their squares F4, the same with four, both at bound / s where s is the variance. The kept ones'
mean square is m = s F4 / F2. Their Hessian is F2 times that of all, and the pose's variance is s / F4 times the inverse
of that (Huber: E[psi^2] / E[psi']^2). So it is s F2 / F4 = s^2 / m times what the kept ones' Hessian says.
"""

from __future__ import annotations

import math


def compute_mean_square(variance: float, bound: float) -> float:
    """Mean square of a residual of the normal law in pairs of which those beyond ``bound`` (sum of squares) are cut."""
    if math.isinf(bound):
        return variance
    half = 0.5 * bound / variance
    outside = math.exp(-half)
    return variance * (1.0 - outside * (1.0 + half)) / (1.0 - outside)


def compute_spread(mean: float, bound: float, most: float) -> float:
    """Factor on the covariance of the kept ones' Hessian, by their mean square over the stated variance.

    Args:
        mean: of the squared residuals; below what noise as stated leaves, the noise is as stated.
        bound: of a pair's squared residuals over their stated variance; infinite where none is cut.
        most: the largest variance that is looked for: the mean hardly tells larger ones apart.
    """
    if mean <= compute_mean_square(1.0, bound):
        variance = 1.0
    elif mean >= compute_mean_square(most, bound):
        variance = max(most, mean)
    else:
        from scipy.optimize import brentq  # loaded when first used: most missions start without it

        variance = float(brentq(lambda s: compute_mean_square(s, bound) - mean, 1.0, most))
    return variance * variance / compute_mean_square(variance, bound)
