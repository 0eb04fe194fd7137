"""Elevator rider (§4, Figure 8): the robot asks for a ride between floors, as it cannot drive there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revised, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOING_ON, HELD, NO_DOUBT_ABOVE, SKETCH, SOUND, STANDING, Belief
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import BodyFault, PlanSketch, Ride, Subgoal


class Case(NamedTuple):
    """The ride that comes next, the sketch that has it, and where the robot is."""

    ride: Subgoal
    sketch: Entry[PlanSketch]
    belief: Belief


class ElevatorRider(RobotKnowledgeSource):
    """Asks for the ride that a verified sketch needs, once nothing is in doubt."""

    level, priority = Level.ACTION, Priority.MOVE
    on = (
        Watch(PlanSketch, (Posted, Revised), lambda s: s.is_active and s.verified),
        Watch(BodyFault, (Revised,)),
    )
    needs = (GOING_ON, HELD, SKETCH, STANDING, SOUND, NO_DOUBT_ABOVE)
    writes = (Ride,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """A ride that is the next subgoal, and was not asked for."""
        sketch = SKETCH.of(view)
        s, ride = sketch.value, sketch.value.current
        if not s.verified or ride is None or not ride.is_ride:
            return None
        asked = view.latest(Ride, lambda r: r.sketch == sketch.id and r.index == s.at)
        return Case(ride, sketch, HELD.of(view)) if asked is None else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        ride, sketch, belief = case
        here, there = ride.origin.locale, ride.destination.locale
        yield Post(Ride(sketch.id, sketch.value.at, ride.passage, here, there), (sketch, belief.entry))
