"""Dead reckoner (§3.2): the belief follows the wheels' claim, and becomes less sure by what wheels are known to do."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.expert import Expert
from knowledge_sources.questions import held
from knowledge_sources.tolerances import PLAN_PX
from world_models.body import BodyFault, Look, MotionReport, MotorCommand
from world_models.frames import Pose2
from world_models.location import Hypothesis

STOPPED = 0.7
"""A move of which the wheels claim less than this part was stopped by something."""


class DeadReckoner(Expert):
    """Moves the held hypothesis by a motion report and asks for a picture to check it by.

    What a broken-off motion lacks may have been done all the same, in part or whole, before the base stood: the belief
    becomes less sure by that.
    """

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
        locale = there if there and world.is_room(there) else belief.value.locale  # in a doorway: still the old room
        command = view.latest(MotorCommand)
        fault = None if command is None else view.latest(BodyFault, lambda f: f.request == command.id)
        if command is not None and fault is not None:
            lacking = command.value.turn_rad - report.turn_rad, command.value.move_m - report.move_m
            covariance = covariance + _spread_of(pose, *lacking)
        moved = Hypothesis.of_world(world, str(locale), pose, covariance, "odometry", motion=trigger.entry.id)
        step = Revise(belief, moved, (trigger.entry, belief) if fault is None else (trigger.entry, belief, fault))
        yield step
        yield Post(Look("track"), (step,))
        if fault is None and command is not None and report.move_m < STOPPED * command.value.move_m:
            what = f"something stopped the robot: {report.move_m:.2f} m of {command.value.move_m:.2f} m are claimed"
            stopped = Discrepancy(Level.ACTION, what, math.inf, (PLAN_PX, PLAN_PX), "px")
            yield Post(stopped, (trigger.entry,))


def _spread_of(pose: Pose2, turn_rad: float, move_m: float) -> NDArray[np.float64]:
    """(3, 3) covariance, world, of a TURN and a MOVE of which any part may have been done, about where none was.

    A part that is uniform in 0..d has the second moment d^2 / 3.
    """
    ahead = np.array([math.cos(pose.heading_rad), math.sin(pose.heading_rad), 0.0]) * move_m
    turned = np.array([0.0, 0.0, turn_rad])
    return np.asarray((np.outer(ahead, ahead) + np.outer(turned, turned)) / 3.0)
