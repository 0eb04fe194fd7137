"""Laws of the travel breaker: a push, a stop or being lost breaks a way, once, and changes nothing else of it."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from generated_boards import Bench, all_reasons
from harvey.testing import check_source
from knowledge_sources.senses.travel_breaker import travel_breaker
from world_models.entries import begin_travel, diagonal
from world_models.frames import Pose2

lengths = st.floats(0.0, 9.0)


@given(st.booleans(), lengths, lengths, lengths)
def test_it_marks_the_newest_way_and_no_more(is_broken: bool, x_m: float, y_m: float, gone_m: float) -> None:
    bench = Bench()
    old = bench.put(begin_travel(Pose2(0.0, 0.0, 0.0), diagonal(0.1, 0.1), 0.0, 0.1))
    way = replace(old.value, x_m=x_m, y_m=y_m, gone_m=gone_m, is_broken=is_broken)
    travel = bench.put(way)
    doubt = bench.doubt()
    effects = bench.ask(travel_breaker, doubt)
    assert (effects is None) == is_broken
    if effects is not None:
        (effect,) = effects
        assert effect.entry is travel and effect.value == replace(way, is_broken=True)
        assert all_reasons(effects) == {travel.id, doubt.id}


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench()
    bench.put(begin_travel(Pose2(0.0, 0.0, 0.0), diagonal(0.1, 0.1), 0.0, 0.1))
    check_source(travel_breaker, bench, bench.doubt())
