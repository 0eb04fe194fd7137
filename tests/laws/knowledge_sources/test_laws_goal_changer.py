"""Laws of the goal changer on each kind of board: with a goal or without, lost or not, a milestone awaited or not."""

from __future__ import annotations

from itertools import product

import pytest

from blackboard import Effect, Post, Retract, Revise
from generated_boards import Bench, reasons
from harvey.simulation.simulated_run import build_robot_model
from harvey.testing import check_source, plain_robot
from knowledge_sources.goal.goal_changer import goal_changer
from sim.scenario import load_scenario
from world_models.entries import Goal, Place, Redirection
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2

HALL = "north-hall"
BELIEVED = Pose2(2.5, 1.2, 0.3)
TO = Place("archive", 3.048, 1.524)
ASKED = "(archive (10,5,0))"


def decide(*texts: str, goal: str = "active", is_lost: bool = False, is_waiting: bool = False) -> list[Effect] | None:
    """What the goal changer does when it is asked; None where it does not act."""
    bench = Bench(build_robot_model(load_scenario("shut-door"), load_world(WORLDS / "two_ways.toml")))
    bench.believe(BELIEVED, locale=HALL)
    if goal:
        bench.put(Goal(Place(HALL, 1.0, 1.0), Place(HALL, 4.0, 1.2, 0.5), goal))
    if is_waiting:
        bench.await_milestone("PlanSketch-1", 1)
    if is_lost:
        bench.doubt()
    asked = [bench.put(Redirection(text)) for text in texts][-1]
    effects = bench.ask(goal_changer, asked)
    assert effects is None or effects
    return None if effects is None else list(effects)


def summary(effects: list[Effect] | None) -> list[tuple[str, str]]:
    return [(type(effect.value).__name__, getattr(effect.value, "status", ""))
            for effect in effects or () if isinstance(effect, Post | Revise)]


@pytest.mark.parametrize("goal", ["", "reached", "abandoned"])
def test_without_a_goal_there_is_nothing_to_replace(goal: str) -> None:
    assert decide(ASKED, goal=goal) is None


@pytest.mark.parametrize(("is_lost", "is_waiting"), list(product((False, True), repeat=2)))
def test_with_a_goal_there_is_one_active_goal_and_it_is_the_one_asked_for(is_lost: bool, is_waiting: bool) -> None:
    effects = decide(ASKED, is_lost=is_lost, is_waiting=is_waiting)
    assert effects is not None
    goals = [effect.value for effect in effects if isinstance(effect, Post | Revise) and isinstance(effect.value, Goal)]
    (active,) = [goal for goal in goals if goal.is_active]
    found = active.destination
    assert (found.locale, found.x_m, found.y_m) == (TO.locale, pytest.approx(TO.x_m), pytest.approx(TO.y_m))
    assert found.heading_rad is None  # the heading asked for at the old goal is not that of the new
    if is_lost:  # where from is not known: the old goal is kept, with another destination
        assert summary(effects) == [("Redirection", ""), ("Goal", "active")]
        assert active.origin == Place(HALL, 1.0, 1.0)
    else:
        withdrawn = [("Milestone", "withdrawn")] if is_waiting else []
        assert summary(effects) == [("Redirection", ""), *withdrawn, ("Goal", "abandoned"), ("Goal", "active")]
        assert active.origin == Place(HALL, BELIEVED.x_m, BELIEVED.y_m)


@pytest.mark.parametrize("text", ["(archive (10,5,1))", "(archive 10)", "Go from here to there"])
def test_what_cannot_be_changes_nothing_but_its_answer(text: str) -> None:
    effects = decide(text, is_waiting=True)
    assert summary(effects) == [("Redirection", "")] and effects is not None
    (effect,) = effects
    assert isinstance(effect, Revise) and effect.value.answer.startswith("which cannot be: ")
    assert reasons(effect) == {"Redirection-1"}


def test_of_several_that_were_asked_before_it_could_act_the_last_counts() -> None:
    effects = decide("(north-hall (3,3,0))", "(archive 10)", ASKED)
    assert effects is not None
    *answered, _, new = effects
    assert [effect.value.answer.partition(" (")[0] for effect in answered if isinstance(effect, Revise)] == [
        "but was asked again since", "but was asked again since", "and goes to archive"]
    assert isinstance(new, Post) and new.value.destination.locale == "archive"


@pytest.mark.parametrize(("is_lost", "is_waiting"), list(product((False, True), repeat=2)))
def test_each_effect_names_what_was_asked_and_what_it_replaces(is_lost: bool, is_waiting: bool) -> None:
    effects = decide("(north-hall (3,3,0))", ASKED, is_lost=is_lost, is_waiting=is_waiting)
    assert effects is not None
    named = [(type(effect).__name__, type(effect.value).__name__, reasons(effect))
             for effect in effects if not isinstance(effect, Retract)]
    last, goal = "Redirection-2", "Goal-1"
    expected = [("Revise", "Redirection", {"Redirection-1", last}), ("Revise", "Redirection", {last})]
    if is_lost:
        expected += [("Revise", "Goal", {last, goal, "Discrepancy-1"})]
    else:
        expected += [("Revise", "Milestone", {last, "Milestone-1"})] * is_waiting
        expected += [("Revise", "Goal", {last, goal}), ("Post", "Goal", {last, goal, "Hypothesis-1"})]
    assert named == expected


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.pursue()
    check_source(goal_changer, bench, bench.put(Redirection("(study (9,9,0))")))
