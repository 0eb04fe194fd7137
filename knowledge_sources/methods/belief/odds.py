"""Log odds, and the one rule for what is no new evidence: a look from where one was taken before.

Looks at the same thing from the same place share what may mislead them: a reflection, a jamb, a missing line. So of two
such looks only the stronger counts; the less two of them have in common, the more the weaker adds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from world_models.frames import Pose2, wrap_angle

MAX_PROBABILITY = 1.0 - 1e-9  # no evidence makes anything more certain than this


class Look(NamedTuple):
    """What one look says: from which pose (world) it was taken, and its log likelihood ratio."""

    pose: Pose2
    log_ratio: float


class Alike(NamedTuple):
    """How far looks must be apart to be independent: by so much of the way [m], or by so much of a turn [rad]."""

    step_m: float
    turn_rad: float


def to_log_odds(probability: float) -> float:
    """The log odds of a probability; that of certainty is finite."""
    p = min(max(probability, 1.0 - MAX_PROBABILITY), MAX_PROBABILITY)
    return math.log(p / (1.0 - p))


def to_probability(log_odds: float) -> float:
    """The probability of log odds."""
    return 1.0 / (1.0 + math.exp(-max(min(log_odds, 700.0), -700.0)))


def update(probability: float, log_ratio: float) -> float:
    """A probability after evidence, by Bayes' rule."""
    return to_probability(to_log_odds(probability) + log_ratio) if log_ratio else probability


def measure_common(one: Pose2, other: Pose2, alike: Alike) -> float:
    """The part that looks from two poses have in common: 1 from the same pose, 0 where they are independent."""
    step = one.distance_to(other) / alike.step_m
    turn = abs(wrap_angle(one.heading_rad - other.heading_rad)) / alike.turn_rad
    return max(0.0, 1.0 - max(step, turn))


def _order(look: Look) -> tuple[float, ...]:
    """The strongest first; of equals by where they were taken from, so that the order of looks does not matter."""
    return -abs(look.log_ratio), look.log_ratio, look.pose.x_m, look.pose.y_m, look.pose.heading_rad


def add_looks(looks: Sequence[Look], alike: Alike, besides: Sequence[Pose2] = ()) -> float:
    """The log odds that looks add together, in any order.

    The strongest counts whole; each weaker one by the part that it has in common with none of the stronger ones, nor
    with looks from ``besides``, which are counted elsewhere.
    """
    total, counted = 0.0, list(besides)
    for look in sorted(looks, key=_order):
        common = max((measure_common(look.pose, other, alike) for other in counted), default=0.0)
        total += (1.0 - common) * look.log_ratio
        counted.append(look.pose)
    return total
