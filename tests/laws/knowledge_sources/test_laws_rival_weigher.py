"""Laws of the rival weigher: evidence of one name makes one difference, weighed by all of it, and each counts once."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from blackboard import Post, Revise
from generated_boards import Bench, all_reasons
from harvey.testing import check_source
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.model.rival_weigher import rival_weigher
from world_models.entries import Evidence, Explanation


def build_evidence(about: str, ratio: float, x_m: float) -> Evidence:
    rivals = Explanation("thing", "a thing", ratio), Explanation("dirt", "dirt on the lens", -ratio)
    return Evidence(about, "a region", rivals, x_m, 0.0, 0.0, 0.6, math.inf, x_m)


seen = st.builds(build_evidence, st.sampled_from(("hallway", "camera")), st.floats(-5.0, 5.0), st.floats(0.0, 5.0))


@given(st.lists(seen, min_size=1, max_size=4))
def test_each_difference_is_weighed_by_all_of_its_evidence_and_by_no_other(all_seen: list[Evidence]) -> None:
    bench, said = Bench(), dict[str, list[Evidence]]()
    for one in all_seen:
        known = said.setdefault(one.about, [])
        entry = bench.put(one)
        effects = tuple(bench.ask(rival_weigher, entry) or ())
        assert len(effects) == (one not in known)
        if effects:
            (effect,) = effects
            assert isinstance(effect, Revise if known else Post)
            known.append(one)
            assert effect.value == weigh_rivals(one.about, known)
            assert entry.id in all_reasons(effects)
            bench.apply(effect)


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench()
    check_source(rival_weigher, bench, bench.put(build_evidence("camera", 1.0, 0.0)))
