"""Laws of the alias monitor: every place that looks the same has its own odds, and is kept or dropped by these."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from blackboard.change import Posted
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from generated_boards import HALL, Bench, effect_on, made, plain_robot, reasons, to_world, wakes
from knowledge_sources.goal.pose_adopter import PoseAdopter
from knowledge_sources.plan.alias_monitor import AliasMonitor
from knowledge_sources.settings import DEFAULT
from world_models.entries.location import Hypothesis, PlaceOdds, PlaceSearch, Twin, TwinOdds, diagonal
from world_models.entries.percepts import LineMatch, PoseFix, Segments
from world_models.entries.task import Certificate, MilestoneVerdict, Outcome
from world_models.frames import Pose2

SOURCE, S = AliasMonitor(), DEFAULT.localization
HERE = to_world(Pose2(2.0, 2.0, 0.0))
SAME = Pose2(0.0, 0.0, 0.0)
"""A twin at the very same place: what the picture says of it is what it says of the believed one."""
BARE = np.zeros((0, 2, 2))


def verify(bench: Bench, pose: Pose2 = HERE, verdict: MilestoneVerdict = "verified") -> Entry[Certificate]:
    """A milestone that is verified by a bare picture from a pose (world)."""
    looked = bench.put(Segments("CameraPicture-1", "Milestone-1", BARE, np.zeros(0), 40.0))
    match = bench.put(LineMatch("Milestone-1", looked.id, np.zeros((0, 2), np.int64), np.zeros((0, 2, 3)), BARE, 0.0,
                                np.zeros(0)))
    fix = bench.put(PoseFix(match.id, pose, np.diag([1e-4, 1e-4, 1e-5]), np.ones(0, bool), np.zeros(0), ()))
    return bench.put(Certificate("Milestone-1", fix.id, verdict, "", 9, 9, 9, 0.9, 1.0, 0.0, 0.0, 3.0, 30.0, 0.001))


def known(ratios: list[float], p_prior: float, last: Pose2) -> TwinOdds:
    return TwinOdds(p_prior, 0.9, tuple(Twin(f"twin-{k}", SAME, r) for k, r in enumerate(ratios)),
                    ("Certificate-9",), last)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-12.0, 6.0), min_size=1, max_size=6), st.floats(0.3, 0.99))
def test_each_place_is_weighed_by_its_own_pictures(ratios: list[float], p_prior: float) -> None:
    """Bayes' rule, place by place; the twins share what the prior leaves."""
    bench = Bench(plain_robot())
    belief = bench.believe()
    old = bench.put(known(ratios, p_prior, Pose2(HERE.x_m - 3.0, HERE.y_m, 0.0)))
    certificate = verify(bench)
    effects = bench.ask(SOURCE, certificate)
    effect = effect_on(effects, TwinOdds)
    share = (1.0 - p_prior) / len(ratios)
    weights = [p_prior, *(share * math.exp(ratio) for ratio in ratios)]
    own, *others = (weight / sum(weights) for weight in weights)
    assume(all(abs(p - S.min_p_twin) > 1e-9 for p in others) and abs(own - S.min_p_tracked) > 1e-9)
    found = effect.value
    assert effect.entry.id == old.id and found.probability == pytest.approx(own)
    assert [t.locale for t in found.twins] == [f"twin-{k}" for k, p in enumerate(others) if p >= S.min_p_twin]
    assert all(t.log_ratio == pytest.approx(ratios[int(t.locale[5:])]) for t in found.twins)
    assert (found.p_prior, found.counted, found.last) == (p_prior, ("Certificate-9", certificate.id), HERE)
    assert reasons(effect) == {certificate.id, "PoseFix-1", "Segments-1", belief.id, old.id}
    doubts = made(effects, Discrepancy)
    assert bool(doubts) == (own < S.min_p_tracked)
    if doubts:
        assert (doubts[0].level, doubts[0].magnitude) == (Level.GOAL, None)
        assert reasons(effect_on(effects, Discrepancy)) == {"TwinOdds"}
    bench.apply(*effects or ())
    assert bench.ask(SOURCE, certificate) is None  # the same picture is not counted twice


@settings(max_examples=10, deadline=None)
@given(st.permutations([3.0, -1.0, -20.0, 1.0]))
def test_the_order_of_the_places_does_not_matter(ratios: list[float]) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.put(known(ratios, 0.5, Pose2(HERE.x_m - 3.0, HERE.y_m, 0.0)))
    found = effect_on(bench.ask(SOURCE, verify(bench)), TwinOdds).value
    assert sorted(t.log_ratio for t in found.twins) == pytest.approx([-1.0, 1.0, 3.0])


def test_the_first_time_the_odds_are_those_that_were_told() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    found = effect_on(bench.ask(SOURCE, verify(bench)), TwinOdds).value
    assert found.p_prior == pytest.approx(S.p_told) and len(found.counted) == 1


@pytest.mark.parametrize(("apart_m", "turn_rad", "counts"), [
    (0.0, 0.0, False), (5.0, 0.0, True), (0.0, 3.0, True), (0.0, -3.0, True), (0.01, 0.01, False)])
def test_only_another_view_counts(apart_m: float, turn_rad: float, counts: bool) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.put(known([0.0], 0.5, replace(HERE, x_m=HERE.x_m - apart_m, heading_rad=HERE.heading_rad - turn_rad)))
    assert (bench.ask(SOURCE, verify(bench)) is not None) == counts


@pytest.mark.parametrize("lacks", ["nothing", "belief", "fix", "match", "segments", "twins", "mission", "place"])
def test_it_weighs_only_what_it_has_seen_where_it_may_be_elsewhere(lacks: str) -> None:
    bench = Bench(plain_robot())
    if lacks != "belief":
        bench.believe()
    bench.put(known([] if lacks == "twins" else [0.0], 0.5, Pose2(HERE.x_m - 3.0, HERE.y_m, 0.0)))
    certificate = verify(bench)
    if lacks in ("fix", "match", "segments"):
        bench.retract(bench.view[{"fix": "PoseFix-1", "match": "LineMatch-1", "segments": "Segments-1"}[lacks]])
    elif lacks == "mission":
        bench.put(Outcome("failed", ""))
    elif lacks == "place":
        bench.doubt()
    assert (bench.ask(SOURCE, certificate) is not None) == (lacks == "nothing")


@pytest.mark.parametrize("refuted", [0, 1, 3])
def test_a_place_that_was_believed_by_odds_and_refuted_is_believed_less(refuted: int) -> None:
    """Each time the odds are a fifth; recomputed without the method."""
    bench = Bench(plain_robot())
    bench.believe()
    bench.put(PlaceOdds(HALL, 2, "told", 0.9, 0.99, refuted))
    found = effect_on(bench.ask(SOURCE, verify(bench)), TwinOdds).value
    odds = S.p_told / (1.0 - S.p_told) * S.lost_again_odds**refuted
    assert found.p_prior == pytest.approx(odds / (1.0 + odds))


def test_found_again_it_begins_anew() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    old = bench.put(known([0.0], 0.123, Pose2(HERE.x_m - 3.0, HERE.y_m, 0.0)))
    bench.put(Hypothesis(HALL, Pose2(3.0, 1.0, 0.5), diagonal(0.02, 0.01), "relocalization", status="candidate"))
    doubt = bench.doubt()
    bench.apply(*bench.ask(PoseAdopter(), bench.put(PlaceSearch("found", "one place"))) or ())
    assert bench.view.get(old.id) is None
    bench.revise(doubt, status="corrected")
    effect = effect_on(bench.ask(SOURCE, verify(bench)), TwinOdds)
    assert effect.value.p_prior != old.value.p_prior and old.id not in reasons(effect)


@pytest.mark.parametrize("verdict", ["verified", "refuted", "not testable"])
def test_only_what_is_verified_wakes_it(verdict: MilestoneVerdict) -> None:
    assert wakes(SOURCE, Posted(verify(Bench(), verdict=verdict))) == (verdict == "verified")
