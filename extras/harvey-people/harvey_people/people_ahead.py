"""People ahead: what the board tells of people on the way of a leg, and how the next move leads by them; pure reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import shapely

from blackboard import Entry, View
from harvey_people.mover import Mover
from harvey_people.passing import Way, find_way
from harvey_people.people_entries import PeoplePass, PeopleWait
from knowledge_sources.methods.floor import find_floor
from knowledge_sources.reads import HELD, Belief, current_leg
from knowledge_sources.settings import Settings
from world_models.entries import Leg

WALL_GAP_M = 0.1
"""So much room the robot keeps from walls, when it goes aside."""


class Ahead(NamedTuple):
    """A leg under way, who may be in it, and how the next move leads; ``way`` is None where nobody is met."""

    leg: Entry[Leg]
    belief: Belief
    movers: tuple[Entry[Mover], ...]
    way: Way | None
    now_s: float

    @property
    def because(self) -> tuple[Entry[Leg] | Entry[Mover], ...]:
        """What it rests on, besides the belief."""
        return (self.leg, *self.movers)


def look_ahead(view: View, settings: Settings, seen_as: Callable[[Mover], Mover] | None = None) -> Ahead | None:
    """What is ahead of the leg under way; None where none is.

    Args:
        seen_as: how a mover is taken, where not as it is.
    """
    driving = current_leg(view)
    if driving is None:
        return None
    belief, leg = HELD.of(view), driving[0]
    movers = tuple(view.where(Mover, lambda mover: mover.status != "gone"))
    now_s = max((entry.value.at_s for entry in movers), default=0.0)
    people = [entry.value if seen_as is None else seen_as(entry.value) for entry in movers]
    before = view.latest(PeoplePass, lambda one: one.leg == leg.id)
    kept_m = 0.0 if before is None else before.value.aside_m
    return Ahead(leg, belief, movers, _find_way(people, leg.value, belief, now_s, settings, kept_m), now_s)


def _find_way(people: Sequence[Mover], leg: Leg, belief: Belief, now_s: float, settings: Settings, kept_m: float,
              ) -> Way | None:
    robot, here = belief.robot, belief.pose

    def has_room(aim: tuple[float, float]) -> bool:
        path, floor = shapely.LineString([here.position, aim]), find_floor(robot.world, (belief.locale,))
        return bool(shapely.distance(path, shapely.boundary(floor)) >= robot.radius_m + WALL_GAP_M)

    borne = settings.action.creep_speed_m_per_s
    return find_way(people, leg, here, robot.radius_m, robot.actuator, now_s, borne, has_room, kept_m)


def find_wait(view: View) -> Entry[PeopleWait] | None:
    """The wait that is not over."""
    return view.latest(PeopleWait, lambda wait: wait.status == "waiting")
