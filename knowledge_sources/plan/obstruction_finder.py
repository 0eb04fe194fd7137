"""Obstruction finder (§4: a model is incomplete, and so is a view): what hides a part of every picture of a place."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, to_say
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.methods.localization.obstructions import update_obstruction
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.questions import active_goal, unmeasured_doubt
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import Settings
from world_models.camera import Camera
from world_models.entries.obstruction import Obstruction
from world_models.entries.percepts import Segments
from world_models.frames import Pose2


class ObstructionFinder(RobotKnowledgeSource):
    """Finds what stands still in the last looks for milestones, in several directions, before the new one is judged.

    It asks when a view could not be told, or the belief is in doubt: where nothing is hidden all is as expected. While
    the robot is lost the relocalizer asks the same of its probes.
    """

    level = Level.PLAN
    watches = (Watch(Segments, (Posted,), lambda s: s.milestone != ""),)
    writes = (Obstruction,)

    def rate(self, view: View, trigger: Change) -> float | None:
        milestone = view.get(trigger.entry.value.milestone)
        if milestone is None or not (milestone.value.tried or unmeasured_doubt(view) is not None):
            return None
        return 0.9 if self._news(view) is not None else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        news = self._news(view)
        if news is not None:
            yield news

    def _news(self, view: View) -> Effect | None:
        """What the last looks say that the board does not."""
        looks, known = _looks(view, self._settings.plan.max_obstruction_looks), view.latest(Obstruction)
        views = [CameraView(s.value.segments_px, Pose2(0.0, 0.0, heading_rad), np.zeros((3, 3)))
                 for s, heading_rad in looks]
        if len(views) < self._settings.plan.min_obstruction_looks:
            return None
        now = _seen_by_the_last(views, self._robot.camera, None if known is None else known.value, self._settings)
        return to_say(known, now, (*(s for s, _ in looks), *(() if known is None else (known,))))


def _seen_by_the_last(
    views: Sequence[CameraView], camera: Camera, known: Obstruction | None, settings: Settings
) -> Obstruction | None:
    """What all looks show, the last first; else what fewer of them do, as it was not there in the earlier ones."""
    for number in range(len(views), settings.plan.min_obstruction_looks - 1, -1):
        found = update_obstruction(
            views[:number], camera, known, settings.plan.min_obstruction_part, settings.localization)
        if found is not None:
            return found
    return None


def _looks(view: View, most: int) -> list[tuple[Entry[Segments], float]]:
    """The last looks for milestones, each with the direction in which it was taken [rad, world].

    None from before the goal: the robot was lost then, and did not know in which direction it looked.
    """
    goal = active_goal(view)
    since = 0 if goal is None else goal.cycle
    looked = ((s, view.get(s.value.milestone)) for s in view.newest_first(Segments) if s.cycle >= since)
    known = ((s, m.value.look_heading_rad) for s, m in looked if m is not None)
    return list(islice(known, most))
