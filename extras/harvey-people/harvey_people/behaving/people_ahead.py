"""People ahead: what the board tells of people on the way of a leg, and how the next move leads by them; pure reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import shapely

from blackboard import Entry, View
from harvey_people.behaving.passing import UNMOVED_LOG_ODDS, PassingWay, find_way
from harvey_people.behaving.people_entries import PeoplePass, PeopleWait
from harvey_people.seeing.mover import Mover
from knowledge_sources.methods.floor import find_floor
from knowledge_sources.reads import HELD, Belief, current_leg
from knowledge_sources.settings import Settings
from world_models.entries import Leg

BORNE_M_PER_S = 0.05
"""Speed at which a certain touch of somebody is borne; that of a thing is borne at the speed of creeping, if slower."""
WALL_GAP_M = 0.1
"""So much room the robot keeps from walls, when it goes aside."""


class PeopleAhead(NamedTuple):
    """A leg under way, who may be in it, and how the next move leads; ``way`` is None where nobody is met."""

    leg: Entry[Leg]
    belief: Belief
    movers: tuple[Entry[Mover], ...]
    way: PassingWay | None
    now_s: float

    @property
    def because(self) -> tuple[Entry[Leg] | Entry[Mover], ...]:
        """What it rests on, besides the belief."""
        return (self.leg, *self.movers)


def look_ahead(view: View, settings: Settings, seen_as: Callable[[Mover], Mover] | None = None) -> PeopleAhead | None:
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
    known = [entry.value for entry in movers]
    people = [*(known if seen_as is None else map(seen_as, known)), *map(as_standing, filter(_is_no_thing, known))]
    before = view.latest(PeoplePass, lambda one: one.leg == leg.id)
    kept_m = 0.0 if before is None else before.value.aside_m
    return PeopleAhead(leg, belief, movers, _find_way(people, leg.value, belief, now_s, settings, kept_m), now_s)


def as_standing(mover: Mover) -> Mover:
    """Somebody in case that one stands, with the probability of that."""
    sigma2 = mover.stood_sigma_m**2
    rows = tuple(tuple((sigma2 if i < 2 else 1e-6) * (i == j) for j in range(4)) for i in range(4))
    return replace(mover, x_m=mover.stood_x_m, y_m=mover.stood_y_m, vx_m_per_s=0.0, vy_m_per_s=0.0, covariance=rows,
                   log_odds=-mover.log_odds)


def _is_no_thing(mover: Mover) -> bool:
    """Whether somebody is no thing in the way yet, but may stand."""
    return mover.may_go_on and abs(mover.log_odds) < -UNMOVED_LOG_ODDS


def _find_way(people: Sequence[Mover], leg: Leg, belief: Belief, now_s: float, settings: Settings, kept_m: float,
              ) -> PassingWay | None:
    robot, here = belief.robot, belief.pose

    def has_room(aim: tuple[float, float]) -> bool:
        path, floor = shapely.LineString([here.position, aim]), find_floor(robot.world, (belief.locale,))
        return bool(shapely.distance(path, shapely.boundary(floor)) >= robot.radius_m + WALL_GAP_M)

    borne = min(BORNE_M_PER_S, settings.action.creep_speed_m_per_s)
    return find_way(people, leg, here, robot.radius_m, robot.actuator, now_s, borne, has_room, kept_m)


def find_wait(view: View) -> Entry[PeopleWait] | None:
    """The wait that is not over."""
    return view.latest(PeopleWait, lambda wait: wait.status == "waiting")
