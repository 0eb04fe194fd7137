"""Shut door explainer (§4: models are incomplete): before the robot believes that it is lost, is a door ahead shut?"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Revise, Revised, View, Watch
from knowledge_sources.methods.doors import (
    MAX_LOG_ODDS,
    MIN_FEW_LINES,
    MIN_LOG_RATIO,
    PRIOR_LOG_ODDS,
    SHUT_LOG_ODDS,
    describe,
    explain_picture,
    is_explained,
    is_near,
    measure_opening,
    predict_opening,
    weigh_leaf,
)
from knowledge_sources.methods.features import read_picture
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    GOING_ON,
    HELD,
    MAX_SIGMA_M,
    MAX_SIGMA_RAD,
    NOT_LOST,
    PLAN_DOUBT,
    UP_TO_DATE,
    Watched,
    find_before_door,
    find_door_state,
    find_frames,
    list_doors_in_view,
    with_door_shut,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import CameraPicture, Discrepancy, DoorPicture, DoorState, Milestone, Segments

MAX_DOUBTED_SIGMA_M = 0.3  # largest standard deviation of the place at which a shut door may explain a picture
MAX_DOUBTED_SIGMA_RAD = 0.07  # largest standard deviation of the believed heading at which it may
REFUTED_LOG_RATIO = 4.6  # what a milestone that is refuted at a trusted place adds for a door that explains it
MIN_SURE_FRAME_SHARE = 0.8  # where there are fewer, least share of the opening's frame that has the model's color


class Case(NamedTuple):
    """A refuted milestone, the lines of its picture, and the doors in view.

    Attributes:
        doors: that are not believed to be shut.
    """

    milestone: Entry[Milestone]
    segments: Entry[Segments]
    doors: tuple[Watched, ...]


class ShutDoorExplainer(RobotKnowledgeSource):
    """Holds "I am where I believe, and this door is shut" against a picture by which a milestone was refuted.

    Through a door that is shut nothing is seen of what was expected there, so that the picture does not fit the belief.
    It acts before the discrepancy climbs to the goal level. The door is shut where lines and colors that are predicted
    with it shut tell the believed place for certain, which they do not with it open, and its opening shows a leaf in
    its frame. Then the discrepancy is corrected: by the model, not by the belief.
    """

    level, priority = Level.PLAN, Priority.ENTER
    on = (Watch(Milestone, (Revised,), lambda m: m.status in ("refuted", "not testable")),)
    needs = (GOING_ON, HELD, UP_TO_DATE, NOT_LOST, PLAN_DOUBT)
    writes = (DoorState, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Case | None:
        belief, segments = HELD.of(view), _find_segments(view, trigger.entry)
        if not PLAN_DOUBT.of(view).value.exceeds or segments is None:
            return None
        if belief.value.sigma_m > MAX_DOUBTED_SIGMA_M or belief.value.sigma_rad > MAX_DOUBTED_SIGMA_RAD:
            return None
        doors = tuple(w for w in list_doors_in_view(view, belief.value) if not w.is_shut)
        return Case(trigger.entry, segments, doors) if doors else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        doubt = PLAN_DOUBT.of(view)
        for watched in case.doors:
            found = self._hold_against(view, watched, case)
            if found is not None:
                yield found
                yield Revise(doubt, doubt.value.corrected(), (found,))
                return

    def _hold_against(self, view: View, watched: Watched, case: Case) -> Post | Revise | None:
        """The door's state, where the picture says that it is shut and the robot where it believes to be."""
        (milestone, segments, _), belief = case, HELD.of(view)
        door, locale = watched.doorway, belief.locale
        frame: Entry[CameraPicture] = view[segments.value.frame]
        robot, frames = belief.seeing, find_frames(view, door.between)
        before, covariance = belief.pose, belief.covariance
        as_shut = robot.in_building(with_door_shut(view, door.name, frames))
        looked = before, covariance, segments.value.segments_px, frame.value.jpeg
        shut, opened = (explain_picture(r, *looked) for r in (as_shut, robot))
        is_sure = belief.value.sigma_m <= MAX_SIGMA_M and belief.value.sigma_rad <= MAX_SIGMA_RAD
        if shut is None or not is_explained(shut, opened, is_sure=is_sure):
            return None
        pose = shut.pose
        if not is_near(before, pose, belief.value):
            return None
        before = find_before_door(view, door, locale)
        opening = predict_opening(robot, pose, shut.covariance, door, locale, robot.world, before)
        evidence = None if opening is None else measure_opening(robot, opening, read_picture(frame.value.jpeg).half)
        if opening is None or evidence is None:
            return None
        ratio = weigh_leaf(evidence)
        if ratio < MIN_LOG_RATIO or (shut.matched < MIN_FEW_LINES and evidence.frame < MIN_SURE_FRAME_SHARE):
            return None
        odds = min(ratio - PRIOR_LOG_ODDS + REFUTED_LOG_RATIO, MAX_LOG_ODDS)
        if odds < SHUT_LOG_ODDS:
            return None
        agreement = f"with it shut {shut.matched} of {shut.expected} lines are where they should be"
        agreement = agreement if shut.matched >= MIN_FEW_LINES else "in its frame"
        what = milestone.value.what.partition(", because")[0]
        shows = f"{describe(evidence, ratio)}, {agreement}, while {what} is {milestone.value.status}"
        picture = DoorPicture(frame.id, opening.box_px, pose.x_m, pose.y_m, pose.heading_rad, ratio, shows)
        known = find_door_state(view, door.name)
        count = 1 if known is None else known.value.pictures + 1
        now = DoorState(door.name, door.between, "shut", 1.0 / (1.0 + math.exp(-odds)), odds, count, picture,
                        frame.value.sim_time_s)
        because = (frame, milestone, belief.entry, segments)
        return Post(now, because) if known is None else Revise(known, now, (*because, known))


def _find_segments(view: View, milestone: Entry[Milestone]) -> Entry[Segments] | None:
    """The lines of the picture by which a milestone was judged, as long as that picture is there."""
    found = view.latest(Segments, lambda segments: segments.milestone == milestone.id)
    return found if found is not None and view.get(found.value.frame) is not None else None
