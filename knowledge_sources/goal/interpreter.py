"""Interpreter (§3.3, §4): turns a command into a goal in conceptual-dependency form."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Entry, Level, Post, Posted, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import find_building
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.commands import read_places
from world_models.entries import Command, Goal, Hypothesis, Impasse, Place
from world_models.frame_building import FrameBuilding
from world_models.frames import Pose2


class Interpreter(RobotKnowledgeSource):
    """Reads ``(ptrans (locale (x,y,z)) (locale (x,y,z)))``, from where to where, in feet in each locale's frame.

    It also understands "Go from the laboratory to Allen's office", from the middle of one room to that of another. The
    first place is also the first belief. A command that cannot be understood ends the mission with the reason.
    """

    level, priority = Level.GOAL, Priority.ENTER
    on = (Watch(Command, (Posted,)),)
    writes = (Goal, Hypothesis, Impasse)

    def bind(self, view: View, trigger: Change) -> Entry[Command]:
        return trigger.entry

    def act(self, view: View, case: Entry[Command]) -> Iterable[Effect]:
        command = case.value
        try:
            origin, destination = _read_places(find_building(view), command)
        except ValueError as error:
            yield Post(Impasse("failed", f"the command was not understood: {error}"), (case,))
            return
        pose = Pose2(origin.x_m, origin.y_m, command.start_heading_rad)
        yield Post(Hypothesis(origin.locale, pose, command.start_covariance, "command"), (case,))
        yield Post(Goal(origin, destination), (case,))


def _read_places(building: FrameBuilding, command: Command) -> tuple[Place, Place]:
    origin, destination = read_places(command.text, building, building.find_rooms)
    return origin, replace(destination, heading_rad=command.arrival_heading_rad)
