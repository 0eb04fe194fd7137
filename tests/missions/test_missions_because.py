"""``because`` is complete: what an act read, and what it made rests on, it names.

Each act of a mission runs on a view that records what is read. What was read and is not named is hidden, one entry at a
time, and the act decides again: nothing may differ. An entry counts as named if the act names it, if what it names
rests on it, or has its id in its value, as tracks have those of the frames of their templates. Locale frames, camera,
wheels and footprint are named by ``Decision.used`` (the kinds that are traced).

What is read only to decline is exempt: an entry without which the act makes nothing at all, as a motor without a goal;
and one without which it makes the same and more, as a picture of the floor that is kept unless one from here is.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest

from blackboard import Blackboard, Change, Effect, KnowledgeSource, View
from blackboard.board import TracedView
from experiments.generated.missions import OFFICE, fault
from harvey.simulation.simulated_run import run_mission
from harvey.testing import copy_of, describe, find_named, list_unnamed
from harvey.wiring import knowledge_sources
from knowledge_sources.settings import Settings
from sim.scenario import parse_scenario
from sim.stage import build_stage

MAX_HIDDEN = 6
"""So many unnamed entries of an act are hidden, the newest of each kind first."""


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
        seen, made = TracedView(board, None), describe(effects)
        assert describe(act(seen, trigger)) == made, f"{name} decides otherwise on the same board"
        self.acts += 1
        for entry in list_unnamed(board, seen.used, find_named(board, trigger, effects), MAX_HIDDEN):
            self.hidden += 1
            try:
                again = describe(act(copy_of(board, entry.id).view, trigger))
            except (LookupError, AttributeError):
                again = ["it cannot decide"]
            key = name, type(entry.value).__name__
            if again and not set(made) <= set(again):
                self.unnamed.setdefault(key, f"{name} does not name {entry.ref}, without which it makes"
                                             f" {[a[:200] for a in again]} instead of {[m[:200] for m in made]}")


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
