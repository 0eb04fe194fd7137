"""Plan adjuster (§6): corrects the belief by the pose of a verified milestone."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Revise
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.questions import find_belief, find_building, open_discrepancy
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import PoseFix
from world_models.entries.task import Certificate


class PlanAdjuster(OlderSource):
    """Replaces the belief by the pose of a verified milestone, within the plan level's bound."""

    level = Level.PLAN
    closes = Level.PLAN
    on = (Watch(Certificate, (Posted,), lambda c: c.verdict == "verified"),)
    writes = (Hypothesis, Discrepancy)

    def judge(self, view: View, trigger: Change) -> float | None:
        found = open_discrepancy(view, Level.PLAN)
        return 0.9 if found is not None and not found.value.exceeds and find_belief(view) is not None else None

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, found, fix = find_belief(view), open_discrepancy(view, Level.PLAN), view.get(trigger.entry.value.fix)
        if belief is None or found is None or fix is None:
            return
        pose_fix: PoseFix = fix.value
        here = Hypothesis.of_world(
            find_building(view), belief.value.locale, pose_fix.world_from_robot, pose_fix.covariance, "milestone",
            motion=belief.value.motion,
        )
        correction = Revise(belief, here, (trigger.entry, fix, belief))
        yield correction
        yield Revise(found, found.value.corrected(), (correction,))
