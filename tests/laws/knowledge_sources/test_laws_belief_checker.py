"""Laws of the belief checker: a doubt is measured where the robot stands, ahead first; no look is counted twice."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry, Level
from generated_boards import Bench, effect_on, poses, reasons, to_world
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.verification import MIN_MATCHED_LINES, turn_headings
from knowledge_sources.milestone_selector.belief_checker import belief_checker
from knowledge_sources.reads import list_log_odds
from knowledge_sources.reads.sketches import MAX_LOOK_LOG_ODDS
from world_models.entries import Certificate, Discrepancy, Milestone
from world_models.entries.task import MilestoneStatus
from world_models.frames import Pose2, wrap_angle

SOURCE = belief_checker
FEW = MIN_MATCHED_LINES


def doubtful(pose: Pose2 | None = None) -> tuple[Bench, Entry[Discrepancy]]:
    bench = Bench(plain_robot())
    bench.believe(pose)
    return bench, bench.doubt(Level.PLAN)


def certify(bench: Bench, milestone: str, p_false: float, matched: int) -> None:
    """What a look for a milestone said."""
    said = Certificate(milestone, "", "not testable", "", 9, matched, matched, 0.5, 1.0, 0.0, 0.0, 0.0, 10.0, p_false,
                       p_false, 0.006)
    bench.put(said)


@settings(max_examples=25)
@given(poses)
def test_the_first_check_is_the_present_view_and_of_no_sketch(pose: Pose2) -> None:
    bench, doubt = doubtful(pose)
    effect = effect_on(bench.ask(SOURCE, doubt), Milestone)
    check = effect.value
    assert check.look_heading_rad == pytest.approx(to_world(pose).heading_rad)
    assert (check.sketch, check.index, check.tried, check.log_odds_so_far, check.status) == ("", -1, (), (), "turning")
    assert doubt.value.what in check.what and reasons(effect) == {doubt.id, "Hypothesis-1"}


def test_the_second_is_another_view_and_never_one_that_was_tried() -> None:
    bench, doubt = doubtful()
    tried: list[float] = []
    for _ in range(4):
        check = effect_on(bench.ask(SOURCE, doubt), Milestone).value
        assert list(check.tried) == tried
        assert all(abs(wrap_angle(check.look_heading_rad - heading)) > 0.05 for heading in tried)
        tried.append(check.look_heading_rad)
        bench.revise(bench.put(check), status="not testable")


@pytest.mark.parametrize("left_out", [0, 1])
def test_where_all_was_tried_it_looks_as_it_stands(left_out: int) -> None:
    bench, doubt = doubtful()
    here = to_world(Pose2(2.0, 2.0, 0.0))
    around = turn_headings(here)
    tried = (*around[:len(around) - left_out], here.heading_rad)
    bench.revise(bench.await_milestone(look_heading_rad=tried[-1], tried=tried[:-1]), status="not testable")
    check = effect_on(bench.ask(SOURCE, doubt), Milestone).value
    assert check.look_heading_rad == pytest.approx(around[-1] if left_out else here.heading_rad)


@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("status", ["not testable", "verified", "withdrawn"])
def test_only_looks_since_the_doubt_that_told_nothing_were_in_vain(when: str, status: MilestoneStatus) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    if when == "before":
        bench.revise(bench.await_milestone(), status=status)
    doubt = bench.doubt(Level.PLAN)
    if when == "after":
        bench.revise(bench.await_milestone(), status=status)
    check = effect_on(bench.ask(SOURCE, doubt), Milestone).value
    assert check.tried == ((0.0,) if (when, status) == ("after", "not testable") else ())


@settings(max_examples=100)
@given(st.lists(st.floats(-3.0, 3.0), max_size=2), st.floats(0.0, 1.0), st.sampled_from((FEW - 1, FEW, FEW + 5)))
def test_each_look_is_told_by_what_it_said_alone(before: list[float], p_false: float, matched: int) -> None:
    """In log odds, no more than one look may say, and nothing by too few lines."""
    bench = Bench()
    tried = tuple(float(k) for k in range(len(before) + 1))
    last = bench.await_milestone(look_heading_rad=tried[-1], tried=tried[:-1], log_odds_so_far=tuple(before),
                                 status="not testable")
    certify(bench, last.id, p_false, matched)
    told = list_log_odds(bench.view, Milestone("", -1, "", 9.0, tried=tried))
    p, most = min(max(p_false, 1e-12), 1.0 - 1e-12), MAX_LOOK_LOG_ODDS
    said = min(max(math.log(p / (1.0 - p)), -most), most) if matched >= FEW else 0.0
    assert told == pytest.approx((*before, said))


def test_nothing_was_told_without_a_look_or_by_the_verdict_on_another() -> None:
    bench = Bench()
    fresh, again = (Milestone("", -1, "", 1.0, tried=tried) for tried in ((), (0.0,)))
    assert list_log_odds(bench.view, again) == (0.0,)
    last = bench.await_milestone(status="not testable")
    assert list_log_odds(bench.view, again) == (0.0,)
    certify(bench, last.id, 0.1, 20)
    assert list_log_odds(bench.view, fresh) == () and list_log_odds(bench.view, again)[0] < 0.0
    certify(bench, "Milestone-9", 0.1, 20)
    assert list_log_odds(bench.view, again) == (0.0,)


def test_it_keeps_the_laws_of_all_sources() -> None:
    check_source(SOURCE, *doubtful())
