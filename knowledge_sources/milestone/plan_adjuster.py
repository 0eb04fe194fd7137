"""Plan adjuster (§6): corrects the belief by the pose of a verified milestone."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Level, Posted, Revise, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, PLAN_DOUBT
from world_models.building.locale_frame import FrameRequest
from world_models.entries import Certificate, Discrepancy, Hypothesis, PoseFix


def find_fix(view: View, trigger: Change) -> tuple[Entry[Certificate], Entry[PoseFix]] | None:
    """A verified milestone with its pose, where the discrepancy is within the plan level's bound."""
    fix = view.get(trigger.entry.value.fix)
    return None if PLAN_DOUBT.of(view).value.exceeds or fix is None else (trigger.entry, fix)


@rule(on=Watch(Certificate, (Posted,), lambda c: c.verdict == "verified"),
      writes=(Hypothesis, Discrepancy, FrameRequest), needs=(HELD, PLAN_DOUBT), bind=find_fix,
      level=Level.PLAN, closes=Level.PLAN, priority=Priority.CORRECT)
def plan_adjuster(view: View, case: tuple[Entry[Certificate], Entry[PoseFix]]) -> Iterable[Effect]:
    """Replaces the belief by the pose of a verified milestone, within the plan level's bound."""
    (certificate, fix), belief, found = case, HELD.of(view), PLAN_DOUBT.of(view)
    here = belief.moved_to(fix.value.world_from_robot, fix.value.covariance, "milestone")
    here = here.protected(fix.value.protection)
    correction = Revise(belief.entry, here, (certificate, fix, belief.entry))
    yield correction
    yield Revise(found, found.value.corrected(), (correction,))
