"""People waiter: the robot stands and looks again while somebody may come into its way; not for ever."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from harvey_people.behaving.people_ahead import PeopleAhead, find_wait, look_ahead
from harvey_people.behaving.people_entries import PeopleWait
from harvey_people.seeing.mover import Mover
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOAL, GOING_ON, HELD, NO_MILESTONE, SOUND, STANDING, SURE
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Goal, Impasse, Leg, PictureRequest

MAX_WAIT_S = 60.0  # a way on which people are for so long is blocked


class Case(NamedTuple):
    """What is ahead, whether it is waited for, and the wait so far."""

    ahead: PeopleAhead
    is_met: bool
    wait: Entry[PeopleWait] | None


class PeopleWaiter(RobotKnowledgeSource):
    """Comes before the motor while every way on would meet somebody too probably: it waits, and looks where they go.

    How much is borne follows from the core's formula of harm, with the predicted places of people and their doubt. What
    is seen for the first time may walk, so it is looked at again. After a minute the way is blocked by people.
    """

    level, priority = Level.ACTION, Priority.STEER  # before the wheels turn
    on = (Watch(Mover), Watch(Leg, (Posted, Revised), lambda leg: leg.status == "moving"))
    needs = (GOING_ON, HELD, SOUND, STANDING, SURE, NO_MILESTONE, GOAL)
    writes = (PeopleWait, PictureRequest, Impasse)

    def bind(self, view: View, trigger: Change) -> Case | None:
        ahead, wait = self.look(view), find_wait(view)
        if ahead is None:
            return None
        is_met = ahead.way is not None and ahead.way.speed_m_per_s == 0.0
        return Case(ahead, is_met, wait) if is_met or wait is not None else None

    def look(self, view: View) -> PeopleAhead | None:
        """What is ahead of the leg."""
        return look_ahead(view, self._settings)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        ahead, is_met, wait = case
        because = (*ahead.because, ahead.belief.entry, *(() if wait is None else (wait,)))
        if wait is not None and not is_met:
            now_s = max(ahead.now_s, wait.value.at_s)
            yield Revise(wait, replace(wait.value, status="over", at_s=now_s), because)
            return
        assert ahead.way is not None
        meets = PeopleWait(ahead.leg.id, ahead.way.who.name, ahead.way.who.words(), ahead.way.p, ahead.now_s,
                           ahead.now_s)
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
