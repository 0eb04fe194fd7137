"""Laws of the interpreter: feet of a locale become metres of it; what is not understood ends the mission."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import MissingEntryError
from generated_boards import Bench, covariances, effect_on, made, reasons
from harvey.testing import HALL, STUDY, SURE, check_source, plain_robot
from knowledge_sources.goal.interpreter import interpreter
from world_models.entries import Command, Goal, Hypothesis, Impasse
from world_models.entries.location import Covariance

SOURCE, FOOT_M = interpreter, 0.3048
feet = st.integers(10, 1000).map(lambda hundredths: hundredths / 100.0)


@settings(max_examples=40)
@given(feet, feet, feet, feet, st.floats(-3.0, 3.0), st.none() | st.floats(-3.0, 3.0), covariances)
def test_a_command_is_a_goal_and_the_first_belief(
    x0: float, y0: float, x1: float, y1: float, start: float, arrival: float | None, covariance: Covariance
) -> None:
    bench = Bench(plain_robot())
    text = f"(ptrans ({HALL} ({x0},{y0},0)) ({STUDY} ({x1},{y1},0)))"
    command = bench.put(Command(text, start, arrival, covariance))
    effects = bench.ask(SOURCE, command)
    (goal,), (belief,) = made(effects, Goal), made(effects, Hypothesis)
    a, b = goal.origin, goal.destination
    assert (a.locale, b.locale, a.heading_rad, b.heading_rad) == (HALL, STUDY, None, arrival) and goal.is_active
    assert (a.x_m, a.y_m, b.x_m, b.y_m) == pytest.approx([FOOT_M * v for v in (x0, y0, x1, y1)])
    pose = belief.locale_from_robot
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((a.x_m, a.y_m, start))
    assert (belief.locale, belief.basis, belief.status, belief.motion) == (HALL, "command", "held", "")
    assert belief.covariance == covariance
    assert reasons(effect_on(effects, Goal)) == reasons(effect_on(effects, Hypothesis)) == {command.id}


def test_in_words_it_asks_for_both_rooms_by_what_they_are_called() -> None:
    bench = Bench(plain_robot())
    command = bench.put(Command("Go from the hall to the study", 0.0, None, ((0.0,) * 3,) * 3))
    with pytest.raises(MissingEntryError) as missing:
        bench.ask(SOURCE, command)
    assert missing.value.request.called == ("the hall", "the study")


@pytest.mark.parametrize("text", ["", "fly to the moon", "(ptrans (hall (1,1,0)))"])
def test_what_is_not_understood_ends_the_mission_with_the_reason(text: str) -> None:
    bench = Bench(plain_robot())
    command = bench.put(Command(text, 0.0, None, ((0.0,) * 3,) * 3))
    effects = bench.ask(SOURCE, command)
    assert effects is not None and len(effects) == 1
    effect = effect_on(effects, Impasse)
    assert effect.value.kind == "failed" and effect.value.is_open and not effect.value.behind
    assert effect.value.reason.startswith("the command was not understood: ") and reasons(effect) == {command.id}


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    check_source(SOURCE, bench, bench.put(Command(f"(ptrans ({HALL} (9,9,0)) ({STUDY} (9,9,0)))", 0.0, None, SURE)))
