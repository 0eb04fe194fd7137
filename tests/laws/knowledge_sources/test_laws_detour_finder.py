"""Laws of the detour finder: a halted leg ends its sketches while another way may lead on, so many times."""

from __future__ import annotations

from dataclasses import replace

import pytest

from blackboard import Entry, Revise
from generated_boards import Bench, effect_on, made, to_world
from harvey.testing import HALL, STUDY, check_source, plain_robot
from knowledge_sources.reads.sketches import MAX_ADJUSTMENTS
from knowledge_sources.settings import DEFAULT
from knowledge_sources.sketcher.detour_finder import DetourFinder
from world_models.entries import DoorPicture, DoorState, Impasse, Leg, Place, PlanSketch
from world_models.frames import Pose2

SOURCE = DetourFinder()
FROM, TO = Place(HALL, 1.0, 2.0), Place(HALL, 6.0, 2.0)
MOST = MAX_ADJUSTMENTS
PICTURE = DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), 90.0, 90.0, 0.0, 4.5, "a leaf")


def halt(halts: int = 0, aim: Place = TO) -> tuple[Bench, Entry[Leg]]:
    """A board on which a leg across the hall was halted, after so many in a row."""
    bench = Bench(plain_robot())
    bench.believe(Pose2(1.5, 2.0, 0.0))
    goal = bench.pursue(aim)
    bench.revise(bench.sketch(FROM, TO, goal=goal, primitive=False), halts=halts)
    below = bench.sketch(FROM, TO, goal=goal, path=(0,))
    return bench, bench.revise(bench.leg(below), status="halted")


@pytest.mark.parametrize("halts", [0, MOST - 1, MOST])
def test_so_many_times_in_a_row_all_sketches_end_and_then_it_sees_no_way_on(halts: int) -> None:
    bench, leg = halt(halts)
    effects = bench.ask(SOURCE, leg)
    assert effects is not None
    ended = made(effects, PlanSketch)
    if halts < MOST:
        assert [(s.path, s.status, s.halts) for s in ended] == [((), "halted", halts), ((0,), "halted", 0)]
        assert all({r.id for r in e.because} == {leg.id} for e in effects)  # type: ignore[union-attr]
        bench.apply(*effects)
        assert bench.ask(SOURCE, leg) is None
    else:
        effect = effect_on(effects, Impasse)
        assert not ended and (effect.value.kind, effect.value.goal, effect.value.behind) == ("blocked", "Goal-1", ())
        assert {r.id for r in effect.because} == {leg.id, "Hypothesis-1"}


def test_it_sees_no_way_on_where_none_leads_round_all_that_may_stand_there() -> None:
    bench, leg = halt(aim=Place(STUDY, 3.0, 2.0))
    thing = bench.stand(4.1, 2.0, 0.2, 1.95)
    effect = effect_on(bench.ask(SOURCE, leg), Impasse)
    assert effect.value.behind == (thing.id,) and thing.value.words() in effect.value.reason
    assert {r.id for r in effect.because} == {leg.id, "Hypothesis-1", thing.id}


@pytest.mark.parametrize(("is_seen", "looked", "asks"), [
    (False, 0, True), (False, DEFAULT.plan.max_lookouts, False), (True, 0, False)])
def test_a_door_that_may_be_shut_is_looked_at_from_elsewhere_where_that_tells_more(
    is_seen: bool, looked: int, asks: bool
) -> None:
    bench, leg = halt()
    views = tuple(replace(PICTURE, x_m=x, y_m=y) for x, y in (
        to_world(Pose2(0.7 * i + 0.3, 0.7 * k, 0.0)).position for i in range(11) for k in range(6)) if is_seen)
    door = bench.put(DoorState("study-door", (HALL, STUDY), "unknown", 0.6, 0.5, 1, PICTURE, 1.0, views=views))
    for _ in range(looked):
        bench.put(Impasse("blocked", "", "Goal-1", is_open=False, lookout=(0.0, 0.0)))
    (leg,) = (change.entry for change in bench.apply(Revise(leg, replace(leg.value, increments=1), (leg, door))))
    effects = bench.ask(SOURCE, leg)
    assert [found.behind for found in made(effects, Impasse)] == [(door.id,)] * asks
    assert bool(made(effects, PlanSketch)) != asks


@pytest.mark.parametrize("stale", ["index", "sketch ended", "first level ended", "goal", "belief"])
def test_a_leg_of_a_plan_that_is_over_halts_nothing(stale: str) -> None:
    bench, leg = halt()
    if stale == "index":
        bench.revise(bench.view["PlanSketch-2"], at=1)
    elif stale == "sketch ended":
        bench.revise(bench.view["PlanSketch-2"], status="superseded")
    elif stale == "first level ended":
        bench.revise(bench.view["PlanSketch-1"], status="superseded")
    elif stale == "goal":
        bench.revise(bench.view["Goal-1"], status="reached")
    else:
        bench.revise(bench.view["Hypothesis-1"], status="candidate")
    assert bench.ask(SOURCE, leg) is None


def test_it_keeps_the_laws_of_all_sources() -> None:
    check_source(SOURCE, *halt(), without=("PlanSketch-2",))
