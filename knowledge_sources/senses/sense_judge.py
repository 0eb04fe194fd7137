"""Sense judge (§2, §4): a sense that tells wrong places is looked at again, and where it stays wrong, that ends it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from blackboard import Change, Effect, Level, Post, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOING_ON, is_in_doubt
from world_models.entries import MISLEADING, RISK, Difference, Discrepancy, Impasse, RivalKind

WRONG: Mapping[RivalKind, str] = {
    "lens": "the camera's lens is another", "still camera": "the camera stands still",
    "late pictures": "the camera's pictures come late", "bumper": "the bumper is stuck"}
"""How a mission ends by a sense, in words."""


@rule(on=Watch(Difference, where=lambda d: d.is_of_sense and d.leader.kind in WRONG),
      writes=(Discrepancy, Impasse), needs=(GOING_ON,), priority=Priority.REVISE)
def sense_judge(view: View, trigger: Change) -> Iterable[Effect]:
    """Sees no way on once there is no doubt of a sense that is wrong; until then one that tells wrong places puts the
    belief in doubt.
    """
    wrong, leader = trigger.entry, trigger.entry.value.leader
    what = f"{WRONG[leader.kind]}: {leader.what}"
    if leader.p >= 1.0 - RISK:
        yield Post(Impasse("failed", f"{what}, by {len(wrong.value.counted)} looks"), (wrong,))
    elif leader.kind in MISLEADING and not is_in_doubt(view):
        yield Post(Discrepancy(Level.PLAN, what, None, (0.0, 0.0), "px"), (wrong,))
