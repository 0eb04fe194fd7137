"""Belief checker (§2, §4): a doubt of the action level is measured by a look, in the present view first."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Level, Post, Posted, Revised, View, Watch, rule
from knowledge_sources.methods.verification import CHECK_TOLERANCE_M, choose_heading, find_untried, turn_headings
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    DOUBTED,
    GOING_ON,
    HELD,
    NO_MILESTONE,
    NOT_LOST,
    STANDING,
    find_tried,
    list_log_odds,
)
from world_models.building.locale_frame import FrameRequest
from world_models.entries import Discrepancy, Hypothesis, Milestone


@rule(on=(Watch(Discrepancy, (Posted, Revised)), Watch(Hypothesis, (Revised,), lambda h: h.is_held),
          Watch(Milestone, (Revised,), lambda m: not m.is_open)),
      writes=(Milestone, FrameRequest), needs=(GOING_ON, HELD, STANDING, NOT_LOST, NO_MILESTONE, DOUBTED),
      level=Level.PLAN, priority=Priority.RECOVER)
def belief_checker(view: View, _case: Change) -> Iterable[Effect]:
    """Asks for a look by which a doubt is measured: a check in between, of no sketch.

    It is the present view; if that was not testable, the one of the others that tells the place best.
    """
    doubt, belief = DOUBTED.of(view), HELD.of(view)
    robot, pose, tried = belief.seeing, belief.pose, find_tried(view, lambda m: m.cycle >= doubt.cycle)
    heading = pose.heading_rad
    if tried:
        headings = find_untried(turn_headings(pose), tried) or [heading]
        heading = choose_heading(robot, pose, headings, CHECK_TOLERANCE_M)
    what = f"the place where it believes to be, because {doubt.value.what}"
    check = Milestone("", -1, what, heading, tried=tried)
    yield Post(replace(check, log_odds_so_far=list_log_odds(view, check)), (doubt, belief.entry))
