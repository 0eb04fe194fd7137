"""Laws of the travel breaker: a push, a stop or being lost breaks a way, once, and changes nothing else of it."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from generated_boards import Bench, all_reasons
from harvey.testing import check_source
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.senses.travel_breaker import travel_breaker
from world_models.entries import Evidence, Explanation, begin_travel, diagonal
from world_models.frames import Pose2


@given(st.booleans(), st.floats(0.0, 9.0))
def test_it_marks_the_newest_way_and_no_more(is_broken: bool, way_m: float) -> None:
    bench = Bench()
    old = bench.put(begin_travel(Pose2(0.0, 0.0, 0.0), diagonal(0.1, 0.1), 0.0, 0.1))
    way = replace(old.value, x_m=way_m, y_m=-way_m, gone_m=2.0 * way_m, is_broken=is_broken)
    travel, doubt = bench.put(way), bench.doubt()
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
    told = Evidence("the way", "", (Explanation("pushed", "a push", 9.0),), 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    check_source(travel_breaker, bench, bench.put(weigh_rivals("the way", [told])))
