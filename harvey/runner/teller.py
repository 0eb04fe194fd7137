"""Teller: what somebody tells the robot on the way: ``[[told]]`` of a mission's file, or what a live page hears.

A live page also shows the run, and lets people pause and stop it: an extra brings it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from blackboard import Post, Scheduler
from harvey.errors import BadInput
from world_models.entries import Redirection, UserReport
from world_models.files.toml.mission import Telling
from world_models.plugins import PAGES_GROUP, list_absent, load_plugins

USER, PAGE, SOMEBODY = "user", "live page", "harvey tell"
"""Who tells: the mission's file, or somebody while the run goes on."""
TOLD_FILE = "told.txt"
"""In a run's folder: what it is told by another process."""
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


class FileTeller:
    """Tells what ``harvey tell`` writes into a run's folder while it goes on, a line each; the board knows the last."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / TOLD_FILE

    def tell(self, scheduler: Scheduler) -> None:
        """Tell the lines that are whole and were not told yet."""
        if self._file.is_file():
            lines = self._file.read_text(encoding="utf-8").split("\n")[:-1]
            told = len(scheduler.view.where(Redirection, lambda asked: asked.by == SOMEBODY))
            scheduler.post([Post(Redirection(line, SOMEBODY)) for line in lines[told:]], SOMEBODY)


def _count_tellings(scheduler: Scheduler) -> int:
    """How much of a mission's file the board was told."""
    return len(scheduler.view.all(UserReport)) + len(scheduler.view.where(Redirection, lambda asked: asked.by == USER))


LIVE = "live"
"""Its name, as an entry point."""


@dataclass(frozen=True, slots=True)
class PageKind:
    """A kind of live page.

    Attributes:
        serve: ``serve(port, world, lens, title, *, host, token, part)`` serves the page of one run while the block
            lasts. It gives an object with ``live`` (a sink of the run; ``live.end(text)`` tells how it ended),
            ``teller.tell`` (what is said to the run), ``guard(body, tick)`` (the body behind its gate) and ``gate``
            (``on_stop`` is called when somebody stops the run, ``state`` is how it stands).
    """

    serve: Callable[..., AbstractContextManager[Any]]


def find_page(asked_by: str) -> PageKind:
    """The page that is installed. Raises BadInput, which says what to install, where there is none."""
    if needs := list_absent(PAGES_GROUP).get(LIVE):
        raise BadInput(f"{asked_by} needs {needs}")
    page: PageKind = load_plugins(PAGES_GROUP, PageKind, LIVE)[LIVE]
    return page
