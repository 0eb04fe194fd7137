"""People waiter: the robot stands and looks again while somebody may come into its way; not for ever."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from harvey_people.meeting import may_go, measure_meeting
from harvey_people.mover import Mover
from harvey_people.wait_entry import PeopleWait
from knowledge_sources.methods.motion import find_aim
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOAL, GOING_ON, HELD, NO_MILESTONE, SOUND, STANDING, SURE, Belief, current_leg
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Goal, Impasse, Leg, PictureRequest

MAX_WAIT_S = 60.0  # a way on which people are for so long is blocked
LOOKAHEAD_M = 1.2  # the motor steers at a point of the leg so far ahead


class Case(NamedTuple):
    """A leg under way, whom its next move may meet, and the wait so far; ``meets`` is None where it may go on."""

    leg: Entry[Leg]
    belief: Belief
    movers: tuple[Entry[Mover], ...]
    meets: PeopleWait | None
    wait: Entry[PeopleWait] | None


class PeopleWaiter(RobotKnowledgeSource):
    """Comes before the motor while the next move may meet somebody: it waits, and looks where they go.

    How probably they are met follows from their predicted places, with the doubt of these, on the robot's disc as it
    moves; how much of that is borne, from the core's formula of harm with a speed that is borne towards people. What is
    seen for the first time may walk, so it is looked at again. After a minute the way is blocked by people.
    """

    level, priority = Level.ACTION, Priority.STEER  # before the wheels turn
    on = (Watch(Mover), Watch(Leg, (Posted, Revised), lambda leg: leg.status == "moving"))
    needs = (GOING_ON, HELD, SOUND, STANDING, SURE, NO_MILESTONE, GOAL)
    writes = (PeopleWait, PictureRequest, Impasse)

    def bind(self, view: View, trigger: Change) -> Case | None:
        driving, movers = current_leg(view), tuple(view.where(Mover, lambda mover: mover.status != "gone"))
        if driving is None:
            return None
        wait = view.latest(PeopleWait, lambda one: one.status == "waiting")
        belief = HELD.of(view)
        meets = _find_meeting(belief, driving[0], [entry.value for entry in movers])
        return Case(driving[0], belief, movers, meets, wait) if meets is not None or wait is not None else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        leg, belief, movers, meets, wait = case
        because = (leg, belief.entry, *movers, *(() if wait is None else (wait,)))
        if meets is None:
            assert wait is not None
            now_s = max((entry.value.at_s for entry in movers), default=wait.value.at_s)
            yield Revise(wait, replace(wait.value, status="over", at_s=now_s), because)
            return
        if wait is None:
            yield Post(meets, because)
            yield Post(PictureRequest("people"), because)
            return
        longer = replace(meets, since_s=wait.value.since_s, looks=wait.value.looks + 1)
        if longer.at_s - longer.since_s <= MAX_WAIT_S:
            yield Revise(wait, longer, because)
            yield Post(PictureRequest("people"), because)
            return
        goal: Entry[Goal] = GOAL.of(view)
        yield Revise(wait, replace(longer, status="in vain"), because)
        yield Post(Impasse("blocked", f"blocked by people: {longer.where}, for {MAX_WAIT_S:.0f} s", goal.id),
                   (*because, goal))


def _find_meeting(belief: Belief, leg: Entry[Leg], movers: list[Mover]) -> PeopleWait | None:
    """Whom the next move would meet too probably; None where it may go."""
    if not movers:
        return None
    actuator, here, now_s = belief.robot.actuator, belief.pose, max(mover.at_s for mover in movers)
    x, y = find_aim(leg.value, here, LOOKAHEAD_M)
    heading_rad = math.atan2(y - here.y_m, x - here.x_m)
    move_m = min(actuator.increment_m, math.dist((x, y), here.position))
    clearance, each = measure_meeting(movers, here, heading_rad, move_m, belief.robot.radius_m,
                                      actuator.speed_m_per_s, now_s)
    if may_go(clearance, move_m, actuator):
        return None
    p, likeliest = max(zip(each, movers, strict=True), key=lambda one: one[0])
    return PeopleWait(leg.id, likeliest.name, likeliest.words(), p, now_s, now_s)
