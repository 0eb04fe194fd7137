"""Laws of every knowledge source on the boards of recorded runs, as ``check_source`` has them: some acts of each.

Its own file has them on a board of its own: also of those that act in none of these runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from blackboard import Blackboard, Change, MissingEntryError, Retracted
from harvey.replay.why_not_again import tell_of_trigger
from harvey.testing import BREAKS, Bench, check_source, copy_of
from harvey.wiring import KNOWLEDGE_SOURCES, build
from knowledge_sources.settings import DEFAULT
from logs.records import ref_of
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from rebuilt_board import CHANGES, SOURCES, rebuild
from recorded_runs import Recorded

RUNS = ("office", "two doors", *(pytest.param(name, marks=pytest.mark.slow) for name in ("bump", "kidnap", "hallway")))
ACTS_EACH, MANY = 3, 18
"""So many acts of a source are asked again in each run, and so many sources act there at least."""


def list_acts(run: RunDirectory) -> Iterator[tuple[str, Bench, Change]]:
    """Acts of each source from all parts of a run: who, the board as the act saw it, and what woke it."""
    by_source: dict[str, list[int]] = {}
    for decision in Timeline(run.journal).decisions():
        if decision.chosen is not None:
            by_source.setdefault(decision.chosen.source, []).append(decision.cycle)
    asked = {cycles[part * len(cycles) // ACTS_EACH] for cycles in by_source.values() for part in range(ACTS_EACH)}
    for rebuilt, decision in rebuild(run):
        if decision.chosen is not None and decision.cycle in asked:
            bench = Bench()
            bench.board, bench.revisions = copy_of(rebuilt.board), rebuilt.entries
            entry = rebuilt.entries[ref_of(decision.chosen.trigger)]
            yield decision.chosen.source, bench, CHANGES[decision.chosen.kind](entry)


def tell_what_it_needs(source: Any, board: Blackboard, trigger: Change) -> None:
    """Asked why it does not act, it names the first of its conditions that is broken."""
    for need in source.needs:
        broken = copy_of(board)
        broken.apply(BREAKS[need.name](broken.view), author="test", cycle=10**6)
        now = type(trigger)(broken.view.get(trigger.entry.id) or trigger.entry)
        unmet, told = source.find_unmet(broken.view), " ".join(tell_of_trigger(source, broken, now))
        assert isinstance(now, Retracted) or f"It needs: {unmet.name}; " in told or "withdrawn already" in told


@pytest.mark.parametrize("name", RUNS)
def test_every_act_keeps_the_laws_of_all_sources(name: str, recorded: Recorded) -> None:
    acted = set()
    for who, bench, trigger in list_acts(recorded(name)):
        source = build(SOURCES[who], DEFAULT)
        try:
            check_source(source, bench, trigger)
        except MissingEntryError:
            continue  # it asks for a frame, and comes again
        tell_what_it_needs(source, bench.board, trigger)
        acted.add(who)
    assert len(acted) >= MANY, sorted(acted)


def test_every_condition_that_a_source_declares_is_broken_here() -> None:
    assert {need.name for source in KNOWLEDGE_SOURCES for need in source.needs} == set(BREAKS)
