"""How likely the robot is where it believes, and not at a place that looks the same: what the board says of that.

One number for all that ask: the milestone judge, the search of a lost robot, and the alias monitor.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from blackboard import Entry, Level, View
from knowledge_sources.methods.belief import BelievedPlace, bound_p_aliases, compute_p_aliases
from knowledge_sources.methods.localization import (
    DISTINCT,
    MAX_ALIKE_LOG_RATIO,
    MIN_P_SURE,
    compare_places,
    compute_prior,
    list_aliases,
)
from knowledge_sources.methods.verification import P_WRONG_STANDING, Weighed, compute_coverage_elsewhere
from knowledge_sources.reads.questions import find_building, find_camera, find_robot_in, open_discrepancy
from world_models.entries import (
    AliasOdds,
    Discrepancy,
    Hypothesis,
    MotionReport,
    PlaceOdds,
    PlaceSearch,
    PoseFix,
    Ride,
    RideReport,
    Travel,
)
from world_models.frames import Pose2

MAX_P_RIVAL = 0.03
"""Largest probability of a place that looks alike, by belief and picture, where one is verified (as
localization.min_p_believed has it)."""
P_DISPLACED_TO_ALIAS = 0.001
"""Probability that a robot that was displaced stands just where everything looks as it should (a window of 0.6 m and
20 degrees round one place of a room of 20 m2)."""
MIN_P_ALIAS = 1e-6  # smallest probability of a place that looks alike and is kept in mind
PLACED_BY = ("command", "relocalization")
"""Bases of a belief that no motion has followed yet."""
MAX_STANDING_M = 0.1
"""Up to such a way the robot has only turned: what wheels do in turns is far less."""
MIN_ALIAS_PART = 0.8  # another place at which this part of the agreement is seen is not ruled out
MAX_P_FALSE_UNMISTAKABLE = 2e-4  # up to this probability of a wrong place, it is not compared with others
MAX_P_FALSE_CLEAR = 2e-3
"""Up to this one, only with places at which the room repeats itself; beyond, with the whole room."""


def find_p_there(view: View, refuted: int) -> float:
    """The probability of the believed place: its prior, with all pictures since it was given or found.

    ``refuted``: how often a place that was believed by such odds was refuted.
    """
    known, p_prior = view.latest(AliasOdds), compute_prior(refuted)
    return p_prior if known is None else max(MIN_P_ALIAS, min(known.value.probability, p_prior))


def find_p_not_alias(view: View) -> float:
    """The probability that the robot is where it believes rather than where everything looks the same.

    By the pictures since it was given or found. A robot in doubt may have been displaced, but hardly to such a place.
    """
    known = view.latest(AliasOdds)
    p = compute_prior(count_refuted(view)) if known is None else known.value.probability
    p = min(p, MIN_P_SURE)
    return p * (1.0 - P_DISPLACED_TO_ALIAS) if open_discrepancy(view, Level.PLAN) is not None else p


def count_refuted(view: View, doubt: Entry[Discrepancy] | None = None) -> int:
    """How often a place that was believed by odds was refuted; ``doubt``: of a robot that is lost now.

    That it is lost because its views showed nothing is no evidence against the place.
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


class AliasRisk(NamedTuple):
    """Where else a picture may have been taken, in words, and how likely that is."""

    said: str
    p: float


def find_alias(
    view: View, fix: Entry[PoseFix], belief: Entry[Hypothesis], weighed: Weighed
) -> AliasRisk | None:
    """Where else a picture that agrees with the believed place is most likely taken; None where nowhere."""
    least, room = MIN_ALIAS_PART * weighed.lines.coverage, belief.value.locale
    for other in view.where(Hypothesis, lambda h: h.status == "candidate"):
        there = other.value.world_from_robot(weighed.robot.world)
        if compute_coverage_elsewhere(weighed, there) >= least:
            return AliasRisk(f"as much agrees at {other.id}", 0.5)
    if weighed.p_false <= MAX_P_FALSE_UNMISTAKABLE:
        return None
    storey = _find_storey(view, fix, weighed)
    if (storey is not None and storey.p > MAX_P_RIVAL) or not weighed.is_weak:
        return storey
    p_there, most = find_p_not_alias(view), MAX_ALIKE_LOG_RATIO
    believed = BelievedPlace(weighed.before, weighed.covariance + fix.value.covariance, p_there)
    if bound_p_aliases(believed, weighed.pose, DISTINCT, most) <= MAX_P_RIVAL:
        return None
    aliases = list_aliases(weighed.robot, weighed.segments.segments_px, room, weighed.pose,
                          search=weighed.p_false > MAX_P_FALSE_CLEAR)
    p = compute_p_aliases(believed, weighed.pose, [
        (alias.world_from_robot, min(max(-alias.margin, -most), most)) for alias in aliases])
    return AliasRisk(f"it may be another door of {room}, or its other side", p)


def _find_storey(view: View, fix: Entry[PoseFix], weighed: Weighed) -> AliasRisk | None:
    """The storey, of those where the last ride may have ended, that is likeliest but for the believed one.

    What was reported of the ride supports the believed one, as does any report of where the robot stands.
    """
    ride = view.latest(Ride)
    if ride is None or view.latest(RideReport) is None:
        return None
    building, here, most = find_building(view), ride.value.destination, MAX_ALIKE_LOG_RATIO
    stops = {link.other(here): [Pose2(*link.stop_of(name)) for name in (here, link.other(here))]
             for link in building.links_of(here) if link.name == ride.value.passage}
    building.require(list(stops))
    step, odds = fix.value.camera_step, dict[str, float]()
    for other, (stop, there) in stops.items():
        robot = find_robot_in(view, other, find_camera(view).moved(step) if step else None)
        margin = compare_places((weighed.robot, weighed.pose), (robot, there @ (stop.inverse() @ weighed.pose)),
                                weighed.segments.segments_px)
        odds[other] = P_WRONG_STANDING / len(stops) * math.exp(min(-margin, most))
    likeliest = max(odds, key=odds.__getitem__, default=None)
    return None if likeliest is None else AliasRisk(
        f"the doors may have opened at {likeliest}", odds[likeliest] / (1.0 + math.fsum(odds.values())))
