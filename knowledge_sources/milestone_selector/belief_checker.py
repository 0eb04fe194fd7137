"""Belief checker (§2, §4): a doubt of the action level is measured by a look, in the present view first."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Discrepancy, Effect, Entry, Level, Post, Posted, Revised, View, Watch
from knowledge_sources.methods.verification import CHECK_TOLERANCE_M, choose_heading, find_untried, turn_headings
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    GOING_ON,
    HELD,
    NO_MILESTONE,
    NOT_LOST,
    STANDING,
    find_robot_and_pose,
    find_tried,
    list_told,
    unmeasured_doubt,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Hypothesis, Milestone


class Case(NamedTuple):
    """What is in doubt, the belief, and the headings in which it was checked since, in vain."""

    doubt: Entry[Discrepancy]
    belief: Entry[Hypothesis]
    tried: tuple[float, ...]


class BeliefChecker(RobotKnowledgeSource):
    """Asks for a look by which a doubt is measured: a check in between, of no sketch.

    It is the present view; if that was not testable, the one of the others that tells the place best.
    """

    level, priority = Level.PLAN, Priority.RECOVER
    on = (
        Watch(Discrepancy, (Posted, Revised)),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held),
        Watch(Milestone, (Revised,), lambda m: not m.is_open),
    )
    needs = (GOING_ON, HELD, STANDING, NOT_LOST, NO_MILESTONE)
    writes = (Milestone,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        doubt = unmeasured_doubt(view)
        if doubt is None:
            return None
        return Case(doubt, HELD.of(view).entry, find_tried(view, lambda m: m.cycle >= doubt.cycle))

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        doubt, belief, tried = case
        robot, pose = find_robot_and_pose(view, belief.value)
        heading = pose.heading_rad
        if tried:
            headings = find_untried(turn_headings(pose), tried) or [heading]
            heading = choose_heading(robot, pose, headings, CHECK_TOLERANCE_M)
        what = f"the place where it believes to be, because {doubt.value.what}"
        check = Milestone("", -1, what, heading, tried=tried)
        yield Post(replace(check, told=list_told(view, check)), (doubt, belief))
