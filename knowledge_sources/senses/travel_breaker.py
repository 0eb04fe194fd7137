"""Travel breaker (§3.2): a way on which something pushed the robot tells nothing of where its camera looks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from blackboard import Change, Effect, Entry, Level, Posted, Revise, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import WAY
from world_models.entries import Difference, Discrepancy, Travel


def find_unbroken(view: View, trigger: Change) -> Entry[Any] | None:
    """What happened on a way that is not broken yet."""
    return None if WAY.of(view).value.is_broken else trigger.entry


@rule(on=(Watch(Discrepancy, (Posted,), lambda d: d.level is Level.GOAL or d.magnitude == math.inf),
          Watch(Difference, where=lambda d: d.is_sure and d.leader.kind == "pushed")), writes=Travel,
      needs=(WAY,), bind=find_unbroken, priority=Priority.REVISE)
def travel_breaker(view: View, what: Entry[Any]) -> Iterable[Effect]:
    """Marks the way since the last milestone as broken, when the robot is lost, or something pushed or stopped it."""
    travel = WAY.of(view)
    yield Revise(travel, replace(travel.value, is_broken=True), (travel, what))
