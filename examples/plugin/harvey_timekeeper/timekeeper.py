"""Timekeeper: warns once when the battery runs short (a knowledge source with a kind of entry of its own)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from blackboard import Change, Effect, Entry, KnowledgeSource, Level, Post, Posted, View, Watch, inference
from world_models.entries import MotionReport

BATTERY_S = 20.0
"""What the battery lasts; the warning comes when half of it is left."""


@inference()
@dataclass(frozen=True, slots=True)
class RunningShort:
    """The battery runs short.

    Attributes:
        left_s: what is left [s].
    """

    left_s: float

    def sentence(self) -> str:
        return f"the battery runs short: {self.left_s:.0f} s are left"


class Timekeeper(KnowledgeSource):
    """Warns once when half of the battery is used up, by the time that the wheels report (§3.2)."""

    level = Level.ACTION
    on = (Watch(MotionReport, (Posted,)),)
    priority = 0.9
    writes = (RunningShort,)

    def bind(self, view: View, trigger: Change) -> Entry[MotionReport] | None:
        is_due = trigger.entry.value.sim_time_s > BATTERY_S / 2.0
        return trigger.entry if is_due and view.latest(RunningShort) is None else None

    def act(self, view: View, case: Entry[MotionReport]) -> Iterable[Effect]:
        yield Post(RunningShort(BATTERY_S - case.value.sim_time_s), (case,))
