"""People passer: the next increment leads by somebody, slower or beside the line of the leg, on the right rather."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from harvey_people.behaving.passing import LOOKAHEAD_M
from harvey_people.behaving.people_ahead import PeopleAhead, find_wait, look_ahead
from harvey_people.behaving.people_entries import PeoplePass, PeopleWait
from harvey_people.seeing.mover import Mover
from knowledge_sources.methods.motion import count_increment, find_aim, plan_increment, update_leg
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOING_ON, HELD, NO_MILESTONE, SOUND, STANDING, SURE, FloorAhead
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Drift, Leg, MotorCommand
from world_models.entries.discrepancy import Discrepancy, correct

MOVE_S = 1.0  # a slow move ends so soon: then it is decided anew
MIN_MOVE_M = 0.05


class Case(NamedTuple):
    """What is ahead, the increment that leads by it, and the floor that this rests on."""

    ahead: PeopleAhead
    command: MotorCommand
    floor: tuple[Entry[Any], ...]


class PeoplePasser(RobotKnowledgeSource):
    """Comes before the motor where straight on at full speed somebody is met too probably, and another way is borne.

    It decides the increment as the motor does, on a line beside that of the leg, or slower; over floor that is seen to
    be free, as the motor. Where nobody is met any longer, the motor leads back to the line.
    """

    level, priority = Level.ACTION, Priority.STEER  # before the motor
    on = (Watch(Mover), Watch(Leg, (Posted, Revised), lambda leg: leg.status == "moving"),
          Watch(PeopleWait, (Revised,), lambda wait: wait.status == "over"))
    needs = (GOING_ON, HELD, SOUND, STANDING, SURE, NO_MILESTONE)
    writes = (MotorCommand, Leg, Discrepancy, PeoplePass)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """An increment that leads by somebody; None where the motor may go on, or has to wait."""
        ahead = self.look(view)
        if ahead is None or ahead.way is None or ahead.way.speed_m_per_s == 0.0 or find_wait(view) is not None:
            return None
        way, belief, here, drift = ahead.way, ahead.belief, ahead.belief.pose, view.latest(Drift)
        if ahead.leg.value.looking_rad is not None:
            return None
        curvature_per_m = 0.0 if drift is None else drift.value.curvature_per_m
        actuator = belief.robot.actuator
        command = plan_increment(actuator, way.leg, here, belief.value.sigma_m, curvature_per_m, LOOKAHEAD_M)
        if command is None or command.move_m == 0.0:
            return None if command is None else Case(ahead, command, ())
        if not self._settings.action.keeps_to_seen_floor:
            return Case(ahead, _slow(command, way.speed_m_per_s), ())
        floor = FloorAhead(view, way.leg, belief.entry, self._settings)
        seen, free = floor.keep_to_seen(_slow(command, way.speed_m_per_s))
        if free is None or seen.looking_rad is not None or free.move_m < MIN_MOVE_M:
            return None
        return Case(ahead, _slow(free, way.speed_m_per_s), floor.because)

    def look(self, view: View) -> PeopleAhead | None:
        """What is ahead of the leg."""
        return look_ahead(view, self._settings)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        ahead, command, floor = case
        (leg, belief, way), drift = (ahead.leg, ahead.belief, ahead.way), view.latest(Drift)
        assert way is not None
        because = (*ahead.because, belief.entry, *floor)
        who = way.who
        passing = Post(PeoplePass(leg.id, who.name, who.words(), way.p, way.aside_m, way.speed_m_per_s), because)
        yield passing
        corrected = correct(view, Level.ACTION, (belief.entry,))
        yield from corrected
        seen = update_leg(leg.value, belief.pose, find_aim(way.leg, belief.pose, LOOKAHEAD_M))
        step = Revise(leg, count_increment(seen, command), (leg, belief.entry, *corrected, passing))
        yield step
        yield Post(command, (step, belief.entry, passing, *(() if drift is None else (drift,)), *floor))


def _slow(command: MotorCommand, speed_m_per_s: float) -> MotorCommand:
    """The same, at most so fast, and no longer than that is foreseen."""
    speed = speed_m_per_s if command.speed_m_per_s is None else min(speed_m_per_s, command.speed_m_per_s)
    return replace(command, move_m=min(command.move_m, MOVE_S * speed), speed_m_per_s=speed)
