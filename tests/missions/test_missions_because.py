"""``because`` is complete: what an act read, and what it made rests on, it names.

Each act of a mission runs on a view that records what is read. What was read and is not named is hidden, one entry at a
time, and the act decides again: nothing may differ. An entry counts as named if the act names it, if what it names
rests on it, or has its id in its value, as tracks have those of the frames of their templates. Locale frames, camera,
wheels and footprint are named by ``Decision.used`` (the kinds that are traced).

What is read only to decline is exempt: an entry without which the act makes nothing at all, as a motor without a goal;
and one without which it makes the same and more, as a picture of the floor that is kept unless one from here is.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Hashable, Iterable, Iterator, Sequence
from typing import Any, TypeVar

import pytest

from blackboard.board import Blackboard, TracedView, View
from blackboard.change import Change
from blackboard.effect import Effect, Post, Retract
from blackboard.entry import Entry, Ref
from blackboard.entry_store import Index
from blackboard.journal import plain
from blackboard.kinds import kind_of
from blackboard.knowledge_source import KnowledgeSource
from experiments.generated.missions import OFFICE, fault
from harvey.simulation.simulated_run import run_mission
from harvey.wiring import knowledge_sources, load_kinds
from knowledge_sources.settings import Settings
from sim.scenario import parse_scenario
from sim.stage import build_stage

T = TypeVar("T")
TRACED = frozenset(kind for kind in load_kinds().values() if kind_of(kind).traced)
ID = re.compile(r"'([A-Z][A-Za-z]+-[0-9]+)'")
"""An entry's id in a value that is written out."""
MAX_HIDDEN = 6
"""So many unnamed entries of an act are hidden, the newest of each kind first."""


class HidingView(TracedView):
    """A view that records the ids of all that is read, and on which some entries are not there."""

    __slots__ = ("hidden", "read")

    def __init__(self, board: Blackboard, hidden: Collection[str] = ()) -> None:
        super().__init__(board, TRACED)
        self.hidden, self.read = frozenset(hidden), dict[str, Entry[Any]]()

    def get(self, id: str) -> Entry[Any] | None:
        return None if id in self.hidden else super().get(id)

    def __getitem__(self, id: str) -> Entry[Any]:
        if id in self.hidden:
            raise KeyError(id)
        return super().__getitem__(id)

    def all(self, kind: type[T]) -> tuple[Entry[T], ...]:
        return tuple(self._note(e) for e in View.all(self, kind) if e.id not in self.hidden)

    def newest_first(self, kind: type[T]) -> Iterator[Entry[T]]:
        return (self._note(e) for e in View.newest_first(self, kind) if e.id not in self.hidden)

    def having(self, index: Index[T], key: Hashable) -> tuple[Entry[T], ...]:
        return tuple(self._note(e) for e in View.having(self, index, key) if e.id not in self.hidden)

    def newest(self, index: Index[T], key: Hashable) -> Entry[T] | None:
        found = [e for e in View.having(self, index, key) if e.id not in self.hidden]
        return self._note(found[-1]) if found else None

    def since(self, kind: type[T], cycle: int) -> tuple[Entry[T], ...]:
        return tuple(self._note(e) for e in View.since(self, kind, cycle) if e.id not in self.hidden)

    def _note(self, entry: Entry[T]) -> Entry[T]:
        self.read[entry.id] = entry
        return super()._note(entry)


class Watched:
    """Runs each act of a knowledge source again, with what it does not name hidden."""

    def __init__(self) -> None:
        self.acts = self.hidden = 0
        self.unnamed: dict[tuple[str, str], str] = {}

    def watch(self, source: KnowledgeSource) -> KnowledgeSource:
        bind, act = source.bind, source.act
        bound: list[Change] = []

        def remember(view: View, trigger: Change) -> Any:
            bound[:] = [trigger]
            return bind(view, trigger)

        def again(view: View, trigger: Change) -> Iterable[Effect]:
            case = bind(view, trigger)
            return () if case is None else act(view, case)

        def checked(view: View, case: Any) -> Iterable[Effect]:
            effects = tuple(act(view, case))
            self._check(source.name, again, view._board, bound[0], effects)
            return effects

        source.bind, source.act = remember, checked
        return source

    def _check(self, name: str, act: Any, board: Blackboard, trigger: Change, effects: tuple[Effect, ...]) -> None:
        seen = HidingView(board)
        made = _describe(act(seen, trigger))
        assert made == _describe(effects), f"{name} decides otherwise on the same board"
        self.acts += 1
        named = _find_named(board, trigger, effects)
        by_kind: dict[str, list[Entry[Any]]] = {}
        for entry in seen.read.values():
            if entry.id not in named and type(entry.value) not in TRACED:
                by_kind.setdefault(type(entry.value).__name__, []).append(entry)
        newest = [max(entries, key=lambda e: (e.cycle, e.id)) for entries in by_kind.values()]
        for entry in newest[:MAX_HIDDEN]:
            self.hidden += 1
            try:
                again = _describe(act(HidingView(board, {entry.id}), trigger))
            except (KeyError, LookupError, AttributeError):
                again = ["it cannot decide"]
            key = name, type(entry.value).__name__
            if again and not set(made) <= set(again):
                self.unnamed.setdefault(key, f"{name} does not name {entry.ref}, without which it makes"
                                             f" {[a[:200] for a in again]} instead of {[m[:200] for m in made]}")


def _describe(effects: Iterable[Effect]) -> list[str]:
    """What an act makes, without its reasons."""
    return [repr((type(e).__name__, None if isinstance(e, Post) else e.entry.id,
                  None if isinstance(e, Retract) else plain(e.value))) for e in effects]


def _find_named(board: Blackboard, trigger: Change, effects: tuple[Effect, ...]) -> set[str]:
    """The ids of what an act names, of what that rests on, and of what the values of these refer to."""
    reasons: list[Any] = [trigger.entry, *(reason for e in effects for reason in e.because)]
    reasons += [e.entry for e in effects if not isinstance(e, Post)]
    named = {reason.id for reason in reasons if isinstance(reason, Entry | Ref)}
    named |= {ref.id for id in tuple(named) if (entry := board._current.get(id)) is not None for ref in entry.because}
    todo = list(named)
    while todo:
        entry = board._current.get(todo.pop())
        found = set() if entry is None else set(ID.findall(repr(plain(entry.value)))) - named
        named |= found
        todo += found
    return named


MISSIONS = {
    "short": (OFFICE, 3),
    "bumped": (OFFICE + fault("bump", "", 3.0, left_m=0.3, turn_rad=0.3), 5),
}


@pytest.mark.parametrize("mission", list(MISSIONS))
def test_an_act_names_all_that_it_rests_on(mission: str) -> None:
    text, seed = MISSIONS[mission]
    watched = Watched()

    def sources(settings: Settings) -> Sequence[KnowledgeSource]:
        return [watched.watch(source) for source in knowledge_sources(settings)]

    result = run_mission(build_stage(parse_scenario(text)), seed, sources=sources)
    assert result.outcome == "reached" and watched.acts > 30 and watched.hidden > 5
    assert not watched.unnamed, "\n".join(watched.unnamed.values())
