"""A place against none of these: the robot may be where no plan is, or where the search does not find it.

The best place of a floor agrees with the pictures even where the robot is not on that floor: the best of very many
wrong places is the largest of many values, so how well it agrees has a Gumbel distribution. What it agrees by is
little of what is seen. Both were measured on development floors, plain and textured, without the room in which the
robot stood. So no share of lines decides: how many a right place shows is integrated out (``compute_log_ratio``).
"""

from __future__ import annotations

import math

from knowledge_sources.methods.localization.refinement import PoseLikelihood

P_OFF_PLAN = 0.02
"""Probability that the robot is at no place of those that are searched, before any picture."""
WRONG_LOG, WRONG_SPREAD_LOG = 1.9, 5.7
"""Mode and scale of the log likelihood of the best wrong place of a floor, by two looks; by more looks it is less."""
RIGHT_SPREAD_LOG = 120.0
"""The log likelihood of the right place is anywhere up to this: by how much can be seen from there."""
WRONG_EXPLAINED = 0.17
"""Mean part of what is seen that the best wrong place explains; any part is as likely at the right place."""
MAX_EXPLAINED = 0.5
"""More than this part says no more: a wrong place that explains more has not been met, which is no proof."""
P_HIDDEN_LOOK = 1e-3
"""Probability that one look shows next to nothing of what should be seen from the right place."""
MIN_P_PLACE = 0.99
"""Smallest probability of a place against none of these, with which it may be believed."""


def compute_p_place(likelihood: PoseLikelihood) -> float:
    """The probability of the best place of a floor against none of these, by all looks."""
    z = (max(likelihood.log_likelihood, WRONG_LOG) - WRONG_LOG) / WRONG_SPREAD_LOG
    wrong = -math.log(WRONG_SPREAD_LOG) - z - math.exp(-z)
    explained = min(likelihood.explained, MAX_EXPLAINED) / WRONG_EXPLAINED + math.log(WRONG_EXPLAINED)
    weakest = math.log(max(P_HIDDEN_LOOK, likelihood.compute_p_weakest_look()))
    log_odds = math.log((1.0 - P_OFF_PLAN) / P_OFF_PLAN) - math.log(RIGHT_SPREAD_LOG) - wrong + explained + weakest
    return 1.0 / (1.0 + math.exp(-log_odds))
