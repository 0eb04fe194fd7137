"""Laws of the goal renewer: the robot that knows its place again doubts nothing, and begins again from there."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Level, Post, Revise
from generated_boards import (
    Bench,
    all_reasons,
    effect_on,
    made,
    poses,
    reasons,
)
from harvey.testing import HALL, check_source, plain_robot
from knowledge_sources.goal.goal_renewer import goal_renewer
from world_models.entries import Discrepancy, Goal, Place
from world_models.frames import Pose2

SOURCE = goal_renewer
TO = Place(HALL, 6.0, 1.2, 0.4)


@settings(max_examples=40)
@given(poses, st.sets(st.sampled_from((Level.ACTION, Level.PLAN))))
def test_all_doubts_end_and_a_new_goal_leads_from_here_to_the_old_end(pose: Pose2, others: set[Level]) -> None:
    bench = Bench(plain_robot())
    goal = bench.pursue(TO)
    doubts = {bench.doubt(level, 9.0).id for level in others} | {bench.doubt().id}
    found = bench.revise(bench.believe(), locale_from_robot=pose, basis="relocalization")
    effects = bench.ask(SOURCE, found)
    assert effects is not None
    ended = [e for e in effects if isinstance(e, Revise) and isinstance(e.value, Discrepancy)]
    assert {e.entry.id for e in ended} == doubts
    assert all(e.value == replace(e.entry.value, status="corrected") for e in ended)
    old, new = made(effects, Goal)
    assert old == replace(goal.value, status="abandoned") and new.is_active
    assert new.destination == TO and new.origin.locale == HALL
    assert (new.origin.x_m, new.origin.y_m) == pytest.approx((pose.x_m, pose.y_m), abs=1e-9)
    assert all_reasons(effects) == {found.id}
    renewed = next(e for e in effects if isinstance(e, Post) and e.value is new)
    assert reasons(renewed) == {found.id, "Goal"}


def test_without_a_goal_only_the_doubt_ends_and_without_a_doubt_nothing_happens() -> None:
    bench = Bench(plain_robot())
    found = bench.revise(bench.believe(), basis="relocalization")
    assert bench.ask(SOURCE, found) is None
    below = bench.doubt(Level.PLAN, 9.0)
    assert bench.ask(SOURCE, found) is None
    lost = bench.doubt()
    effects = bench.ask(SOURCE, found)
    assert {e.entry.id for e in effects or () if isinstance(e, Revise)} == {below.id, lost.id}
    bench.revise(lost, status="corrected")
    assert bench.ask(SOURCE, found) is None


def test_a_goal_that_was_given_up_is_not_renewed() -> None:
    bench = Bench(plain_robot())
    bench.revise(bench.pursue(TO), status="abandoned")
    bench.doubt()
    found = bench.revise(bench.believe(), basis="relocalization")
    assert made(bench.ask(SOURCE, found), Goal) == []
    assert effect_on(bench.ask(SOURCE, found), Discrepancy).value.status == "corrected"


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.pursue(TO)
    bench.doubt()
    check_source(SOURCE, bench, bench.revise(bench.believe(), basis="relocalization"))
