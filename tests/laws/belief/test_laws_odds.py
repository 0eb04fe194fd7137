"""Evidence is added by one rule: in any order, the same look once, and what was known before never speaks against."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from knowledge_sources.methods.belief import (
    Alike,
    BelievedPlace,
    Look,
    add_looks,
    bound_p_aliases,
    compute_p_aliases,
    measure_common,
    to_log_odds,
    to_probability,
    update,
)
from world_models.frames import Pose2, wrap_angle

ALIKE = Alike(step_m=0.6, turn_rad=1.0)
poses = st.builds(Pose2, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
ratios = st.floats(-5.0, 5.0)
looks = st.builds(Look, poses, ratios)
probabilities = st.floats(1e-6, 1.0 - 1e-6)


@given(probabilities)
def test_log_odds_and_probability_are_inverse(p: float) -> None:
    assert to_probability(to_log_odds(p)) == pytest.approx(p, abs=1e-9)
    assert to_log_odds(p) == pytest.approx(math.log(p) - math.log1p(-p), rel=1e-6, abs=1e-9)


@given(probabilities, ratios, ratios)
def test_evidence_is_added_one_after_the_other_or_at_once(p: float, one: float, other: float) -> None:
    assert update(update(p, one), other) == pytest.approx(update(p, one + other), rel=1e-6)
    odds = p / (1.0 - p) * math.exp(one)
    assert update(p, one) == pytest.approx(odds / (1.0 + odds), rel=1e-6)


@given(st.lists(looks, max_size=6), st.randoms(use_true_random=False))
def test_the_order_of_looks_does_not_matter(some: list[Look], chance: object) -> None:
    shuffled = list(some)
    chance.shuffle(shuffled)  # type: ignore[attr-defined]
    assert add_looks(shuffled, ALIKE) == add_looks(some, ALIKE)


@given(st.lists(looks, max_size=5), st.integers(0, 4))
def test_a_look_taken_twice_from_one_place_is_worth_one(some: list[Look], which: int) -> None:
    if some:
        again = [*some, some[which % len(some)]]
        assert add_looks(again, ALIKE) == pytest.approx(add_looks(some, ALIKE), abs=1e-9)


@given(st.lists(looks, max_size=6))
def test_looks_never_add_more_than_all_that_they_say(some: list[Look]) -> None:
    assert abs(add_looks(some, ALIKE)) <= sum(abs(look.log_ratio) for look in some) + 1e-9


@given(st.floats(0.0, 1.0), st.floats(0.1, 5.0), st.floats(0.0, 1.0))
def test_of_two_looks_the_weaker_adds_what_is_not_common(part: float, strong: float, share: float) -> None:
    at = Pose2(part * ALIKE.step_m, 0.0, 0.0)
    seen = [Look(Pose2(0.0, 0.0, 0.0), strong), Look(at, share * strong)]
    assert measure_common(seen[0].pose, at, ALIKE) == pytest.approx(1.0 - part)
    assert add_looks(seen, ALIKE) == pytest.approx(strong + part * share * strong)


@given(poses, poses, poses)
def test_what_is_common_does_not_depend_on_where_the_building_stands(one: Pose2, other: Pose2, by: Pose2) -> None:
    assert measure_common(by @ one, by @ other, ALIKE) == pytest.approx(measure_common(one, other, ALIKE), abs=1e-9)
    mirrored = [Pose2(p.x_m, -p.y_m, -p.heading_rad) for p in (one, other)]
    assert measure_common(*mirrored, ALIKE) == pytest.approx(measure_common(one, other, ALIKE), abs=1e-9)


HERE, SIGMAS = Pose2(0.0, 0.0, 0.0), np.diag([0.01, 0.01, 0.01]) ** 2
FAR, FARTHER, NEAR = Pose2(3.66, 0.0, 0.0), Pose2(7.32, 0.0, 0.0), Pose2(0.005, 0.0, 0.0)


@given(probabilities, probabilities, ratios)
def test_more_prior_knowledge_never_makes_a_right_belief_less_likely(one: float, other: float, ratio: float) -> None:
    less, more = (compute_p_aliases(BelievedPlace(HERE, SIGMAS, p), NEAR, [(FAR, ratio)]) for p in sorted((one, other)))
    assert more <= less + 1e-12


@given(st.floats(0.005, 5.0), st.floats(1.0, 10.0), st.floats(0.5, 0.9999))
def test_a_sharper_belief_excludes_more(sigma: float, wider: float, p_there: float) -> None:
    sharp, wide = (BelievedPlace(HERE, np.diag([s, s, 0.01]) ** 2, p_there) for s in (sigma, wider * sigma))
    assert compute_p_aliases(sharp, HERE, [(FAR, 0.0)]) <= compute_p_aliases(wide, HERE, [(FAR, 0.0)]) + 1e-12


@given(st.floats(0.5, 0.9999), ratios)
def test_a_door_far_outside_the_belief_is_as_likely_as_the_belief_is_wrong(p_there: float, ratio: float) -> None:
    p = compute_p_aliases(BelievedPlace(HERE, SIGMAS, p_there), HERE, [(FAR, ratio)])
    share = 0.5 * (1.0 - p_there)  # wrong, the belief leaves this place open too
    there, here = share * math.exp(ratio), p_there + share
    assert p == pytest.approx(there / (there + here), rel=1e-6)


@given(ratios)
def test_within_the_belief_the_picture_alone_tells(ratio: float) -> None:
    wide = BelievedPlace(HERE, np.diag([1e6, 1e6, 1e6]), 0.98)
    assert compute_p_aliases(wide, HERE, [(FAR, ratio)]) == pytest.approx(to_probability(ratio), abs=1e-3)


@given(st.floats(0.5, 0.9999), ratios, ratios)
def test_rivals_share_what_the_belief_leaves(p_there: float, one: float, other: float) -> None:
    """However many places are tried, together they are no likelier than the likeliest picture of them makes them."""
    believed = BelievedPlace(HERE, SIGMAS, p_there)
    both = compute_p_aliases(believed, HERE, [(FAR, one), (FARTHER, other)])
    assert both == compute_p_aliases(believed, HERE, [(FARTHER, other), (FAR, one)])
    assert both <= (1.0 - p_there) * math.exp(max(one, other, 0.0)) / p_there + 1e-9
    assert compute_p_aliases(believed, HERE, []) == 0.0


@given(st.floats(-3.0, 3.0), st.floats(-0.5, 0.5), st.integers(-2, 2))
def test_headings_that_are_whole_turns_apart_are_the_same(heading: float, off: float, turns: int) -> None:
    alike, one = Alike(0.5, 0.6), Pose2(1.0, 2.0, heading)
    near, far = Pose2(1.0, 2.0, heading + off), Pose2(1.0, 2.0, heading + off + turns * math.tau)
    assert measure_common(one, far, alike) == pytest.approx(measure_common(one, near, alike), abs=1e-9)
    assert measure_common(one, near, alike) == pytest.approx(max(0.0, 1.0 - abs(off) / 0.6))


@given(probabilities, st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(-3.0, 3.0))
def test_what_is_believed_speaks_for_a_pose_within_it_and_as_much_against_one_far_outside(
    p_there: float, near: float, far: float, along: float
) -> None:
    """It is never likelier the farther off it is, where the belief supports anything; one in doubt says nothing."""
    believed = BelievedPlace(Pose2(1.0, 2.0, 0.5), np.diag([0.02**2, 0.02**2, 0.01**2]), p_there)
    at = [Pose2(1.0 + off * math.cos(along), 2.0 + off * math.sin(along), 0.5) for off in sorted((near, far))]
    nearer, farther = (believed.compute_p_wrong(pose) for pose in at)
    assert believed.compute_p_wrong(believed.pose) == pytest.approx(1.0 - p_there)
    assert believed.compute_p_wrong(Pose2(9.0, 2.0, 0.5)) == pytest.approx(p_there)
    assert nearer <= farther + 1e-12 if p_there >= 0.5 else farther <= nearer + 1e-12
    assert BelievedPlace(believed.pose, believed.covariance, 0.5).compute_p_wrong(at[1]) == pytest.approx(0.5)


@given(st.floats(0.5, 0.999), st.floats(0.5, 0.999), st.floats(0.01, 1.0))
def test_neither_a_surer_belief_nor_a_wider_one_makes_the_pose_that_it_allows_less_likely(
    one: float, other: float, wider: float
) -> None:
    """Surer, where the pose is as it was believed; wider, wherever the pose is."""
    here, exact, wide = Pose2(1.0, 2.0, 0.5), 4e-4 * np.eye(3), (4e-4 + wider) * np.eye(3)
    beside, off, (less, more) = Pose2(1.02, 2.0, 0.5), Pose2(1.0 + wider, 2.0, 0.5), sorted((one, other))
    at_beside = [BelievedPlace(here, exact, p).compute_p_wrong(beside) for p in (more, less)]
    at_off = [BelievedPlace(here, covariance, more).compute_p_wrong(off) for covariance in (wide, exact)]
    assert at_beside == sorted(at_beside) and at_off == sorted(at_off)


@given(st.floats(0.5, 0.9999), st.floats(0.005, 0.3), st.floats(0.002, 0.2), poses, st.floats(0.0, 4.0),
       st.lists(st.tuples(poses, st.floats(-4.0, 4.0)), min_size=1, max_size=9))
def test_no_rivals_are_likelier_than_the_bound_by_which_none_is_sought(
    p_there: float, sigma_m: float, sigma_rad: float, off: Pose2, most: float, drawn: list[tuple[Pose2, float]]
) -> None:
    """Wherever they lie beyond what counts as here, and whatever the picture says up to the most that it may."""
    believed = BelievedPlace(HERE, np.diag([sigma_m**2, (0.5 * sigma_m) ** 2, sigma_rad**2]), p_there)
    here = Pose2(HERE.x_m + 0.05 * off.x_m, HERE.y_m + 0.05 * off.y_m, HERE.heading_rad + 0.05 * off.heading_rad)
    apart = 0.4, 0.3
    rivals = [(pose, max(min(ratio, most), -most)) for pose, ratio in drawn
              if pose.distance_to(here) > apart[0] or abs(wrap_angle(pose.heading_rad - here.heading_rad)) > apart[1]]
    bound = bound_p_aliases(believed, here, apart, most) + 1e-12
    assert compute_p_aliases(believed, here, rivals) <= bound
    for side in (-1.0, 1.0):  # the nearest that there may be
        beside = [(Pose2(here.x_m + side * apart[0], here.y_m, here.heading_rad), most)] * 5
        turned = [(Pose2(here.x_m, here.y_m, here.heading_rad + side * apart[1]), most)] * 5
        assert max(compute_p_aliases(believed, here, beside), compute_p_aliases(believed, here, turned)) <= bound
