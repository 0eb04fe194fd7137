"""Laws of the sources: what wakes them, what they rest on, and when they say nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from blackboard import Entry, Post, Revise
from generated_boards import Bench, to_world
from harvey.testing import HALL, check_source, plain_robot
from harvey_people.behaving.people_entries import PeoplePass, PeopleWait
from harvey_people.behaving.people_passer import PeoplePasser
from harvey_people.behaving.people_waiter import MAX_WAIT_S, PeopleWaiter
from harvey_people.seeing.mover import Mover
from harvey_people.seeing.mover_explainer import MoverExplainer
from harvey_people.seeing.mover_watcher import MoverWatcher
from world_models.entries import Evidence, FloorThing, FreeFloor, Impasse, MotorCommand, Obstacle, PictureRequest, Place
from world_models.frames import Pose2

NOW_S = 10.0
EYE4 = tuple(tuple(0.04 if i == j else 0.0 for j in range(4)) for i in range(4))


def in_hall(mover: Mover) -> Mover:
    """One whose place and velocity are in the hall's frame, as of the world."""
    there, way = to_world(Pose2(mover.x_m, mover.y_m, 0.0)), to_world(Pose2(0.0, 0.0, 0.0)).heading_rad
    c, s, (vx, vy) = math.cos(way), math.sin(way), mover.state[2:]
    return replace(mover, x_m=there.x_m, y_m=there.y_m, vx_m_per_s=c * vx - s * vy, vy_m_per_s=s * vx + c * vy)


COMES = Mover("mover-1", HALL, 3.2, 2.0, -1.0, 0.0, EYE4, 3.2, 2.0, 0.2, 6.0, NOW_S, NOW_S, 5, "a law", "moves")
ABREAST = [replace(COMES, name=f"mover-{n}", x_m=2.65, y_m=y, vx_m_per_s=-0.2)
           for n, y in enumerate((2.0, 1.7, 2.3, 1.4, 2.6, 1.1, 2.9), 1)]


def square(x: float, y: float, half: float = 0.15) -> tuple[tuple[float, float], ...]:
    return ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))


def picture_of(x: float, y: float, at_s: float = NOW_S) -> FreeFloor:
    """A sight of the floor in which something stands there."""
    thing = FloorThing(square(x, y), 0.05, 1.0, math.inf, 0.9, (0.0, 0.0, 9.0, 9.0), "a law")
    return FreeFloor("camera", HALL, 2.0, 2.0, (0.0,), (0.5,), (x - 2.2,), ("thing",), (0.05,), (thing,), at_s)


def thing(x: float = 3.2, y: float = 2.0, seen_s: float = NOW_S) -> Obstacle:
    return Obstacle("hall/obstacle-1", HALL, square(x, y), 0.05, x, y, 0.3, certainty=0.9, seen_s=seen_s, by="camera",
                    status="suspected")


def on_a_leg(*values: Any) -> tuple[Bench, list[Entry[Any]]]:
    """A robot that drives along the hall, and what else is on the board."""
    bench = Bench(plain_robot())
    bench.believe(Pose2(2.0, 2.0, 0.0))
    sketch = bench.sketch(Place(HALL, 2.0, 2.0), Place(HALL, 5.0, 2.0))
    sketch = bench.revise(sketch, verified=True)
    bench.leg(sketch)
    return bench, [bench.put(value) for value in values]


def test_the_mover_watcher_keeps_the_laws_and_follows_from_sight_to_sight() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    known: Entry[Any] | None = None
    left: list[float] = []
    for number, x in enumerate((4.0, 3.6, 3.2, 2.8, 2.4)):
        scan = bench.put(picture_of(x, 2.0, NOW_S + 0.4 * number))
        effect, seen = check_source(MoverWatcher, bench, scan)
        left.append(seen.value.things[0].p_thing)
        assert isinstance(effect, Post if known is None else Revise)
        known = bench.apply(effect)[0].entry
    assert known is not None and known.value.is_moving and known.value.vx_m_per_s < -0.5
    assert left[0] == pytest.approx(0.45) and left[-1] < 0.05, "what walks is no thing"
    assert "walking at" in known.value.sentence()
    empty = bench.put(replace(picture_of(2.0, 2.0, NOW_S + 9.0), things=()))
    (effect,) = check_source(MoverWatcher, bench, empty)
    assert isinstance(effect, Revise) and effect.value.status == "gone"
    bench.apply(effect)
    assert bench.ask(MoverWatcher(), bench.put(replace(empty.value, seen_s=NOW_S + 9.1))) is None


def test_the_mover_explainer_keeps_the_laws_and_a_thing_is_as_certain_as_it_leaves_it() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.put(COMES)
    seen = bench.put(thing(3.4, 2.0, NOW_S - 0.2))
    told, judged = check_source(MoverExplainer, bench, seen)
    assert isinstance(told.value, Evidence) and [e.kind for e in told.value.explanations] == ["mover"]
    assert judged.value.status == "gone" and judged.value.certainty < 0.5


@pytest.mark.parametrize(("mover", "seen"), [
    (replace(COMES, log_odds=-0.1), thing(3.4, 2.0, NOW_S - 0.2)),             # who rather stands explains nothing
    (replace(COMES, vx_m_per_s=-0.1), thing(3.2, 2.0, NOW_S - 0.2)),           # nor who has come to stand
    (COMES, thing(3.2, 4.0, NOW_S - 0.2)),                                     # was not there
    (COMES, thing(3.2, 2.0, NOW_S - 2.0)),                                     # not then: was two metres on
    (COMES, thing()),                                                          # this sight was weighed by the watcher
    (COMES, replace(thing(3.4, 2.0, NOW_S - 0.2), touched_s=NOW_S)),           # what was touched is there
])
def test_who_was_not_there_explains_nothing(mover: Mover, seen: Obstacle) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.put(mover)
    assert bench.ask(MoverExplainer(), bench.put(seen)) is None


def test_the_people_waiter_keeps_the_laws_waits_looks_and_goes_on() -> None:
    bench, (mover, *others) = on_a_leg(*map(in_hall, ABREAST))
    wait, look = check_source(PeopleWaiter, bench, mover)
    assert isinstance(wait.value, PeopleWait) and wait.value.who == "mover-1" and wait.value.p > 0.1
    assert look.value == PictureRequest("people")
    assert "waits for mover-1" in wait.value.sentence()
    began = bench.apply(wait)[0].entry
    again, _ = check_source(PeopleWaiter, bench, bench.revise(mover, at_s=NOW_S + 0.2, seen_s=NOW_S + 0.2))
    assert isinstance(again, Revise) and again.value.looks == 1 and again.value.since_s == began.value.since_s
    bench.apply(again)
    for other in others:
        bench.revise(other, status="gone")
    (over,) = check_source(PeopleWaiter, bench, bench.revise(mover, status="gone"))
    assert isinstance(over, Revise) and over.value.status == "over" and "goes on" in over.value.sentence()


def test_a_way_that_stays_blocked_ends_as_blocked_by_people() -> None:
    long_ago_s = NOW_S - MAX_WAIT_S - 1.0
    wait = PeopleWait("Leg-1", "mover-1", "somebody", 0.5, long_ago_s, NOW_S)
    bench, (mover, *_) = on_a_leg(*map(in_hall, ABREAST), wait)
    vain, end = check_source(PeopleWaiter, bench, mover)
    assert vain.value.status == "in vain" and "in vain" in vain.value.sentence()
    assert isinstance(end.value, Impasse) and end.value.kind == "blocked"
    assert end.value.reason.startswith("blocked by people: somebody at")


def test_the_people_passer_keeps_the_laws_and_leads_by_them_beside_the_line_or_slower() -> None:
    bench, (mover,) = on_a_leg(in_hall(COMES))
    done = check_source(PeoplePasser, bench, mover)
    passing, command = (next(e.value for e in done if isinstance(e.value, kind)) for kind in (PeoplePass, MotorCommand))
    assert passing.who == "mover-1" and "passes mover-1" in passing.sentence()
    assert command.move_m == 0.0 or command.speed_m_per_s <= passing.speed_m_per_s
    assert passing.aside_m != 0.0 or passing.speed_m_per_s < 0.6
    assert bench.ask(PeopleWaiter(), mover) is None, "one of them acts"
    bench.put(PeopleWait("Leg-1", "mover-1", "somebody", 0.5, NOW_S, NOW_S))
    assert bench.ask(PeoplePasser(), mover) is None, "who waits ends that first"


@pytest.mark.parametrize("mover", [
    replace(COMES, vx_m_per_s=1.2),                      # walks away
    replace(COMES, x_m=3.2, log_odds=-7.0, vx_m_per_s=0.0, status="may move"),  # it stands: a thing's matter
    replace(COMES, y_m=9.0),                             # far off
])
def test_it_does_not_wait_for_whom_it_does_not_meet(mover: Mover) -> None:
    bench, (entry,) = on_a_leg(replace(in_hall(mover), covariance=tuple(
        tuple(0.01 if i == j else 0.0 for j in range(4)) for i in range(4))))
    assert bench.ask(PeopleWaiter(), entry) is None and bench.ask(PeoplePasser(), entry) is None
