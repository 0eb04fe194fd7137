"""Wheels calibrator (§3.2): learns how far the wheels go, once they surely go otherwise than stated."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from blackboard import Change, Effect, Revise, View, Watch, rule
from knowledge_sources.priority import Priority
from world_models.entries import Difference, Wheels

MIN_REACH, MAX_REACH = 0.2, 2.0
"""Parts of the way that wheels may go; what is beyond is no matter of wheels."""


@rule(on=Watch(Difference, where=lambda d: d.is_of_sense and d.leader.kind == "wheels"), writes=Wheels,
      priority=Priority.REVISE)
def wheels_calibrator(view: View, trigger: Change) -> Iterable[Effect]:
    """Takes over the part of the way that they go by all stretches that count: each is weighed by its deviation."""
    wrong, wheels = trigger.entry, view.latest(Wheels)
    told = np.array([(e.off, e.sigma) for one in wrong.value.counted for e in one.explanations
                     if e.kind == "wheels" and e.sigma])
    if wheels is None or not len(told):
        return
    weights = 1.0 / np.square(told[:, 1])
    reach, sigma = float(weights @ told[:, 0] / weights.sum()), float(weights.sum() ** -0.5)
    reach = min(max(reach, MIN_REACH), MAX_REACH)
    sigma *= max(1.0, float(np.sqrt(np.mean(weights * np.square(told[:, 0] - reach)))))  # they do not all agree
    known = wheels.value.actuator
    if abs(reach - known.reach) > sigma:
        learnt = replace(known, reach=reach, reach_sigma=max(known.reach_sigma, sigma))
        yield Revise(wheels, replace(wheels.value, actuator=learnt), (wrong, wheels))
