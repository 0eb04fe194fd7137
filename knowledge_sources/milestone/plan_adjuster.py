"""Plan adjuster (§6): corrects the belief by the pose of a verified milestone."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from blackboard import Change, Discrepancy, Effect, Entry, Level, Posted, Revise, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import find_belief, find_building, open_discrepancy
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Certificate, Hypothesis, PoseFix


class Case(NamedTuple):
    """A verified milestone with its pose, the belief, and the discrepancy within the plan level's bound."""

    certificate: Entry[Certificate]
    fix: Entry[PoseFix]
    belief: Entry[Hypothesis]
    found: Entry[Discrepancy]


class PlanAdjuster(RobotKnowledgeSource):
    """Replaces the belief by the pose of a verified milestone, within the plan level's bound."""

    level = closes = Level.PLAN
    priority = Priority.CORRECT
    on = (Watch(Certificate, (Posted,), lambda c: c.verdict == "verified"),)
    writes = (Hypothesis, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Case | None:
        found, belief, fix = open_discrepancy(view, Level.PLAN), find_belief(view), view.get(trigger.entry.value.fix)
        if found is None or found.value.exceeds or belief is None or fix is None:
            return None
        return Case(trigger.entry, fix, belief, found)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        certificate, fix, belief, found = case
        here = Hypothesis.of_world(
            find_building(view), belief.value.locale, fix.value.world_from_robot, fix.value.covariance, "milestone",
            motion=belief.value.motion,
        )
        correction = Revise(belief, here, (certificate, fix, belief))
        yield correction
        yield Revise(found, found.value.corrected(), (correction,))
