"""Escalator (§2, Figure 2): a discrepancy that its level may not correct goes one level up."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard.board import View
from blackboard.change import Change, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.expert import Expert


class Escalator(Expert):
    """Closes a discrepancy beyond its bound and re-posts it one level up, to be measured anew there."""

    level = Level.PLAN
    watches = (Watch(Discrepancy, where=lambda d: d.exceeds),)
    writes = (Discrepancy,)

    def rate(self, view: View, trigger: Change) -> float | None:
        return 1.0

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        closed, raised = trigger.entry.value.escalated()
        close = Revise(trigger.entry, closed, trigger.entry.because)
        yield close
        yield Post(raised, (close,))
