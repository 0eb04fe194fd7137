"""Dead reckoner (§3.2): the belief follows the wheels' claim, and becomes less sure by what wheels are known to do."""

from __future__ import annotations

import math
from collections.abc import Iterable

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.expert import Expert
from knowledge_sources.questions import held
from knowledge_sources.tolerances import PLAN_PX
from world_models.body import Look, MotionReport, MotorCommand
from world_models.location import Hypothesis

STOPPED = 0.7
"""A move of which the wheels claim less than this part was stopped by something."""


class DeadReckoner(Expert):
    """Moves the held hypothesis by a motion report and asks for a picture to check it by."""

    level = Level.ACTION
    watches = (Watch(MotionReport, (Posted,)),)
    writes = (Hypothesis, Look, Discrepancy)

    def rate(self, view: View, trigger: Change) -> float | None:
        belief = held(view)
        return None if belief is None or belief.value.motion == trigger.entry.id else 1.0

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief = held(view)
        if belief is None:
            return
        world, report = self._robot.world, trigger.entry.value
        before = belief.value.world_from_robot(world)
        pose, covariance = self._robot.actuator.moved(
            before, belief.value.covariance_world(world), report.turn_rad, report.move_m
        )
        there = world.locale_at(pose.position)
        locale = there if there in world.rooms else belief.value.locale  # in a doorway: still the room it comes from
        moved = Hypothesis.of_world(world, str(locale), pose, covariance, "odometry", motion=trigger.entry.id)
        step = Revise(belief, moved, (trigger.entry,))
        yield step
        yield Post(Look("track"), (step,))
        command = view.latest(MotorCommand)
        if command is not None and report.move_m < STOPPED * command.value.move_m:
            what = f"something stopped the robot: {report.move_m:.2f} m of {command.value.move_m:.2f} m are claimed"
            stopped = Discrepancy(Level.ACTION, what, math.inf, (PLAN_PX, PLAN_PX), "px")
            yield Post(stopped, (trigger.entry,))
