"""Teller: what somebody tells the robot on the way: ``[[told]]`` of a mission's file, or what a live page hears."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue

from blackboard import Post, Scheduler
from world_models.entries import Redirection, UserReport
from world_models.files.toml.mission import Telling

USER, PAGE = "user", "live page"
"""Who tells: the mission's file, or somebody while the run goes on."""
Tell = Callable[[Scheduler], None]
"""Called before each cycle of a run; puts on the board what somebody tells the robot."""


def tell_nothing(_scheduler: Scheduler) -> None:
    """Nobody tells anything."""


def tell_each(*tells: Tell) -> Tell:
    """One after the other."""
    def tell_all(scheduler: Scheduler) -> None:
        for tell in tells:
            tell(scheduler)
    return tell_all


class Teller:
    """Puts what is due on the board. How much was told the board itself says, so a run that goes on tells the rest."""

    def __init__(self, told: Sequence[Telling], clock: Callable[[], float]) -> None:
        """``told``: in any order; ``clock``: the body's time [s]."""
        self._tellings, self._clock = sorted(told, key=lambda telling: telling.at_s), clock

    def tell(self, scheduler: Scheduler) -> None:
        """Tell what is due and was not told yet."""
        for telling in self._tellings[_count_tellings(scheduler):]:
            if telling.at_s > self._clock():
                return
            scheduler.post([Post(telling.entry)], USER)


class LiveTeller:
    """Tells what people say while the run goes on; any thread may hand it over."""

    def __init__(self) -> None:
        self._said: SimpleQueue[Redirection] = SimpleQueue()

    def hear(self, text: str) -> None:
        """Somebody asks the robot to go elsewhere."""
        self._said.put(Redirection(text, PAGE))

    def tell(self, scheduler: Scheduler) -> None:
        """On the run's thread: tell what was handed over."""
        while True:
            try:
                said = self._said.get_nowait()
            except Empty:
                return
            scheduler.post([Post(said)], PAGE)


def _count_tellings(scheduler: Scheduler) -> int:
    """How much of a mission's file the board was told."""
    return len(scheduler.view.all(UserReport)) + len(scheduler.view.where(Redirection, lambda asked: asked.by == USER))
