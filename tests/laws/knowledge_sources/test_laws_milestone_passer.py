"""Laws of the milestone passer: on from a verified milestone, or the same subgoal again; failed so often, doubt."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from blackboard import Effect, Level, Post, Retract, Revise
from generated_boards import INEXACT, Bench, all_reasons, reasons
from harvey.simulation.simulated_run import build_robot_model
from harvey.testing import check_source, plain_robot
from knowledge_sources.reads import has_missed
from knowledge_sources.reads.sketches import GOAL_HEADING_TOLERANCE_RAD, INEXACT_TOLERANCE_SIGMAS, MAX_ADJUSTMENTS
from knowledge_sources.settings import DEFAULT
from knowledge_sources.sketcher.milestone_passer import MilestonePasser
from sim.scenario import load_scenario
from world_models.entries import (
    Discrepancy,
    Goal,
    Impasse,
    MotionReport,
    Obstacle,
    ObstacleStatus,
    Place,
    PlaceSearch,
    PlanSketch,
    SketchStatus,
    Subgoal,
    diagonal,
)
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2

HALL = "north-hall"
FROM, TO = Place(HALL, 2.0, 1.2), Place(HALL, 4.0, 1.2)
MOST, TOLERANCE_M = MAX_ADJUSTMENTS, 0.1
SMALL = 1e-3


def decide(off_m: float, adjustments: int, earlier_goals: int = 0, **other: Any) -> Effect:
    """Its first effect; arguments as in :func:`decide_all`."""
    return decide_all(off_m, adjustments, earlier_goals, **other)[0]


def decide_all(
    off_m: float, adjustments: int, earlier_goals: int = 0, *, left_m: float = 0.0, heading: float | None = None,
    off_rad: float = 0.0, sigma_m: float = 0.01, modes: tuple[str, ...] = (), way: tuple[Subgoal, ...] = (),
    at: int = 1, thing: tuple[float, ObstacleStatus] | None = None,
    is_look: bool = False,
) -> tuple[Effect, ...]:
    """What it does when the milestone at the end of a subgoal is verified, so far from where it should be."""
    world = load_world(WORLDS / "two_ways.toml")
    bench = Bench(build_robot_model(load_scenario("shut-door"), world))
    bench.believe(Pose2(TO.x_m - off_m, TO.y_m + left_m, (heading or 0.0) + off_rad), diagonal(sigma_m, 0.005),
                  locale=HALL)
    if thing is not None:
        (x_m, status), at_goal = thing, TO.in_world(world).position
        corners: Any = tuple((float(at_goal[0] + x_m + dx), float(at_goal[1] + dy))
                             for dx, dy in ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)))
        bench.put(Obstacle("north-hall/obstacle-1", HALL, corners, 0.02, 1.0, 1.0, 0.2, status=status))
    for _ in range(earlier_goals):
        bench.revise(bench.put(Goal(FROM, TO)), status="abandoned")
    goal = bench.put(Goal(FROM, TO))
    steps = way or (Subgoal(FROM, replace(TO, heading_rad=heading), primitive=True, tolerance_m=TOLERANCE_M),)
    sketch = bench.put(PlanSketch(goal.id, (), "", steps, at=at, adjustments=adjustments, is_look=is_look))
    expected = bench.await_milestone(sketch.id, at, **(INEXACT if modes else {}))
    effects = bench.ask(MilestonePasser(DEFAULT), bench.revise(expected, status="verified"))
    assert effects is not None
    return effects


def test_in_vain_is_doubt_for_the_first_goal_and_blocked_for_a_later_one() -> None:
    last = decide(0.5, MOST - 1)
    assert isinstance(last, Revise) and isinstance(last.value, PlanSketch) and last.value.adjustments == MOST
    doubt, blocked = decide(0.5, MOST), decide(0.5, MOST, earlier_goals=1)
    assert isinstance(doubt, Post) and isinstance(doubt.value, Discrepancy) and doubt.value.level is Level.GOAL
    assert (doubt.value.magnitude, doubt.value.bounds, doubt.value.unit) == (None, (0.0, 0.0), "px")
    assert isinstance(blocked, Post) and isinstance(blocked.value, Impasse) and blocked.value.kind == "blocked"
    assert reasons(doubt) == {"Milestone-1", "Goal-1"} and reasons(blocked) == {"Milestone-1", "PlanSketch-1"}


def is_repeated(effect: Effect) -> bool:
    assert isinstance(effect, Revise) and isinstance(effect.value, PlanSketch)
    return effect.value.at == 0


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("more", [-SMALL, SMALL])
def test_off_to_either_side_and_turned_to_either_side_is_missed_alike(side: float, more: float) -> None:
    assert is_repeated(decide(0.0, 0, left_m=side * (TOLERANCE_M + more))) == (more > 0.0)
    for heading in (0.0, 1.0, -3.1):
        off = side * (GOAL_HEADING_TOLERANCE_RAD + more)
        assert is_repeated(decide(0.0, 0, heading=heading, off_rad=off)) == (more > 0.0)
    assert not is_repeated(decide(0.0, 0, off_rad=side * 2.0))  # no heading is asked for


@pytest.mark.parametrize("more", [-SMALL, SMALL])
@pytest.mark.parametrize("modes", [(), ("wall",)])
def test_an_inexact_model_makes_the_tolerance_wider_by_what_is_not_known(more: float, modes: tuple[str, ...]) -> None:
    sigma_m = 0.06
    wider = math.hypot(TOLERANCE_M, INEXACT_TOLERANCE_SIGMAS * sigma_m) if modes else TOLERANCE_M
    assert is_repeated(decide(wider + more, 0, sigma_m=sigma_m, modes=modes)) == (more > 0.0)


def test_a_missed_subgoal_is_driven_again_from_where_the_robot_is() -> None:
    end = Place(HALL, 5.0, 1.2)
    way = (Subgoal(FROM, TO, primitive=False, tolerance_m=TOLERANCE_M), Subgoal(TO, end, primitive=True))
    effects = decide_all(0.3, 1, left_m=0.2, way=way)
    (effect,) = effects
    assert isinstance(effect, Revise)
    again, then = effect.value.subgoals
    assert (again.origin.locale, again.destination, again.primitive) == (HALL, TO, True) and then == way[1]
    assert (again.origin.x_m, again.origin.y_m) == pytest.approx((TO.x_m - 0.3, TO.y_m + 0.2))
    now = effect.value
    assert (now.at, now.verified, now.adjustments, now.status) == (0, True, 2, "active")
    assert all_reasons(effects) == {"Milestone-1", "Hypothesis-1"}


@pytest.mark.parametrize(("at", "status"), [(0, "active"), (1, "active"), (2, "done")])
def test_a_milestone_that_holds_lets_the_next_subgoal_begin(at: int, status: str) -> None:
    middle = Place(HALL, 3.0, 1.2)
    way = (Subgoal(FROM, TO if at == 1 else middle, primitive=True), Subgoal(middle, TO, primitive=True))
    (effect,) = decide_all(0.0, 2, way=way, at=at)
    assert isinstance(effect, Revise)
    now = effect.value
    assert (now.at, now.verified, now.status, now.subgoals) == (at, True, status, way)
    assert now.adjustments == (0 if status == "active" else 2)


@pytest.mark.parametrize("status", ["active", "done", "halted", "superseded"])
@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("has_belief", [True, False])
def test_only_the_milestone_to_which_an_active_sketch_has_come_counts(
    status: SketchStatus, index: int, has_belief: bool
) -> None:
    bench = Bench(plain_robot())
    if has_belief:
        bench.believe(Pose2(6.0, 2.0, 0.0))
    sketch = bench.revise(bench.sketch(at=1, verified=False), status=status)
    verified = bench.revise(bench.await_milestone(sketch.id, index), status="verified")
    acts = bench.ask(MilestonePasser(DEFAULT), verified) is not None
    assert acts == (status == "active" and index == 1 and has_belief)


@pytest.mark.parametrize(("at", "gone_m", "tried", "does"), [
    (1, 0.05, 0, [PlanSketch]), (1, 0.2, 0, []), (2, 0.0, 0, []), (2, 0.0, 2, [Impasse]), (2, 0.2, 2, [])])
def test_what_tells_nothing_where_it_was_just_found_is_not_asked_again(
    at: int, gone_m: float, tried: int, does: list[type]
) -> None:
    bench = Bench(plain_robot())
    bench.believe(Pose2(2.0, 2.0, 0.0), locale="hall")
    bench.put(PlaceSearch("found", "it is here"))
    bench.put(MotionReport(0.5, gone_m, 1.0, 1.0))
    sketch = bench.sketch(*[Place("hall", 2.0, 2.0)] * 3, at=at, verified=False)
    asked = bench.revise(bench.await_milestone(sketch.id, at), status="not testable", tried=(1.0,) * tried)
    effects = bench.ask(MilestonePasser(DEFAULT), asked)
    values = [effect.value for effect in effects or () if not isinstance(effect, Retract)]
    assert [type(value) for value in values] == does
    assert all(value.verified for value in values if isinstance(value, PlanSketch))
    assert not does or "PlaceSearch-1" in all_reasons(effects)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("status", "off_m", "is_told"), [
    ("there", -SMALL, True), ("suspected", -SMALL, True), ("gone", -SMALL, False), ("there", SMALL, False)])
def test_what_stands_where_it_should_have_come_is_told(
    status: ObstacleStatus, off_m: float, is_told: bool, side: float
) -> None:
    """Before and behind it, as far as the robot's rim."""
    radius_m = build_robot_model(load_scenario("shut-door"), load_world(WORLDS / "two_ways.toml")).radius_m
    x_m = side * (radius_m + 0.1 + off_m)
    effect = decide(0.5, MOST, thing=(x_m, status))
    assert isinstance(effect, Post) and isinstance(effect.value, Discrepancy)
    assert ("occupied by something" in effect.value.what) is is_told
    assert "Obstacle-1" in reasons(effect) if is_told else "Obstacle-1" not in reasons(effect)


def test_in_vain_it_says_what_was_not_come_to_and_by_how_much() -> None:
    ride = Subgoal(TO, replace(TO, locale="reception"), primitive=False, passage="lift-a")
    step = Subgoal(FROM, TO, primitive=True, tolerance_m=TOLERANCE_M)
    for way, said in (((step,), "the goal"), ((step, step), "the way"), ((step, ride), "the elevator lift-a")):
        effect = decide(0.5, MOST, way=way)
        assert isinstance(effect, Post) and isinstance(effect.value, Discrepancy)
        assert effect.value.what.startswith(f"{said} at {TO} was not reached in {MOST + 1} tries")
        assert effect.value.what.endswith("0.50 m from it")


@pytest.mark.parametrize("is_look", [True, False])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_lookout_is_come_to_however_it_turned_since(is_look: bool, side: float) -> None:
    """It has looked when it came there; what verifies the place may be in another direction."""
    off_rad = side * (GOAL_HEADING_TOLERANCE_RAD + SMALL)
    assert is_repeated(decide(0.0, 0, heading=1.0, off_rad=off_rad, is_look=is_look)) is not is_look
    assert is_repeated(decide(TOLERANCE_M + SMALL, 0, heading=1.0, is_look=is_look))


@pytest.mark.parametrize("at", [1, 2, 3, 4])
def test_the_subgoal_that_was_missed_alone_is_drawn_anew_from_where_the_robot_is(at: int) -> None:
    bench = Bench(plain_robot())
    bench.believe(Pose2(3.3, 1.1, 0.2))
    places = [Place("hall", 1.0 + k, 2.0) for k in range(5)]
    sketch = bench.sketch(*places, at=at, verified=False)
    milestone = bench.revise(bench.await_milestone(sketch.id, at), status="verified")
    (effect,) = bench.ask(MilestonePasser(), milestone) or ()
    assert isinstance(effect, Revise)
    again, before = effect.value.subgoals, sketch.value.subgoals
    assert len(again) == len(before) and effect.value.at == at - 1
    assert [k for k, (a, b) in enumerate(zip(again, before, strict=True)) if a != b] == [at - 1]
    start, end = again[at - 1].origin, again[at - 1].destination
    assert (start.x_m, start.y_m) == pytest.approx((3.3, 1.1)) and end == before[at - 1].destination


@pytest.mark.parametrize("is_look", [True, False])
def test_a_part_of_a_way_to_a_lookout_is_come_to_as_that(is_look: bool) -> None:
    """A sketch in more detail does not say itself that it leads to a lookout."""
    bench = Bench(plain_robot())
    goal, belief = bench.pursue(), bench.believe(Pose2(2.0, 2.0, 0.5))
    bench.put(PlanSketch(goal.id, (), "", (Subgoal(FROM, TO, primitive=False),), is_look=is_look), goal)
    there = Place("hall", 2.0, 2.0, 0.0)
    part = PlanSketch(goal.id, (0,), "hall", (Subgoal(Place("hall", 1.0, 2.0), there, primitive=True,
                                                      tolerance_m=TOLERANCE_M),), at=1, verified=True)
    assert has_missed(bench.view, belief.value, part, is_inexact=False) is not is_look


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    sketch = bench.sketch(at=1, verified=False)
    milestone = bench.revise(bench.await_milestone(sketch.id, 1), status="verified")
    check_source(MilestonePasser, bench, milestone, without=("PlanSketch-1", "Goal-1"))
