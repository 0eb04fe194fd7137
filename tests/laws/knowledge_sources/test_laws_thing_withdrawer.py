"""Law of what is taken back when the robot was lost: what was seen, and not touched, since it was last sure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acting import answer
from blackboard.board import Blackboard
from blackboard.change import Posted, Revised
from blackboard.effect import Post, Revise
from knowledge_sources.action.thing_withdrawer import ThingWithdrawer
from things_in_hall import CARTON, HALL
from world_models.entries.location import Hypothesis, diagonal
from world_models.entries.obstacle import Obstacle, ObstacleStatus
from world_models.entries.task import Certificate, MilestoneVerdict
from world_models.frames import Pose2

SOURCE = ThingWithdrawer()
BELIEF = Hypothesis(HALL, Pose2(2.0, 1.2, 0.0), diagonal(0.01, 0.005), "relocalization")
things = st.tuples(st.sampled_from(get_args(ObstacleStatus)), st.booleans())
"""How it is known, and whether it was touched."""
verdicts = st.sampled_from(get_args(MilestoneVerdict))


@pytest.mark.parametrize("basis", ["command", "odometry", "tracks", "milestone", "relocalization", "ride"])
@pytest.mark.parametrize("status", ["held", "candidate"])
def test_it_wakes_when_a_lost_robot_is_found(basis: str, status: Any) -> None:
    (change,) = Blackboard().apply([Post(replace(BELIEF, basis=basis, status=status))], author="test", cycle=1)
    (watch,) = SOURCE.on
    assert watch.sees(Revised(change.entry)) == (basis == "relocalization" and status == "held")
    assert not watch.sees(Posted(change.entry))


@given(st.lists(things | verdicts, max_size=8))
@settings(max_examples=150)
def test_it_takes_back_what_was_seen_since_it_was_sure_and_was_not_touched(drawn: list[Any]) -> None:
    board = Blackboard()
    expected: list[Any] = []
    sure: list[Any] = []
    for cycle, one in enumerate(drawn, 1):
        if isinstance(one, tuple):
            status, is_touched = one
            value: Any = Obstacle(f"{HALL}/obstacle-{cycle}", HALL, CARTON, 0.05, 0.0, 0.0, 0.5,
                                  touched_s=1.0 if is_touched else None, status=status)
        else:
            value = Certificate("Milestone-1", "", one, "so it was", 9, 9, 9, 1.0, 0.2, 0.0, 0.0, 0.0, 4.0, 1e-3)
        (change,) = board.apply([Post(value)], author="test", cycle=cycle)
        if isinstance(one, tuple) and one[0] != "gone" and not one[1]:
            expected.append(change.entry)
        elif one == "verified":
            expected, sure = [], [change.entry]
    (found,) = board.apply([Post(BELIEF)], author="test", cycle=99)
    effects = answer(SOURCE, board.view, Revised(found.entry))
    assert (effects is not None) == bool(expected)
    assert [effect.entry for effect in effects or () if isinstance(effect, Revise)] == expected
    for effect in effects or ():
        assert isinstance(effect, Revise)
        told = effect.value.evidence
        assert effect.value == replace(effect.entry.value, status="gone", certainty=0.0, evidence=told)
        assert str(found.entry.ref) in told and "taken back" in told
        assert list(effect.because) == [found.entry, effect.entry, *sure]
    board.apply(effects or (), author=SOURCE.name, cycle=100)
    assert answer(SOURCE, board.view, Revised(found.entry)) is None
