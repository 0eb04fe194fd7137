"""Wheels calibrator (§3.2): learns how far the wheels go, once they surely go otherwise than stated."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Revise, View, Watch, rule
from knowledge_sources.priority import Priority
from world_models.entries import Difference, Wheels

MIN_REACH, MAX_REACH = 0.2, 2.0
"""Parts of the way that wheels may go; what is beyond is no matter of wheels."""


@rule(on=Watch(Difference, where=lambda d: d.is_of_sense and d.leader.kind == "wheels"), writes=Wheels,
      priority=Priority.REVISE)
def wheels_calibrator(view: View, trigger: Change) -> Iterable[Effect]:
    """Takes over the part of the way that they go by all stretches that tell it."""
    wrong, wheels = trigger.entry, view.latest(Wheels)
    told = wrong.value.leader
    if wheels is None or not told.sigma:
        return
    known = wheels.value.actuator
    reach = min(max(told.off, MIN_REACH), MAX_REACH)
    if abs(reach - known.reach) > told.sigma:
        learnt = replace(known, reach=reach, reach_sigma=max(known.reach_sigma, told.sigma))
        yield Revise(wheels, replace(wheels.value, actuator=learnt), (wrong, wheels))
