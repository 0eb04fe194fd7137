"""Obstruction finder (§4: models are incomplete): what stands before the camera and hides a part of each picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, to_say
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.methods.localization.views import CameraView, update_obstruction
from knowledge_sources.priority import Priority
from knowledge_sources.questions import active_goal, find_robot, unmeasured_doubt
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import Settings
from world_models.camera import Camera
from world_models.entries.obstacle import Obstruction
from world_models.entries.percepts import Segments
from world_models.frames import Pose2

MIN_OBSTRUCTION_LOOKS = 3  # what stands still in so many looks is before the camera; in two it may by chance
MIN_OBSTRUCTION_PART = 0.04  # smallest part of the picture that an obstruction covers


class ObstructionFinder(RobotKnowledgeSource):
    """Finds what is at the same place in pictures taken in several directions: it is before the camera.

    It acts when a milestone was not testable or the belief is in doubt, before the new picture is judged. While the
    robot is lost, the panorama builder does the same with its own pictures.
    """

    level, priority = Level.PLAN, Priority.REVISE
    on = (Watch(Segments, (Posted,), lambda s: s.milestone != ""),)
    writes = (Obstruction,)

    def bind(self, view: View, trigger: Change) -> Effect | None:
        """The change of what the board says of an obstruction; None where there is none."""
        milestone = view.get(trigger.entry.value.milestone)
        if milestone is None or not (milestone.value.tried or unmeasured_doubt(view) is not None):
            return None
        return self._find_change(view)

    def act(self, view: View, case: Effect) -> Iterable[Effect]:
        yield case

    def _find_change(self, view: View) -> Effect | None:
        """The obstruction in the last looks, as an effect where the board does not say it."""
        looks, known = _list_last_looks(view, self._settings.plan.max_obstruction_looks), view.latest(Obstruction)
        views = [CameraView(s.value.segments_px, Pose2(0.0, 0.0, heading_rad), np.zeros((3, 3)))
                 for s, heading_rad in looks]
        if len(views) < MIN_OBSTRUCTION_LOOKS:
            return None
        camera = find_robot(view).camera
        now = _find_in_last_looks(views, camera, None if known is None else known.value, self._settings)
        return to_say(known, now, (*(s for s, _ in looks), *(() if known is None else (known,))))


def _find_in_last_looks(
    views: Sequence[CameraView], camera: Camera, known: Obstruction | None, settings: Settings
) -> Obstruction | None:
    """The obstruction that all looks show; else that fewer of the last ones show, as it may be new."""
    for number in range(len(views), MIN_OBSTRUCTION_LOOKS - 1, -1):
        found = update_obstruction(
            views[:number], camera, known, MIN_OBSTRUCTION_PART)
        if found is not None:
            return found
    return None


def _list_last_looks(view: View, most: int) -> list[tuple[Entry[Segments], float]]:
    """The last looks for milestones, each with its heading [rad, world], the newest first.

    None is older than the goal: when lost, the robot did not know its heading.
    """
    goal = active_goal(view)
    since = 0 if goal is None else goal.cycle
    looked = ((s, view.get(s.value.milestone)) for s in view.newest_first(Segments) if s.cycle >= since)
    known = ((s, m.value.look_heading_rad) for s, m in looked if m is not None)
    return list(islice(known, most))
