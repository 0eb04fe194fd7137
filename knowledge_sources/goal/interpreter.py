"""Interpreter (§3.3, §4): turns a command into a goal in conceptual-dependency form."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Level, Post, Posted, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import find_building
from world_models.building.locale_frame import FrameRequest
from world_models.commands import read_places
from world_models.entries import Command, Goal, Hypothesis, Impasse
from world_models.frames import Pose2


@rule(on=Watch(Command, (Posted,)), writes=(Goal, Hypothesis, Impasse, FrameRequest), level=Level.GOAL,
      priority=Priority.ENTER)
def interpreter(view: View, trigger: Change) -> Iterable[Effect]:
    """Reads ``(ptrans (locale (x,y,z)) (locale (x,y,z)))``, from where to where, in feet in each locale's frame.

    It also understands "Go from the laboratory to Allen's office", from the middle of one room to that of another. The
    first place is also the first belief. A command that cannot be understood ends the mission with the reason.
    """
    command, building = trigger.entry.value, find_building(view)
    try:
        origin, destination = read_places(command.text, building, building.find_rooms)
    except ValueError as error:
        yield Post(Impasse("failed", f"the command was not understood: {error}"), (trigger.entry,))
        return
    pose = Pose2(origin.x_m, origin.y_m, command.start_heading_rad)
    yield Post(Hypothesis(origin.locale, pose, command.start_covariance, "command"), (trigger.entry,))
    yield Post(Goal(origin, replace(destination, heading_rad=command.arrival_heading_rad)), (trigger.entry,))
