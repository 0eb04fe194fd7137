"""View updater (§4: models are incomplete): lines that something before the camera hides are not expected."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Posted, Revise, Revised, View, Watch
from knowledge_sources.methods.verification import list_seen_locales, predict_milestone
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, MILESTONE, find_car_of, find_frames, find_robot_and_pose
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Hypothesis, Milestone, Obstruction


class Case(NamedTuple):
    """What was found to stand before the camera, the milestone whose picture is taken and not judged, the belief."""

    hidden: Entry[Obstruction]
    milestone: Entry[Milestone]
    belief: Entry[Hypothesis]


class ViewUpdater(RobotKnowledgeSource):
    """Predicts a milestone again whose picture is taken, without what an obstruction hides that was just found."""

    level, priority = Level.PLAN, Priority.REVISE
    on = (Watch(Obstruction, (Posted, Revised)),)
    needs = (HELD, MILESTONE)
    writes = (Milestone,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        waiting = MILESTONE.of(view)
        return Case(trigger.entry, waiting, HELD.of(view).entry) if waiting.value.status == "expected" else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        hidden, milestone, belief = case
        robot, pose = find_robot_and_pose(view, belief.value)
        seen = predict_milestone(robot, pose, milestone.value, find_car_of(view, milestone.value), self._settings)
        frames = find_frames(view, list_seen_locales(robot, pose, belief.value.locale, self._settings))
        yield Revise(milestone, seen, (hidden, milestone, belief, *frames))
