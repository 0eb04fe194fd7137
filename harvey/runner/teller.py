"""Teller: what somebody tells the robot of the building on the way, at its time (``[[told]]`` of a mission's file)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from blackboard.effect import Post
from blackboard.scheduler import Scheduler
from world_models.entries.told import Told
from world_models.files.toml.mission import Telling

USER = "user"


class Teller:
    """Puts what is due on the board. How much was told the board itself says, so a run that goes on tells the rest."""

    def __init__(self, told: Sequence[Telling], clock: Callable[[], float]) -> None:
        """``told``: in any order; ``clock``: the body's time [s]."""
        self._told, self._clock = sorted(told, key=lambda telling: telling.at_s), clock

    def tell(self, scheduler: Scheduler) -> None:
        """Tell what is due and was not told yet."""
        for telling in self._told[len(scheduler.view.all(Told)):]:
            if telling.at_s > self._clock():
                return
            scheduler.tell([Post(telling.entry)], USER)
