"""What the laws of the board share: small values, a scripted knowledge source, and hypothesis strategies."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from hypothesis import strategies as st

from blackboard import (
    Change,
    Decision,
    Effect,
    KnowledgeSource,
    Level,
    Posted,
    Revised,
    Scheduler,
    View,
    Watch,
    inference,
    request,
)


@inference()
@dataclass(frozen=True, slots=True)
class Note:
    text: str


@request()
@dataclass(frozen=True, slots=True)
class Tally:
    count: int


def silent(_view: View, _trigger: Change) -> Iterable[Effect]:
    return ()


class Scripted(KnowledgeSource):
    """A knowledge source whose answers are given when it is built.

    Args:
        called: its name.
        on: the type of value that it watches.
        act: what it does.
        rate: its rating, or a function of view and trigger.
    """

    def __init__(
        self,
        called: str = "source",
        on: type[Any] = Note,
        act: Callable[[View, Change], Iterable[Effect]] = silent,
        *,
        rate: float | Callable[[View, Change], float | None] = 0.5,
        level: Level = Level.PLAN,
        closes: Level | None = None,
        kinds: tuple[type[Change], ...] = (Posted, Revised),
        where: Callable[[Any], bool] = lambda _value: True,
        writes: tuple[type[Any], ...] = (Note, Tally),
    ) -> None:
        self._called, self._act, self._rate = called, act, rate
        self.level, self.closes, self.writes = level, closes, writes
        self.on = (Watch(on, kinds, where),)

    @property
    def name(self) -> str:
        return self._called

    def bind(self, view: View, trigger: Change) -> tuple[Change, float] | None:
        rating = self._rate(view, trigger) if callable(self._rate) else self._rate
        return None if rating is None else (trigger, rating)

    def rate(self, case: tuple[Change, float]) -> float:
        return case[1]

    def act(self, view: View, case: tuple[Change, float]) -> Iterable[Effect]:
        return self._act(view, case[0])


def run(scheduler: Scheduler, limit: int = 50) -> list[Decision]:
    """Cycle until nothing is left to do, but not for ever."""
    decisions: list[Decision] = []
    while len(decisions) < limit and (decision := scheduler.step()) is not None:
        decisions.append(decision)
    return decisions


notes = st.builds(Note, st.text(max_size=3))
tallies = st.builds(Tally, st.integers(0, 9))
values = notes | tallies
levels = st.sampled_from(Level)
ratings = st.floats(0.0, 1.0)
magnitudes = st.floats(0.0, 10.0) | st.just(float("inf"))
