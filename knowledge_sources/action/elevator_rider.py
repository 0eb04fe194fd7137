"""Elevator rider (§4, Figure 8): the robot asks for a ride between floors, as it cannot drive there."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Post, Posted, Revised, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOING_ON, HELD, NO_DOUBT_ABOVE, SKETCH, SOUND, STANDING
from world_models.entries import BodyFault, PlanSketch, Ride, Subgoal


def find_ride(view: View, _trigger: Change) -> tuple[Subgoal, Entry[PlanSketch]] | None:
    """A ride that is the next subgoal, and was not asked for; and the sketch that has it."""
    sketch = SKETCH.of(view)
    s, ride = sketch.value, sketch.value.current
    if not s.verified or ride is None or not ride.is_ride:
        return None
    asked = view.latest(Ride, lambda r: r.sketch == sketch.id and r.index == s.at)
    return (ride, sketch) if asked is None else None


@rule(on=(Watch(PlanSketch, (Posted, Revised), lambda s: s.is_active and s.verified), Watch(BodyFault, (Revised,))),
      writes=Ride, needs=(GOING_ON, HELD, SKETCH, STANDING, SOUND, NO_DOUBT_ABOVE), bind=find_ride,
      priority=Priority.MOVE)
def elevator_rider(view: View, case: tuple[Subgoal, Entry[PlanSketch]]) -> Iterable[Effect]:
    """Asks for the ride that a verified sketch needs, once nothing is in doubt."""
    ride, sketch = case
    here, there = ride.origin.locale, ride.destination.locale
    yield Post(Ride(sketch.id, sketch.value.at, ride.passage, here, there), (sketch, HELD.of(view).entry))
