"""Rivals share the odds of what they all explain: order, repeats and one rival more make none of them surer."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from knowledge_sources.methods.belief import PRIORS, weigh_rivals
from knowledge_sources.methods.belief.rivals import MAX_COUNTED
from world_models.entries import Difference, Evidence, Explanation, RivalKind

KINDS: tuple[RivalKind, ...] = ("thing", "jamb", "dirt", "chance", "elsewhere")


@st.composite
def evidence(draw: st.DrawFn, kinds: tuple[RivalKind, ...] = KINDS) -> Evidence:
    """One look at the same difference, with what some rivals make of it."""
    named = draw(st.lists(st.sampled_from(kinds), min_size=1, unique=True))
    ratios = [draw(st.floats(-6.0, 6.0)) for _ in named]
    at = [draw(st.floats(-2.0, 2.0)) for _ in range(3)]
    explanations = tuple(Explanation(kind, f"a {kind}", ratio) for kind, ratio in zip(named, ratios, strict=True))
    return Evidence("hallway", "a look", explanations, *at, 0.6, math.inf, draw(st.floats(0.0, 99.0)))


looks = st.lists(evidence(), min_size=1, max_size=5)


def read(difference: Difference) -> dict[str, float]:
    return {rival.kind: rival.p for rival in difference.rivals}


@given(looks, st.randoms(use_true_random=False))
def test_the_order_of_evidence_does_not_matter(seen: list[Evidence], random: object) -> None:
    mixed = list(seen)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    assert weigh_rivals("hallway", mixed).rivals == weigh_rivals("hallway", seen).rivals


@given(looks, st.integers(0, 4), st.floats(0.0, 9.0))
def test_the_same_look_twice_is_once(seen: list[Evidence], which: int, later_s: float) -> None:
    one = seen[which % len(seen)]
    again = replace(one, seen_s=one.seen_s + later_s)
    assert read(weigh_rivals("hallway", [*seen, again])) == pytest.approx(read(weigh_rivals("hallway", seen)))


@given(looks, evidence())
def test_what_has_nothing_in_common_with_any_look_counts_whole_and_acquits_only_of_what_it_charged(
    seen: list[Evidence], one: Evidence
) -> None:
    alone = replace(one, apart_m=0.0, apart_rad=0.0, seen_s=100.0)
    well = replace(alone, seen_s=0.0, explanations=tuple(replace(e, log_ratio=-e.log_ratio) for e in one.explanations))
    before, after, late = ({rival.kind: rival.log_odds for rival in weigh_rivals("hallway", told).rivals}
                           for told in (seen, [*seen, alone], [*seen, well, alone]))
    for e in alone.explanations:
        assert after[e.kind] == pytest.approx(before.get(e.kind, PRIORS[e.kind]) + max(0.0, e.log_ratio))
        assert late[e.kind] == pytest.approx(after[e.kind])  # that all was well before hides nothing


@given(looks, evidence(("wall",)))
def test_one_rival_more_makes_no_other_surer(seen: list[Evidence], other: Evidence) -> None:
    before, after = read(weigh_rivals("hallway", seen)), read(weigh_rivals("hallway", [*seen, other]))
    assert all(after[kind] <= before[kind] + 1e-12 for kind in before)


@given(looks, st.sampled_from(KINDS), st.floats(0.0, 4.0))
def test_what_is_commoner_is_never_believed_less(seen: list[Evidence], kind: RivalKind, more: float) -> None:
    before = read(weigh_rivals("hallway", seen))
    after = read(weigh_rivals("hallway", seen, {**PRIORS, kind: PRIORS[kind] + more}))
    assert kind not in before or after[kind] >= before[kind] - 1e-12
    assert all(after[other] <= before[other] + 1e-12 for other in before if other != kind)


@given(evidence())
def test_one_look_is_weighed_by_bayes_rule_with_what_nobody_has_thought_of(seen: Evidence) -> None:
    odds = {e.kind: math.exp(PRIORS[e.kind] + e.log_ratio) for e in seen.explanations}
    expected = {kind: one / (1.0 + sum(odds.values())) for kind, one in odds.items()}
    assert read(weigh_rivals("hallway", [seen])) == pytest.approx(expected)


@given(st.lists(evidence(), min_size=MAX_COUNTED + 1, max_size=MAX_COUNTED + 4), st.randoms(use_true_random=False))
def test_the_strongest_evidence_is_kept_whatever_comes_when(seen: list[Evidence], random: object) -> None:
    mixed, kept = list(seen), list[Evidence]()
    random.shuffle(mixed)  # type: ignore[attr-defined]
    for one in mixed:
        kept = list(weigh_rivals("hallway", [*kept, one]).counted)
    strengths = sorted((max(abs(e.log_ratio) for e in one.explanations) for one in seen), reverse=True)[:MAX_COUNTED]
    assert sorted((max(abs(e.log_ratio) for e in one.explanations) for one in kept), reverse=True) == strengths


@given(looks)
def test_the_likeliest_stands_first_and_all_share_less_than_certainty(seen: list[Evidence]) -> None:
    rivals = weigh_rivals("hallway", seen).rivals
    assert all(one.p >= other.p for one, other in itertools.pairwise(rivals))
    assert sum(rival.p for rival in rivals) < 1.0


@given(st.lists(st.tuples(st.floats(0.6, 1.2), st.floats(0.01, 0.1)), max_size=4), st.integers(1, 4))
def test_what_is_too_short_to_have_a_size_takes_none_away(sized: list[tuple[float, float]], short: int) -> None:
    told = (*(Explanation("wheels", "wheels of a size", 1.0, *one) for one in sized),
            *[Explanation("wheels", "wheels", 3.0)] * short)
    (wheels,) = weigh_rivals("motion", [
        Evidence("motion", "", (one,), 0.0, 0.0, 0.0, 0.0, 0.0, float(k)) for k, one in enumerate(told)]).rivals
    weights = [sigma**-2 for _, sigma in sized]
    mean = math.fsum(w * off for w, (off, _) in zip(weights, sized, strict=True)) / (math.fsum(weights) or 1.0)
    assert wheels.off == pytest.approx(mean) and wheels.what == told[0].what
    chi2 = math.fsum(w * (off - mean) ** 2 for w, (off, _) in zip(weights, sized, strict=True))
    scatter = max(1.0, chi2 / (len(sized) - 1)) if len(sized) > 1 else 1.0  # no surer than how far apart they are
    assert wheels.sigma == pytest.approx(math.sqrt(scatter / math.fsum(weights)) if sized else 0.0)
