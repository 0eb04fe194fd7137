"""Belief: how evidence is added up, of places, doors and milestones alike.

``odds`` adds the log odds of looks, and counts once what two looks show both; ``places`` weighs a place against its
aliases, by what was believed before and by the picture; ``rivals`` weighs the explanations of one difference.
"""

from knowledge_sources.methods.belief.odds import (
    Alike, Look, add_looks, measure_common, to_log_odds, to_probability, update,
)
from knowledge_sources.methods.belief.places import (
    BelievedPlace, MAX_CAMERA_CHI2, MAX_SLIP_CHI2, MIN_P_BELIEVED, SLIP_SIGMA_M, SLIP_SIGMA_RAD, bound_p_aliases,
    compute_chi2,
    compute_p_aliases,
)
from knowledge_sources.methods.belief.rivals import PRIORS, add_evidence, hedge, weigh_among, weigh_rivals

__all__ = [
    "MAX_CAMERA_CHI2", "MAX_SLIP_CHI2", "MIN_P_BELIEVED", "PRIORS", "SLIP_SIGMA_M", "SLIP_SIGMA_RAD",
    "Alike", "BelievedPlace", "Look", "add_evidence", "add_looks", "bound_p_aliases", "compute_chi2",
    "compute_p_aliases", "hedge", "measure_common", "to_log_odds", "to_probability", "update", "weigh_among",
    "weigh_rivals",
]
