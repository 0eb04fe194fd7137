"""The protection level of a pose, in aviation's words: how far off it may be at a stated risk."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist

from world_models import words

RISK = 1e-4
"""Probability that a pose is further off than its protection level."""
ALERT_LIMIT_M = 0.10
"""A place that may be further off is not available: where the belief is surer, another look is taken if it may be."""
SHARED_SIGMA_M = 0.0077
"""Deviation of what a model, a camera and a matcher share in all pictures of a mission, so that no covariance of one
picture has it: added in squares, it bounds how far beliefs are off in missions without a fault."""


@dataclass(frozen=True, slots=True, order=True)
class Protection:
    """A protection level.

    Attributes:
        place_m: the place is off by more with a probability of at most :data:`RISK`; heading_rad: the heading.
        doubted: what moves the place most where it is false.
    """

    place_m: float
    heading_rad: float
    doubted: str

    @property
    def is_available(self) -> bool:
        """Whether the place is known well enough for a certificate."""
        return self.place_m <= ALERT_LIMIT_M

    def words(self) -> str:
        return (f"protection level {words.metres(self.place_m)} and {words.degrees(self.heading_rad)}, by"
                f" {words.landmark(self.doubted)}")


UNPROTECTED = Protection(0.0, 0.0, "")
"""Nobody has asked how far off the pose may be."""


@lru_cache
def count_sigmas(alternatives: int) -> float:
    """Deviations beyond which a coordinate lies with a probability of :data:`RISK`, shared by so many alternatives."""
    return -NormalDist().inv_cdf(0.5 * RISK / alternatives)
