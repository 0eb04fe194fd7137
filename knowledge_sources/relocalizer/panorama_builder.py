"""Panorama builder (§4): a lost robot's pictures, put together by the motions between them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch, to_say
from knowledge_sources.methods.localization import propagate_pose, update_obstruction
from knowledge_sources.priority import Priority
from knowledge_sources.reads import LOST, WHILE_LOST, find_panorama, find_robot, is_dark, list_views
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.actuator import ActuatorModel
from world_models.entries import Glimpse, MotionReport, Obstruction, Panorama, Segments, covariance_tuple
from world_models.frames import Pose2


class PanoramaBuilder(RobotKnowledgeSource):
    """Composes the pictures since the robot is lost to one view round, and finds the occlusions of the lens.

    What is at the same place in its pictures while it turns is an obstruction. A dark picture does not count; a bright
    one without contrast does, as it shows a bare wall.
    """

    level = closes = Level.GOAL
    priority = Priority.RECOVER
    on = (Watch(Segments, (Posted,), lambda s: s.milestone == ""),)
    needs = WHILE_LOST
    writes = (Panorama, Obstruction)

    def bind(self, view: View, trigger: Change) -> Entry[Segments] | None:
        """The lines of a picture that is not dark."""
        return None if is_dark(trigger.entry.value) else trigger.entry

    def act(self, view: View, case: Entry[Segments]) -> Iterable[Effect]:
        segments, doubt, hidden, robot = case, LOST.of(view), view.latest(Obstruction), find_robot(view)
        before = find_panorama(view, doubt)
        motions = () if before is None else view.since(MotionReport, before.cycle)
        old = () if before is None else before.value.glimpses
        for report in motions:
            old = tuple(_move(glimpse, report.value, robot.actuator) for glimpse in old)
        glimpses = (*old, Glimpse(segments.id, Pose2(0.0, 0.0, 0.0), covariance_tuple(np.zeros((3, 3)))))
        because = (segments, doubt, *motions)
        panorama = Panorama(glimpses)
        seen = Post(panorama, because) if before is None else Revise(before, panorama, (*because, before))
        known = None if hidden is None else hidden.value
        obstruction = update_obstruction(list_views(view, glimpses), robot.camera, known)
        change = to_say(hidden, obstruction, (segments, doubt))
        yield from (seen,) if change is None else (change, seen)


def _move(glimpse: Glimpse, report: MotionReport, actuator: ActuatorModel) -> Glimpse:
    """A look, as seen from where the robot is after a motion."""
    claim = report.turn_rad, report.move_m
    step, spread = actuator.predict_motion(*claim), actuator.motion_covariance(*claim)
    pose, covariance = propagate_pose(glimpse.now_from_then, np.array(glimpse.covariance), step, spread)
    return replace(glimpse, now_from_then=pose, covariance=covariance_tuple(covariance))
