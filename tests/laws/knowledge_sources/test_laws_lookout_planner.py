"""Laws of the lookout planner: what leaves no way is looked at again from elsewhere, so often a goal."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from blackboard import Entry, Revise
from generated_boards import LENGTH_M, WIDTH_M, Bench, effect_on, made, reasons, to_world
from harvey.testing import HALL, STUDY, check_source, plain_robot
from knowledge_sources.methods.motion.subgoals import DOOR_LOOK_APART_M, MIN_DOOR_LOOK_SINE, MIN_LOOKOUT_CHANGE_M
from knowledge_sources.settings import DEFAULT
from knowledge_sources.sketcher.lookout_planner import LookoutPlanner
from world_models.building.locale_frame import FRAME_OF, FrameChange
from world_models.entries import DoorCondition, DoorPicture, DoorState, Impasse, Obstacle, Place, PlanSketch
from world_models.frames import Pose2

SOURCE = LookoutPlanner()
MOST = DEFAULT.plan.max_lookouts


def stuck(*, looked: int = 0) -> tuple[Bench, Entry[Impasse]]:
    """A board on which something across the hall leaves no way to the goal, after so many looks at it."""
    bench = Bench(plain_robot())
    bench.believe(Pose2(1.2, 2.0, 0.0))
    goal = bench.pursue(Place(HALL, 7.0, 2.0))
    corners = tuple(tuple(to_world(Pose2(5.0 + dx, 2.0 + dy, 0.0)).position.tolist())
                    for dx, dy in ((-0.1, -1.9), (0.1, -1.9), (0.1, 1.9), (-0.1, 1.9)))
    middle = to_world(Pose2(5.0, 2.0, 0.0))
    thing = bench.put(Obstacle("hall/obstacle-1", HALL, corners, 0.02, middle.x_m, middle.y_m, 3.8))
    for number in range(looked):
        bench.put(Impasse("blocked", "before", goal.id, (thing.id,), is_open=False, lookout=(-9.0 * number, 0.0)))
    return bench, bench.put(Impasse("blocked", "no way", goal.id, (thing.id,)))


@pytest.mark.parametrize("looked", [0, MOST - 1, MOST])
def test_it_leads_to_a_look_so_often_a_goal(looked: int) -> None:
    bench, impasse = stuck(looked=looked)
    bench.put(Impasse("blocked", "of another goal", "Goal-9", (), is_open=False))
    old = bench.sketch(goal=bench.view["Goal-1"])
    effects = bench.ask(SOURCE, impasse)
    assert (effects is not None) == (looked < MOST)
    if effects is None:
        return
    closed = effect_on(effects, Impasse)
    assert closed.entry is impasse and not closed.value.is_open
    assert {r.id for r in closed.because} == {impasse.id, "Obstacle-1", "Hypothesis-1"}
    ended, drawn = made(effects, PlanSketch)
    assert ended.status == "superseded" and old.value.is_active
    assert (drawn.goal, drawn.path, drawn.is_look, drawn.status) == ("Goal-1", (), True, "active")
    (step,) = drawn.subgoals
    assert (step.origin.x_m, step.origin.y_m) == pytest.approx((1.2, 2.0)) and step.destination.locale == HALL
    assert step.destination.x_m < 5.0 - 0.1 - plain_robot().radius_m  # on this side of what it looks at


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_first_what_alone_leaves_a_way_the_nearest_first_and_another_each_time(side: float) -> None:
    """Two things that bar the hall together; a nearer one that bars nothing; and one that nobody takes to be behind."""
    bench = Bench(plain_robot())
    bench.believe(Pose2(1.2, 2.0, 0.0))
    goal = bench.pursue(Place(STUDY, 3.0, 2.0))
    bench.stand(1.6, 2.0 - 1.6 * side, 0.1, 0.1)
    beside = bench.stand(2.4, 2.0 + 1.6 * side, 0.1, 0.1)
    far, near = bench.stand(4.9, 2.0 + 0.95 * side, 0.1, 1.0), bench.stand(4.3, 2.0 - 0.95 * side, 0.1, 1.0)
    behind = (far.id, beside.id, near.id)
    for alone in (beside, far):  # only what is behind is looked at
        named = bench.ask(SOURCE, bench.put(Impasse("blocked", "no way", goal.id, (alone.id,))))
        assert alone.id in reasons(effect_on(named, Impasse))
    looked_at = []
    for looked in range(MOST):
        effects = bench.ask(SOURCE, bench.put(Impasse("blocked", "no way", goal.id, behind)))
        drawn = effect_on(effects, PlanSketch)
        (seen,) = {id for id in reasons(drawn) if id.startswith("Obstacle")}
        looked_at.append(seen)
        frame = bench.view.newest(FRAME_OF, HALL)
        assert frame is not None and looked == len(looked_at) - 1
        assert reasons(drawn) == {goal.id, "Hypothesis-1", seen, "Impasse", frame.id}
        bench.apply(*effects or ())
        bench.revise(bench.view.latest(PlanSketch), status="done")  # type: ignore[arg-type]
    assert looked_at == [(near.id, far.id)[k % 2] for k in range(MOST)]


@pytest.mark.parametrize("is_shut", [False, True])
def test_behind_a_shut_door_no_thing_is_worth_a_look(is_shut: bool) -> None:
    """What stands in the study bars the way; but with its door shut, no look at it shows a way."""
    bench = Bench(plain_robot())
    bench.believe(Pose2(4.5, 2.0, 0.0))
    bench.pursue(Place(STUDY, 3.0, 2.0))
    thing = bench.stand(8.4, 2.0, 0.1, 1.5)
    if is_shut:
        for frame in (bench.frame(HALL), bench.frame(STUDY)):
            bench.apply(Revise(frame, frame.value.changed(FrameChange("shut", "study-door", "")), ()))
    effects = bench.ask(SOURCE, bench.put(Impasse("blocked", "no way", "Goal-1", (thing.id,))))
    assert (effects is None) is is_shut


def test_no_lookout_is_gone_to_a_third_time() -> None:
    bench, impasse = stuck()
    places = list[tuple[float, ...]]()
    while (effects := bench.ask(SOURCE, impasse)) is not None:
        places.append(effect_on(effects, Impasse).value.lookout)
        bench.apply(*effects)
        bench.revise(bench.view.latest(PlanSketch), status="done")  # type: ignore[arg-type]
        impasse = bench.put(replace(impasse.value, is_open=True))
    assert len(places) >= 3  # it looks from others
    assert all(sum(math.dist(one, other) < MIN_LOOKOUT_CHANGE_M for other in places[:k]) < 2
               for k, one in enumerate(places))


def see_door(bench: Bench, log_odds: float, state: DoorCondition, seen_from: tuple[float, float], *,
             has_views: bool = True) -> Entry[DoorState]:
    """What is believed of the study's door, by a picture from there; that of a refuted milestone is no view."""
    at = to_world(Pose2(*seen_from, 0.0))
    picture = DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), at.x_m, at.y_m, 0.0, 4.5, "a leaf")
    return bench.put(DoorState("study-door", (HALL, STUDY), state, 0.6, log_odds, 1, picture, 1.0, -4.0,
                               (picture,) * has_views))


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("log_odds", "state", "is_looked_at"), [
    (0.1, "unknown", True), (-0.1, "unknown", False), (5.0, "shut", False), (-5.0, "open", False)])
def test_a_door_that_may_be_shut_is_looked_at_from_the_front_before_it_ends(
    log_odds: float, state: DoorCondition, is_looked_at: bool, side: float
) -> None:
    """From elsewhere than it was seen from, to either side; a thing is looked at where no door is in doubt."""
    bench = Bench(plain_robot())
    bench.believe(Pose2(5.5, 2.0 + 0.5 * side, 0.0))
    goal, before = bench.pursue(Place(STUDY, 3.0, 2.0)), (6.4, 2.0 + 0.2 * side)
    thing = bench.stand(7.5, 2.0, 0.1, 0.4)
    door = see_door(bench, log_odds, state, before)
    effects = bench.ask(SOURCE, bench.put(Impasse("blocked", "no way", goal.id, (thing.id,))))
    named = set() if effects is None else reasons(effect_on(effects, PlanSketch))
    assert (door.id in named) is is_looked_at and not {door.id, thing.id} <= named
    if is_looked_at:
        (step,) = effect_on(effects, PlanSketch).value.subgoals
        there, middle = step.destination, (LENGTH_M, 0.5 * WIDTH_M)
        away = (middle[0] - there.x_m, middle[1] - there.y_m)
        assert there.heading_rad == pytest.approx(math.atan2(away[1], away[0]), abs=0.05)
        assert away[0] >= (MIN_DOOR_LOOK_SINE - 0.02) * math.hypot(*away)
        assert math.hypot(there.x_m - before[0], there.y_m - before[1]) >= DOOR_LOOK_APART_M - 1e-6


@pytest.mark.parametrize("has_views", [True, False])
def test_it_is_looked_at_from_elsewhere_than_it_was_seen_from_last(has_views: bool) -> None:
    """Also where the only picture of it is that of a refuted milestone: it would go there again."""
    before = (1.0, 0.5)
    for _ in range(3):
        bench = Bench(plain_robot())
        bench.believe(Pose2(5.5, 2.0, 0.0))
        goal, thing = bench.pursue(Place(STUDY, 3.0, 2.0)), bench.stand(7.5, 2.0, 0.1, 0.4)
        see_door(bench, 0.1, "unknown", before, has_views=has_views)
        effects = bench.ask(SOURCE, bench.put(Impasse("blocked", "no way", goal.id, (thing.id,))))
        there = effect_on(effects, PlanSketch).value.subgoals[0].destination
        assert math.dist((there.x_m, there.y_m), before) >= DOOR_LOOK_APART_M - 1e-6
        before = there.x_m, there.y_m


def test_a_door_that_was_seen_from_everywhere_is_not_looked_at_again() -> None:
    bench = Bench(plain_robot())
    bench.believe(Pose2(5.5, 2.0, 0.0))
    goal, thing = bench.pursue(Place(STUDY, 3.0, 2.0)), bench.stand(7.5, 2.0, 0.1, 0.4)
    door = see_door(bench, 0.5, "unknown", (6.4, 2.0))
    places = [to_world(Pose2(5.0 + 0.5 * i, 0.5 * k, 0.0)) for i in range(6) for k in range(9)]
    pictures = tuple(replace(door.value.last, x_m=at.x_m, y_m=at.y_m) for at in places)
    door = bench.revise(door, views=pictures)
    effects = bench.ask(SOURCE, bench.put(Impasse("blocked", "no way", goal.id, (thing.id,))))
    assert effects is None or door.id not in reasons(effect_on(effects, PlanSketch))


def test_it_keeps_the_laws_of_all_sources() -> None:
    check_source(SOURCE, *stuck(), without=("Goal-1", "Obstacle-1"))
