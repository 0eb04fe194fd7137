"""Laws of the elevator rider: it asks for the ride that is next, once, and only while nothing above it is in doubt."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry
from generated_boards import Bench, all_reasons, effect_on
from harvey.testing import check_source
from knowledge_sources.action.elevator_rider import elevator_rider
from world_models.entries import Place, PlanSketch, Ride, Subgoal

BELOW, ABOVE, FAR = Place("car-1", 1.0, 1.0), Place("car-2", 1.0, 1.0), Place("car-3", 0.0, 0.0)
UP, ON = Subgoal(BELOW, ABOVE, primitive=False, passage="lift"), Subgoal(ABOVE, FAR, primitive=False, passage="lift")
WALK = Subgoal(Place("hall", 0.0, 0.0), BELOW, primitive=True)
THROUGH = replace(WALK, passage="door")
ACROSS = Subgoal(Place("hall", 0.0, 0.0), BELOW, primitive=False)


def on_the_way(*rides: Subgoal, index: int) -> tuple[Bench, Entry[PlanSketch]]:
    """A board with a sketch of rides, of which so many are over."""
    bench = Bench()
    bench.believe()
    goal = bench.pursue(FAR)
    return bench, bench.put(PlanSketch(goal.id, (), "", rides, index, True), goal)


@settings(max_examples=60)
@given(st.sampled_from((UP, WALK, THROUGH, ACROSS)), st.booleans(),
       st.sampled_from((None, ("PlanSketch-1", 1), ("PlanSketch-1", 0), ("PlanSketch-9", 1))))
def test_it_asks_for_the_next_subgoal_where_that_is_a_ride_and_was_not_asked_for(
    step: Subgoal, verified: bool, asked: tuple[str, int] | None
) -> None:
    bench = Bench()
    belief, goal = bench.believe(), bench.pursue(FAR)
    sketch = bench.put(PlanSketch(goal.id, (), "", (WALK, step, ON), 1, verified), goal)
    if asked is not None:
        bench.put(Ride(*asked, "lift", "car-1", "car-2"))
    effects = bench.ask(elevator_rider, sketch)
    assert (effects is not None) == (step is UP and verified and asked != ("PlanSketch-1", 1))
    if effects is not None:
        (effect,) = effects
        assert effect.value == Ride(sketch.id, 1, "lift", "car-1", "car-2")
        assert all_reasons(effects) == {sketch.id, belief.id}


def test_at_the_end_of_a_sketch_there_is_no_ride() -> None:
    bench, sketch = on_the_way(UP, index=1)
    assert bench.ask(elevator_rider, sketch) is None


def test_the_second_ride_is_from_where_the_first_one_ended() -> None:
    bench, sketch = on_the_way(UP, ON, index=1)
    bench.put(Ride(sketch.id, 0, "lift", "car-1", "car-2"))
    ride = effect_on(bench.ask(elevator_rider, sketch), Ride).value
    assert (ride.index, ride.origin, ride.destination) == (1, "car-2", "car-3")


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench, sketch = on_the_way(UP, index=0)
    check_source(elevator_rider, bench, sketch, without=(sketch.value.goal,))
