"""View predictor (§3.3, §4): what should be seen of a milestone that the robot faces, and the picture of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from knowledge_sources.methods.localization import precompute_views
from knowledge_sources.methods.verification import list_seen_locales, predict_milestone
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    GOING_ON,
    HELD,
    MAX_LOOK_ERROR_RAD,
    MILESTONE,
    NOT_LOST,
    STANDING,
    find_car_of,
    find_followed,
    find_frames,
    open_discrepancy,
    unmeasured_doubt,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Discrepancy, Hypothesis, Milestone, Obstruction, PictureRequest
from world_models.frames import wrap_angle


class ViewPredictor(RobotKnowledgeSource):
    """Predicts the landmarks of a milestone once the robot faces them, and asks for the picture.

    A doubt that is newer than the milestone does not wait for the turn: the present view is looked at.
    """

    level, priority = Level.PLAN, Priority.LOOK
    on = (
        Watch(Milestone, (Posted,), lambda m: m.status == "turning"),
        Watch(Discrepancy, (Posted, Revised)),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held),
    )
    needs = (GOING_ON, HELD, STANDING, NOT_LOST, MILESTONE)
    writes = (Milestone, PictureRequest)

    def bind(self, view: View, trigger: Change) -> Entry[Milestone] | None:
        """The milestone that is looked for, where the robot faces it."""
        waiting, doubt = MILESTONE.of(view), unmeasured_doubt(view)
        if waiting.value.status != "turning":
            return None
        off_rad = abs(wrap_angle(HELD.of(view).pose.heading_rad - waiting.value.look_heading_rad))
        if off_rad > MAX_LOOK_ERROR_RAD and (doubt is None or waiting.cycle >= doubt.cycle):
            return None
        return waiting

    def act(self, view: View, case: Entry[Milestone]) -> Iterable[Effect]:
        milestone, belief, hidden = case, HELD.of(view), view.all(Obstruction)[-1:]
        robot, pose = belief.seeing, belief.pose
        here = replace(milestone.value, look_heading_rad=pose.heading_rad)
        expected = predict_milestone(robot, pose, here, find_car_of(view, here))
        if not find_followed(view) or open_discrepancy(view, Level.PLAN) is not None:
            precompute_views(robot, belief.locale, pose)  # for the milestone judge
        frames = find_frames(view, list_seen_locales(robot, pose, belief.locale))
        wish = Revise(milestone, expected, (milestone, belief.entry, *hidden, *frames))
        yield wish
        yield Post(PictureRequest("milestone"), (wish,))
