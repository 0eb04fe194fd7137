"""Retelling: what people told a run while it went on is told again to the agent that is changed to ask what if."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from blackboard.board import View
from blackboard.scheduler import Scheduler
from harvey.run_files.observations import Originals, effect_of
from harvey.run_files.records import DecisionRecord, EntryRecord
from world_models.entries.body import Frame, MotionReport, RideReport
from world_models.entries.told import Redirection, Told

TIMED: tuple[type[Any], ...] = (Frame, MotionReport, RideReport)
"""Kinds of observations that have the body's time."""
TOLD = frozenset({Told.__name__, Redirection.__name__})


class Retelling:
    """Tells again, in its cycle, what some authors had told; later where the changed agent needs fewer cycles.

    By the body's time it is as late as it was; a cycle takes none.
    """

    def __init__(self, records: Sequence[DecisionRecord], authors: Sequence[str], originals: Originals) -> None:
        """``records``: of the run as it was; ``originals``: what they name only by reference."""
        self._originals, self._left = originals, list[tuple[int, float, EntryRecord]]()
        timed = {kind.__name__ for kind in TIMED}
        now_s = 0.0
        for record in records:
            for entry in record.observed:
                now_s = entry.value["sim_time_s"] if entry.type in timed else now_s
                if entry.author in authors and entry.type in TOLD:
                    self._left.append((record.cycle - 1, now_s, entry))

    def tell(self, scheduler: Scheduler) -> None:
        """Tell what is due."""
        while self._left and self._is_due(scheduler):
            _, _, entry = self._left.pop(0)
            effect = effect_of(entry, self._originals, scheduler.view, scheduler.kinds)
            scheduler.tell([effect], entry.author)

    def _is_due(self, scheduler: Scheduler) -> bool:
        cycle, when_s, _ = self._left[0]
        now_s = _find_time_s(scheduler.view)
        return now_s > when_s or (now_s == when_s and scheduler.cycle >= cycle)


def _find_time_s(view: View) -> float:
    """The body's time of the newest observation on the board; 0 before the first."""
    newest = [entry.value.sim_time_s for kind in TIMED if (entry := view.latest(kind)) is not None]
    return max(newest, default=0.0)
