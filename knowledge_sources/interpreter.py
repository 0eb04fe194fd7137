"""Interpreter (§3.3, §4): a command becomes a goal in conceptual-dependency form."""

from __future__ import annotations

import re
from collections.abc import Iterable

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from world_models.frames import Pose2
from world_models.location import Hypothesis, Place
from world_models.robot import RobotModel
from world_models.task import Command, Goal, Outcome
from world_models.units import FOOT_M

_NUMBER = r"\s*([-+]?\d+(?:\.\d*)?)\s*"
_PLACE = rf"\(\s*([\w'-]+)\s+\({_NUMBER},{_NUMBER},{_NUMBER}\)\s*\)"
_PTRANS = re.compile(rf"\s*\(\s*ptrans\s+{_PLACE}\s*{_PLACE}\s*\)\s*")


class Interpreter(KnowledgeSource):
    """Reads ``(ptrans (locale (x,y,z)) (locale (x,y,z)))``: from where to where, feet in each locale's own frame.

    The command's first place is also where the robot is told that it stands: the first hypothesis. What cannot be
    understood ends the mission with the reason.
    """

    level = Level.GOAL
    watches = (Watch(Command, (Posted,)),)
    writes = (Goal, Hypothesis, Outcome)

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        command: Command = trigger.entry.value
        try:
            origin, destination = self._places(command)
        except ValueError as error:
            yield Post(Outcome("failed", f"the command was not understood: {error}"), (trigger.entry,))
            return
        pose = Pose2(origin.x_m, origin.y_m, command.start_heading_rad)
        yield Post(Hypothesis(origin.locale, pose, command.start_covariance, "command"), (trigger.entry,))
        yield Post(Goal(origin, destination), (trigger.entry,))

    def _places(self, command: Command) -> tuple[Place, Place]:
        found = _PTRANS.fullmatch(command.text)
        if found is None:
            raise ValueError(f"expected (ptrans (locale (x,y,z)) (locale (x,y,z))), got {command.text!r}")
        a, ax, ay, _, b, bx, by, _ = found.groups()
        known = self._robot.world.locales
        for name in (a, b):
            if name not in known:
                raise ValueError(f"expected one of the locales {', '.join(known)}, got {name!r}")
        return (
            Place(a, float(ax) * FOOT_M, float(ay) * FOOT_M),
            Place(b, float(bx) * FOOT_M, float(by) * FOOT_M, command.arrival_heading_rad),
        )
