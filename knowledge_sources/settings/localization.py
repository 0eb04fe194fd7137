"""Settings of finding the robot when its pose is unknown or in doubt."""

from __future__ import annotations

import math
from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"
_KIDNAP = "engineering judgement, checked with harvey experiment kidnap"


@dataclass(frozen=True, slots=True)
class LocalizationSettings:
    """The numbers of finding the robot when its pose is unknown or in doubt."""

    # Acceptance of a pose
    min_views: int = setting(
        2, "count", "Fewest views by which a pose is accepted: one may fit a place that the model lacks.", _KIDNAP)
    min_matched_lines: int = setting(12, "count", "Fewest matched lines of an accepted pose.", _KIDNAP)
    min_matched_fraction: float = setting(
        0.6, "1", "Smallest part of the predicted lines that an accepted pose matches.", _KIDNAP)
    min_view_fraction: float = setting(
        0.35, "1", "Smallest part of the predicted lines that an accepted pose matches in any view.", _KIDNAP)
    min_explained_fraction: float = setting(
        0.35, "1", "Smallest part of the segments that an accepted pose explains.", _KIDNAP)
    min_fraction_sum: float = setting(
        1.15, "1", "Smallest sum of matched and explained parts: a pose nearby has a little of both.",
        "rough-day, seed 91")
    sure_log_likelihood: float = setting(
        40.0, "1", "Log likelihood from which segments need no explanation: the model lacks what is on full shelves.",
        _KIDNAP)
    sure_matched_fraction: float = setting(
        0.75, "1", "Part of the predicted lines from which segments need no explanation.", _KIDNAP)
    min_log_likelihood: float = setting(2.0, "1", "Smallest log likelihood of a hypothesis that is kept.", _KIDNAP)
    refuting_log_ratio: float = setting(
        8.0, "1", "Log likelihood ratio (Bayes factor) by which a better hypothesis refutes a distinct one.", _KIDNAP)
    max_hypotheses: int = setting(6, "count", "Most hypotheses that are kept.", _JUDGED)

    max_doubted_pictures: int = setting(
        3, "count", "A camera that so few pictures taught is tried as told too, when the robot is lost.", _JUDGED)

    # Driving to a view that tells places apart
    max_searched_views: int = setting(
        4, "count", "Views after which places are followed, and no longer searched for, while two are accepted.",
        _JUDGED)

    # Odds of the place where the robot was told to be, or was tracked to
    p_told: float = setting(
        0.98, "1", "Probability that the robot is where it was told to be at the start.", _JUDGED)
    lost_again_odds: float = setting(
        0.2, "1", "Factor on the odds of that for every time that it was believed by them, and the robot got lost.",
        _JUDGED)
    told_sigma_m: float = setting(
        0.1, "m", "Standard deviation that a tracked position has beyond its covariance: it may have slipped.", _JUDGED)
    told_sigma_rad: float = setting(
        math.radians(3.0), "rad", "Standard deviation that a tracked heading has beyond its covariance.", _JUDGED)
    max_told_chi2: float = setting(
        21.1, "1", "Largest squared distance of a place from where it was told or tracked to be that is still that"
        " place, in deviations; three unknowns, 99.99 %.", _JUDGED)
    max_alike_log_ratio: float = setting(
        3.0, "1", "Largest log likelihood ratio of the pictures between places that look alike by the model: more is"
        " chance.", _JUDGED)
    alike_log_noise: float = setting(
        2.0, "1", "Log likelihood ratio of one picture between places that look alike by the model that is noise.",
        "generated floors of seeds 0 to 2")
    min_p_tracked: float = setting(
        0.8, "1", "Smallest probability, against all places that look alike, of a place that is not doubted.", _JUDGED)
    min_p_twin: float = setting(
        1e-6, "1", "Smallest probability of a place that looks alike and is kept in mind.", _JUDGED)
    min_p_believed: float = setting(
        0.97, "1", "Smallest probability of a place that is believed where no look within reach tells more.", _JUDGED)
    min_p_sure: float = setting(
        0.999, "1", "Smallest probability of a place that is believed although another look could tell more.", _JUDGED)
