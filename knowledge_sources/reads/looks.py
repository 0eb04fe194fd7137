"""What the knowledge sources that look for milestones have in common: when a look may be chosen, and what was tried."""

from __future__ import annotations

import math
from collections.abc import Callable

from blackboard import Entry, View
from knowledge_sources.methods.belief import to_log_odds
from knowledge_sources.methods.verification import MIN_MATCHED_LINES
from world_models.entries import Certificate, Milestone, PlanSketch

MAX_LOOK_LOG_ODDS = 3.0  # most that one look counts for or against a place, in log odds, with those in other directions
MAX_LOOK_ERROR_RAD = math.radians(3.5)  # the robot faces a milestone when its heading is off by no more than this


def find_tried(view: View, is_same: Callable[[Entry[Milestone]], bool]) -> tuple[float, ...]:
    """The headings in which the last milestone, if it is the same one, was not testable."""
    last = view.latest(Milestone)
    if last is None or last.value.status != "not testable" or not is_same(last):
        return ()
    return (*last.value.tried, last.value.look_heading_rad)


def find_car(sketch: PlanSketch, index: int) -> str:
    """The elevator's car in which a ride before a milestone ends, or "": it looks the same on every floor."""
    before = sketch.subgoals[index - 1] if index > 0 else None
    return before.destination.locale if before is not None and before.is_ride else ""


def find_car_of(view: View, milestone: Milestone) -> str:
    """The same for a milestone of any sketch, or of none."""
    sketch = view.get(milestone.sketch)
    return "" if sketch is None else find_car(sketch.value, milestone.index)


def list_log_odds(view: View, milestone: Milestone) -> tuple[float, ...]:
    """The log odds of a wrong place by each view that was tried for a milestone; 0 where it showed nothing."""
    last, certificate = view.latest(Milestone), view.latest(Certificate)
    if not milestone.tried or last is None or certificate is None or certificate.value.milestone != last.id:
        return (0.0,) * len(milestone.tried)
    c, most = certificate.value, MAX_LOOK_LOG_ODDS
    tells = c.matched >= MIN_MATCHED_LINES
    return (*last.value.log_odds_so_far, min(max(to_log_odds(c.p_false), -most), most) if tells else 0.0)
