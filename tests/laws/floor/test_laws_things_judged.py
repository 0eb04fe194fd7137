"""Laws of a thing that is judged: it is as certain as its rivals leave it, and gone where one of them has won."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.methods.floor.rivals_on_floor import (
    BLOCKING,
    ShownSight,
    explain_sight,
    explain_touch,
    judge_by,
    judge_thing,
)
from knowledge_sources.settings import DEFAULT
from world_models.entries import Difference, Evidence, Obstacle

S = DEFAULT.action
THING = Obstacle("hall/obstacle-1", "hall", ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)), 0.05, 0.0, 0.0, 1.0, by="camera")
sights = st.lists(st.tuples(st.floats(0.05, 0.95), st.integers(0, 2)), min_size=1, max_size=4)


def see(p_thing: float, still: int, x_m: float) -> Evidence:
    nothing = Difference.unknown(THING.name)
    explanations = explain_sight(p_thing, ShownSight(still=still), nothing, S.max_obstacle_certainty)
    return Evidence(THING.name, "a region", explanations, x_m, 0.0, 0.0, 0.3, 6.3, x_m)


@given(sights, st.randoms())
@settings(max_examples=40, deadline=None)
def test_it_is_as_certain_as_what_blocks_the_way_in_whatever_order_it_was_seen(
    drawn: list[tuple[float, int]], random: object
) -> None:
    evidence = [see(p, still, float(at)) for at, (p, still) in enumerate(drawn)]
    mixed = sorted(evidence, key=lambda _: random.random())  # type: ignore[attr-defined]
    difference, again = weigh_rivals(THING.name, evidence), weigh_rivals(THING.name, [*mixed, evidence[0]])
    judged = judge_thing(THING, difference, S)
    blocks = sum(rival.p for rival in difference.rivals if rival.kind in BLOCKING)
    assert judged.certainty == min(blocks, S.max_obstacle_certainty)
    assert (judged.status == "gone") == (blocks < S.min_gone_certainty)
    assert judge_thing(THING, again, S) == judged


@pytest.mark.parametrize("still", [1, 2])
def test_what_keeps_its_pixels_in_two_looks_is_rather_dirt_until_it_is_touched(still: int) -> None:
    seen = [see(0.95, 0, 0.0), see(0.95, still, 1.0), see(0.95, still, 2.0)]
    known = weigh_rivals(THING.name, seen[:2])
    judged = judge_by(seen[2], THING, known, S)
    found = weigh_rivals(THING.name, seen)
    assert judged.status == "gone" and "dirt on the lens" in judged.evidence
    touch = explain_touch("the leaf of a-door, shut", found, S.max_obstacle_certainty)
    touched = Evidence(THING.name, "touched", touch, 3.0, 0.0, 0.0, 0.3, 6.3, 3.0)
    assert judge_thing(THING, weigh_rivals(THING.name, (*seen, touched)), S).is_there
