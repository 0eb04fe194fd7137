"""Laws of the alias monitor: every place that looks the same has its own odds, and is kept or dropped by these."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from blackboard import Entry, Level
from generated_boards import LENGTH_M, WIDTH_M, Bench, effect_on, made, reasons, to_world
from harvey.testing import HALL, STUDY, check_source, plain_robot
from knowledge_sources.methods.localization import (
    ALIKE_LOG_NOISE,
    LOST_AGAIN_ODDS,
    MIN_NEW_VIEW_RAD,
    MIN_P_TRACKED,
    MOVE_M,
    P_STATED,
    CameraView,
    compute_pose_likelihood,
    make_alias_test,
)
from knowledge_sources.methods.verification import predict_lines
from knowledge_sources.reads.place_believed import MIN_P_ALIAS
from knowledge_sources.relocalizer import alias_monitor
from knowledge_sources.relocalizer.alias_monitor import AliasMonitor
from knowledge_sources.relocalizer.pose_adopter import pose_adopter
from world_models.entries import (
    Alias,
    AliasOdds,
    Certificate,
    Discrepancy,
    Hypothesis,
    LineMatch,
    MilestoneVerdict,
    PlaceOdds,
    PlaceSearch,
    PoseFix,
    Segments,
    diagonal,
)
from world_models.frames import Pose2, wrap_angle

SOURCE, ROBOT, SMALL = AliasMonitor(), plain_robot(), 1e-6
HERE = to_world(Pose2(2.0, 2.0, 0.0))
SAME = Pose2(0.0, 0.0, 0.0)
"""A twin at the very same place: what the picture says of it is what it says of the believed one."""
BARE = np.zeros((0, 2, 2))


@pytest.fixture()
def keeps_every_twin(monkeypatch: pytest.MonkeyPatch) -> None:
    """A twin is kept in mind however unlikely it is."""
    monkeypatch.setattr(alias_monitor, "MIN_P_ALIAS", 0.0)


def verify(
    bench: Bench, pose: Pose2 = HERE, verdict: MilestoneVerdict = "verified", seen: np.ndarray = BARE
) -> Entry[Certificate]:
    """A milestone that is verified from a pose (world) by a picture with such segments, a bare one by default."""
    looked = bench.put(Segments("CameraPicture-1", "Milestone-1", seen, np.zeros(len(seen)), 40.0))
    match = bench.put(
        LineMatch("Milestone-1", looked.id, np.zeros((0, 2), np.int64), np.zeros((0, 2, 3)), BARE, 0.0, np.zeros(0))
    )
    fix = bench.put(PoseFix(match.id, pose, np.diag([1e-4, 1e-4, 1e-5]), np.ones(0, bool), np.zeros(0), ()))
    return bench.put(Certificate("Milestone-1", fix.id, verdict, "", 9, 9, 9, 0.9, 1.0, 0.0, 0.0, 3.0, 30.0,
                                 0.001, 0.001, 0.006))


def say(seen: np.ndarray, here: Pose2, there: Pose2) -> float:
    """By how much a picture is likelier there than here [log], less what is noise where both look alike."""
    view, unmoved = CameraView(seen, Pose2(0.0, 0.0, 0.0), np.zeros((3, 3))), Pose2(0.0, 0.0, 0.0)
    one, other = (compute_pose_likelihood(ROBOT, [view], pose).log_likelihood for pose in (here, there))
    noise = ALIKE_LOG_NOISE * make_alias_test(ROBOT, [unmoved])(here, there)
    return math.copysign(max(abs(other - one) - noise, 0.0), other - one)


def known(ratios: list[float], p_prior: float, last: Pose2) -> AliasOdds:
    return AliasOdds(
        p_prior, 0.9, tuple(Alias(f"twin-{k}", SAME, r) for k, r in enumerate(ratios)), ("Certificate-9",), last
    )


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-12.0, 6.0), min_size=1, max_size=6), st.floats(0.3, 0.99))
def test_each_place_is_weighed_by_its_own_pictures(ratios: list[float], p_prior: float) -> None:
    """Bayes' rule, place by place; the twins share what the prior leaves."""
    bench = Bench(plain_robot())
    belief = bench.believe()
    old = bench.put(known(ratios, p_prior, Pose2(HERE.x_m - 3.0, HERE.y_m, 0.0)))
    certificate = verify(bench)
    effects = bench.ask(SOURCE, certificate)
    effect = effect_on(effects, AliasOdds)
    share = (1.0 - p_prior) / len(ratios)
    weights = [p_prior, *(share * math.exp(ratio) for ratio in ratios)]
    own, *others = (weight / sum(weights) for weight in weights)
    assume(all(abs(p - MIN_P_ALIAS) > 1e-9 for p in others) and abs(own - MIN_P_TRACKED) > 1e-9)
    found = effect.value
    assert effect.entry.id == old.id and found.probability == pytest.approx(own)
    assert [t.locale for t in found.aliases] == [f"twin-{k}" for k, p in enumerate(others) if p >= MIN_P_ALIAS]
    assert all(t.log_ratio == pytest.approx(ratios[int(t.locale[5:])]) for t in found.aliases)
    assert (found.p_prior, found.counted, found.last) == (p_prior, ("Certificate-9", certificate.id), HERE)
    assert reasons(effect) == {certificate.id, "PoseFix-1", "Segments-1", belief.id, old.id}
    doubts = made(effects, Discrepancy)
    assert bool(doubts) == (own < MIN_P_TRACKED)
    if doubts:
        assert (doubts[0].level, doubts[0].magnitude) == (Level.GOAL, None)
        assert reasons(effect_on(effects, Discrepancy)) == {"AliasOdds"}
    bench.apply(*effects or ())
    assert bench.ask(SOURCE, certificate) is None  # the same picture is not counted twice


@settings(max_examples=10, deadline=None)
@given(st.permutations([3.0, -1.0, -20.0, 1.0]))
def test_the_order_of_the_places_does_not_matter(ratios: list[float]) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.put(known(ratios, 0.5, Pose2(HERE.x_m - 3.0, HERE.y_m, 0.0)))
    found = effect_on(bench.ask(SOURCE, verify(bench)), AliasOdds).value
    assert sorted(t.log_ratio for t in found.aliases) == pytest.approx([-1.0, 1.0, 3.0])


def test_the_first_time_the_odds_are_those_that_were_told() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    found = effect_on(bench.ask(SOURCE, verify(bench)), AliasOdds).value
    assert found.p_prior == pytest.approx(P_STATED) and len(found.counted) == 1


@pytest.mark.parametrize("there", [Pose2(5.2, 2.3, -1.2), Pose2(4.1, 1.7, 0.6), Pose2(9.5, 1.0, 2.8)])
@pytest.mark.parametrize("seen_from", ["here", "there", "between"])
@pytest.mark.usefixtures("keeps_every_twin")
def test_each_is_weighed_where_the_robot_would_be_there(there: Pose2, seen_from: str) -> None:
    """Wherever it has driven since the twin was found; between places that look alike what is noise says nothing."""
    here, other = to_world(Pose2(3.2, 1.8, 1.9)), to_world(there)
    shot = {"here": here, "there": other, "between": to_world(Pose2(3.2, 1.9, 1.85))}[seen_from]
    seen = predict_lines(ROBOT, shot).segments_px
    bench = Bench(ROBOT)
    bench.believe(Pose2(3.2, 1.8, 1.9))
    twin = Alias(HALL, other @ here.inverse(), 0.7)
    bench.put(AliasOdds(0.5, 0.9, (twin,), ("Certificate-9",), Pose2(HERE.x_m - 3.0, HERE.y_m, 0.0)))
    (found,) = effect_on(bench.ask(SOURCE, verify(bench, here, seen=seen)), AliasOdds).value.aliases
    assert found.there_from_here == twin.there_from_here
    assert found.log_ratio == pytest.approx(0.7 + say(seen, here, other))


@pytest.mark.usefixtures("keeps_every_twin")
def test_what_is_noise_between_places_that_look_alike_says_nothing() -> None:
    """The hall is the same turned round; a few centimetres aside a picture is likelier at one of both than it may."""
    here = to_world(Pose2(3.2, 1.8, -2.4))
    told = []
    for aside_m in (0.0, 0.02, 0.05, 0.08):
        other = to_world(Pose2(LENGTH_M - 3.2 + aside_m, WIDTH_M - 1.8 - aside_m, math.pi - 2.4))
        for shot in (here, other):
            seen = predict_lines(ROBOT, shot).segments_px
            bench = Bench(ROBOT)
            bench.believe(Pose2(3.2, 1.8, -2.4))
            bench.put(AliasOdds(0.5, 0.9, (Alias(HALL, other @ here.inverse(), 0.0),), (), Pose2(0.0, 0.0, 0.0)))
            (found,) = effect_on(bench.ask(SOURCE, verify(bench, here, seen=seen)), AliasOdds).value.aliases
            assert found.log_ratio == pytest.approx(say(seen, here, other))
            told.append(found.log_ratio)
    assert min(told) < 0.0 < max(told) and told.count(0.0) > 0


@pytest.mark.parametrize("pose", [Pose2(6.0, 2.6, 1.4), Pose2(3.0, 1.1, -2.0), Pose2(6.8, 3.0, 3.0)])
@pytest.mark.usefixtures("keeps_every_twin")
def test_twins_are_where_walls_and_doors_are_as_here(pose: Pose2) -> None:
    """The hall turned round, and behind its door what lies to that as the robot does; each goes with the robot."""
    bench, here = Bench(ROBOT), to_world(pose)
    bench.believe(pose)
    twins = effect_on(bench.ask(SOURCE, verify(bench, here)), AliasOdds).value.aliases
    wanted = [
        (HALL, Pose2(LENGTH_M - pose.x_m, WIDTH_M - pose.y_m, pose.heading_rad + math.pi)),
        (STUDY, Pose2(LENGTH_M + 8.2 - pose.x_m, WIDTH_M - pose.y_m, pose.heading_rad + math.pi)),
    ]
    for move in (Pose2(0.0, 0.0, 0.0), Pose2(0.7, -0.2, 0.5)):
        found = [(twin.locale, twin.there_from_here @ (here @ move)) for twin in twins]
        for (locale, there), (room, at) in zip(sorted(found, key=lambda f: f[0]), wanted, strict=True):
            off = (to_world(at) @ move).inverse() @ there
            assert locale == room and (off.x_m, off.y_m) == pytest.approx((0.0, 0.0), abs=1e-9)
            assert wrap_angle(off.heading_rad) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("apart_m", "turn_rad", "counts"),
    [
        (0.0, 0.0, False),
        (0.5 * MOVE_M + SMALL, 0.0, True),
        (0.5 * MOVE_M - SMALL, 0.0, False),
        (0.0, MIN_NEW_VIEW_RAD + SMALL, True),
        (0.0, -MIN_NEW_VIEW_RAD - SMALL, True),
        (0.0, MIN_NEW_VIEW_RAD - SMALL, False),
        (0.0, 6.2, False),
        (0.0, -6.2, False),
    ],
)
def test_only_another_view_counts(apart_m: float, turn_rad: float, counts: bool) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.put(known([0.0], 0.5, replace(HERE, x_m=HERE.x_m - apart_m, heading_rad=HERE.heading_rad - turn_rad)))
    assert (bench.ask(SOURCE, verify(bench)) is not None) == counts


@pytest.mark.parametrize("refuted", [0, 1, 3])
def test_a_place_that_was_believed_by_odds_and_refuted_is_believed_less(refuted: int) -> None:
    """Each time the odds are a fifth; recomputed without the method."""
    bench = Bench(plain_robot())
    bench.believe()
    bench.put(PlaceOdds(HALL, 2, "stated", 0.9, 0.99, refuted))
    found = effect_on(bench.ask(SOURCE, verify(bench)), AliasOdds).value
    odds = P_STATED / (1.0 - P_STATED) * LOST_AGAIN_ODDS**refuted
    assert found.p_prior == pytest.approx(odds / (1.0 + odds))


def test_found_again_it_begins_anew() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    old = bench.put(known([0.0], 0.123, Pose2(HERE.x_m - 3.0, HERE.y_m, 0.0)))
    bench.put(Hypothesis(HALL, Pose2(3.0, 1.0, 0.5), diagonal(0.02, 0.01), "relocalization", status="candidate"))
    doubt = bench.doubt()
    bench.apply(*bench.ask(pose_adopter, bench.put(PlaceSearch("found", "one place"))) or ())
    assert bench.view.get(old.id) is None
    bench.revise(doubt, status="corrected")
    effect = effect_on(bench.ask(SOURCE, verify(bench)), AliasOdds)
    assert effect.value.p_prior != old.value.p_prior and old.id not in reasons(effect)


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(ROBOT)
    bench.believe()
    odds = bench.put(known([0.0], 0.5, Pose2(HERE.x_m - 3.0, HERE.y_m, 0.0)))
    certificate = verify(bench)
    check_source(SOURCE, bench, certificate, without=("PoseFix-1", "LineMatch-1", "Segments-1"))
    bench.revise(odds, aliases=())
    assert bench.ask(SOURCE, certificate) is None  # it can be nowhere else
