"""How likely the robot is where it believes, and not at a place that looks the same: what the board says of that.

One number for all that ask: the judge of milestones, the search of a lost robot, and the monitor of aliases.
"""

from __future__ import annotations

import math

from blackboard import Discrepancy, Entry, Level, View
from knowledge_sources.methods.localization import compute_prior
from knowledge_sources.reads.questions import open_discrepancy
from knowledge_sources.settings import LocalizationSettings
from world_models.entries import Hypothesis, MotionReport, PlaceOdds, PlaceSearch, Travel, TwinOdds

PLACED_BY = ("command", "relocalization")
"""Bases of a belief that no motion has followed yet."""
MAX_STANDING_M = 0.1
"""Up to such a way the robot has only turned: what wheels do in turns is far less."""


def find_p_there(view: View, refuted: int, settings: LocalizationSettings) -> float:
    """The probability of the believed place: as told, with all pictures since it was told or found.

    ``refuted``: how often a place that was believed by such odds was refuted.
    """
    known, p_told = view.latest(TwinOdds), compute_prior(refuted, settings)
    return p_told if known is None else max(settings.min_p_twin, min(known.value.probability, p_told))


def find_p_not_alias(view: View, settings: LocalizationSettings) -> float:
    """The probability that the robot is where it believes rather than where everything looks the same.

    By the pictures since it was told or found. A robot in doubt may have been displaced, but hardly to such a place.
    """
    known = view.latest(TwinOdds)
    p = compute_prior(count_refuted(view), settings) if known is None else known.value.probability
    p = min(p, settings.min_p_sure)
    return p * (1.0 - settings.p_displaced_to_alias) if open_discrepancy(view, Level.PLAN) is not None else p


def count_refuted(view: View, doubt: Entry[Discrepancy] | None = None) -> int:
    """How often a place that was believed by odds was refuted; ``doubt``: of a robot that is lost now.

    Lost because nothing could be told from where it looked, is no evidence against the place.
    """
    last = view.latest(PlaceOdds)
    if last is None:
        return 0
    return last.value.refuted + (doubt is not None and doubt.cycle > last.cycle and _refutes(view, doubt))


def _refutes(view: View, doubt: Entry[Discrepancy]) -> bool:
    """Whether a doubt at the goal level comes of a place that was measured, or that another one is likelier than."""
    for ref in doubt.because:
        cause = view.get(ref.id)
        if cause is not None and isinstance(cause.value, Discrepancy):
            return cause.value.magnitude is not None and math.isfinite(cause.value.magnitude)
    return True


def find_search_here(view: View, sketch: str) -> Entry[PlaceSearch] | None:
    """The search that has found the place where the robot still stands, but for turns on the spot.

    Its looks are the evidence of that place. A milestone that tells nothing there is no doubt of it: a search would
    find the same place again, and the milestone of this ``sketch`` would tell nothing again; a check of none may doubt.
    """
    found = view.latest(PlaceSearch)
    if found is None or found.value.status != "found" or not sketch:
        return None
    gone_m = math.fsum(abs(report.value.move_m) for report in view.since(MotionReport, found.cycle))
    return found if gone_m <= MAX_STANDING_M else None


def has_only_turned(view: View, belief: Hypothesis) -> bool:
    """Whether the robot has only turned since it was put down, was found, or verified a milestone; nothing pushed it.
    """
    way = view.latest(Travel)
    return belief.basis in PLACED_BY or (
        way is not None and not way.value.is_broken and way.value.gone_m <= MAX_STANDING_M)
