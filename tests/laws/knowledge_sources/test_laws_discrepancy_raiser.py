"""Laws of the discrepancy raiser: beyond its bound up one level, so many times for one thing that is tried."""

from __future__ import annotations

import pytest

from blackboard import Level, Revise
from generated_boards import Bench, effect_on, made, reasons
from harvey.testing import check_source
from knowledge_sources.goal.discrepancy_raiser import MAX_CHECKS_PER_SUBGOAL, MAX_LOST_PER_MISSION, discrepancy_raiser
from world_models.entries import Discrepancy, Impasse, Outcome

SOURCE = discrepancy_raiser
BOUNDS = (5.0, 30.0)
MOST = {Level.ACTION: MAX_CHECKS_PER_SUBGOAL, Level.PLAN: MAX_LOST_PER_MISSION}
ABOVE = {Level.ACTION: Level.PLAN, Level.PLAN: Level.GOAL}


@pytest.mark.parametrize("level", [Level.ACTION, Level.PLAN])
def test_it_closes_the_doubt_and_posts_it_unmeasured_one_level_up(level: Level) -> None:
    bench = Bench()
    cause = bench.pursue()
    doubt = bench.put(Discrepancy(level, "off", 99.0, BOUNDS, "px"), cause)
    effects = bench.ask(SOURCE, doubt)
    assert effects is not None
    close, up = effects
    (closed, raised) = made(effects, Discrepancy)
    assert isinstance(close, Revise) and close.entry is doubt
    assert (closed.status, closed.times, raised.status) == ("escalated", 1, "open")
    assert (raised.level, raised.magnitude, raised.bounds) == (ABOVE[level], None, BOUNDS) and "off" in raised.what
    assert cause.id in reasons(close) and reasons(up) == {"Discrepancy"}


@pytest.mark.parametrize("level", [Level.ACTION, Level.PLAN])
def test_so_many_times_for_the_same_and_then_it_sees_no_way_on(level: Level) -> None:
    bench = Bench()
    sketch = bench.sketch()
    kinds = []
    for times in range(1, MOST[level] + 1):
        doubt = bench.doubt(level, 99.0)
        effects = bench.ask(SOURCE, doubt)
        assert effects is not None
        close = effects[0]
        assert made(effects, Discrepancy)[0].times == times
        assert (sketch.id in reasons(close)) == (level is Level.ACTION)
        kinds.append([i.kind for i in made(effects, Impasse)])
        bench.apply(close)
    assert kinds == [[]] * (MOST[level] - 1) + [["blocked" if level is Level.ACTION else "lost"]]
    impasse = effect_on(effects, Impasse)
    assert f"{MOST[level]} times" in impasse.value.reason and reasons(impasse) == {"Discrepancy"}


def test_at_the_next_subgoal_the_count_begins_anew_and_for_the_mission_it_does_not() -> None:
    for level, times in ((Level.ACTION, 1), (Level.PLAN, 2)):
        bench = Bench()
        sketch = bench.sketch()
        first = bench.ask(SOURCE, bench.doubt(level, 99.0))
        assert first is not None
        bench.apply(first[0])
        bench.revise(sketch, at=1)
        second = bench.ask(SOURCE, bench.doubt(level, 99.0))
        assert made(second, Discrepancy)[0].times == times


def test_when_the_mission_is_over_nobody_sees_no_way_on_again() -> None:
    bench = Bench()
    bench.sketch()
    for _ in range(MOST[Level.PLAN] - 1):
        effects = bench.ask(SOURCE, bench.doubt(Level.PLAN, 99.0))
        assert effects is not None
        bench.apply(effects[0])
    bench.put(Outcome("failed", "over"))
    effects = bench.ask(SOURCE, bench.doubt(Level.PLAN, 99.0))
    assert made(effects, Impasse) == [] and made(effects, Discrepancy)[0].times == MOST[Level.PLAN]


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench()
    bench.sketch()
    check_source(SOURCE, bench, bench.doubt(Level.ACTION, 99.0))
