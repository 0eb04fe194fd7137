"""The odds of the stated place, where the robot was put down or tracked to: prior odds times the pictures' ratio.

Only its prior probability supports it, not how near a candidate is: a robot that is elsewhere may stand there in just
the same way. A candidate that is farther away than the robot can have moved is another place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import (
    MAX_SLIP_CHI2,
    MIN_P_BELIEVED,
    SLIP_SIGMA_M,
    SLIP_SIGMA_RAD,
    compute_chi2,
    update,
)
from knowledge_sources.methods.localization.global_localization import (
    MAX_SEARCHED_VIEWS,
    MIN_VIEWS,
    AliasTest,
    LocalizationResult,
    LocalizationStatus,
    PlaceCandidate,
)
from world_models.frames import Pose2

P_STATED = 0.98  # probability that the robot is where it was told to be at the start
LOST_AGAIN_ODDS = 0.2  # factor on the odds of that for every time that it was believed by them, and the robot got lost
MAX_ALIKE_LOG_RATIO = 3.0
"""Largest log likelihood ratio of the pictures between places that look alike by the model: more is chance."""
MIN_P_SURE = 0.999  # smallest probability of a place that is believed although another look could tell more
FAR_FROM_CHANCE_LOG = 18.0
"""Log likelihood from which only the same place shows so much, though an inexact model lacks many lines: it is one
place, not the best of a floor, which chance has so many trials to be."""


@dataclass(frozen=True, slots=True, eq=False)
class StatedPlace:
    """Where the robot was put down by what is known, or was tracked to, before it was lost.

    Attributes:
        world_from_robot, covariance: the pose, and (3, 3) over (x, y, heading), world.
        p_prior: probability that it is there, before any picture.
    """

    world_from_robot: Pose2
    covariance: Floats
    p_prior: float

    def includes(self, candidate: PlaceCandidate) -> bool:
        """Whether a candidate is this place."""
        return is_within_reach(candidate.world_from_robot, candidate.covariance, self.world_from_robot,
                               self.covariance)


def weigh_prior(
    result: LocalizationResult, stated: StatedPlace, are_aliases: AliasTest, looks: int,
) -> LocalizationResult:
    """Weigh the candidates by the stated place and by the pictures, the likeliest first.

    The stated place is found if it is accepted and so likely that it is believed: ``min_p_sure``, or ``min_p_believed``
    where no look within reach tells more, after ``min_views`` of ``looks``. After ``max_searched_views`` it need not be
    accepted as the best of a floor, if so many lines are not found by chance. Nothing changes where the pictures alone
    have found a place, or where no candidate is the stated place.
    """
    is_stated = [stated.includes(c) for c in result.candidates]
    if result.status is LocalizationStatus.FOUND or not any(is_stated):
        return result
    best = next(c for c, here in zip(result.candidates, is_stated, strict=True) if here)
    aliased = [are_aliases(best.world_from_robot, c.world_from_robot) for c in result.candidates]
    log_likelihoods = [c.likelihood.log_likelihood for c in result.candidates]
    odds = compute_place_odds(log_likelihoods, is_stated, aliased, stated.p_prior)
    p_any = min(1.0, math.fsum(c.weight for c in result.candidates))
    order = sorted(zip(odds, result.candidates, strict=True), key=lambda weighed: -weighed[0])
    p_most, likeliest = order[0]
    is_tied = result.status is LocalizationStatus.AMBIGUOUS or result.next_action is None
    enough = MIN_P_BELIEVED if is_tied else MIN_P_SURE
    is_confirmed = likeliest.is_accepted and looks >= MIN_VIEWS
    is_confirmed |= looks >= MAX_SEARCHED_VIEWS and likeliest.likelihood.log_likelihood >= FAR_FROM_CHANCE_LOG
    if is_confirmed and p_most >= enough and stated.includes(likeliest):
        return LocalizationResult(LocalizationStatus.FOUND, (replace(likeliest, weight=p_most),))
    return replace(result, candidates=tuple(replace(c, weight=p_any * p) for p, c in order))


def compute_place_odds(
    log_likelihoods: Sequence[float], is_stated: Sequence[bool], is_alias: Sequence[bool], p_prior: float,
) -> tuple[float, ...]:
    """Compute the posterior probabilities of places by Bayes' rule; they sum to one.

    Args:
        log_likelihoods: of the pictures, of each place.
        is_stated: whether a place is stated. These share the prior ``p_prior``, the others what is left of it.
        is_alias: whether a place looks like the likeliest stated one, by the model. Between such places a ratio of the
            pictures that is larger than ``max_alike_log_ratio`` is chance, and counts as that.
    """
    stated = [i for i, here in enumerate(is_stated) if here]
    if not log_likelihoods:
        return ()
    logs = list(log_likelihoods)
    if stated:
        most, best = MAX_ALIKE_LOG_RATIO, max(log_likelihoods[i] for i in stated)
        logs = [best + min(most, max(-most, value - best)) if aliased and not here else value
                for value, here, aliased in zip(logs, is_stated, is_alias, strict=True)]
        others = len(logs) - len(stated)
        if others:
            shares = (math.log((1.0 - p_prior) / others), math.log(p_prior / len(stated)))
            logs = [value + shares[here] for value, here in zip(logs, is_stated, strict=True)]
    weights = np.exp(np.array(logs) - max(logs))
    return tuple(float(w) for w in weights / np.sum(weights))


def weigh_alias_odds(log_ratios: Sequence[float], p_prior: float) -> tuple[float, ...]:
    """Compute the probabilities of the believed place, first, and of each alias; they sum to one.

    Args:
        log_ratios: of the pictures, of each alias to the believed place.
        p_prior: of the believed place; the aliases share what is left.
    """
    if not log_ratios:
        return (1.0,)
    return compute_place_odds([0.0, *log_ratios], [True, *[False] * len(log_ratios)], [False] * (1 + len(log_ratios)),
                              p_prior)


def compute_prior(times_refuted: int) -> float:
    """Compute the prior probability of the stated place after it was believed and refuted so often."""
    return update(P_STATED, times_refuted * math.log(LOST_AGAIN_ODDS))


def is_within_reach(
    pose: Pose2, covariance: Floats, stated: Pose2, stated_covariance: Floats,
) -> bool:
    """Whether a pose may be the stated one, by both covariances (3, 3)."""
    beyond = np.diag(np.square([SLIP_SIGMA_M, SLIP_SIGMA_M, SLIP_SIGMA_RAD]))
    return compute_chi2(pose, stated, covariance + stated_covariance + beyond) <= MAX_SLIP_CHI2
