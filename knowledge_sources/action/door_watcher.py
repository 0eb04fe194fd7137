"""Door watcher (§4: models are incomplete): doors of the model that are shut, or open again, by what pictures show."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard.board import View
from blackboard.change import Change, Posted, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.doors_in_view import (
    MAX_SIGMA_M,
    MAX_SIGMA_RAD,
    Watched,
    find_door_state,
    list_doors_in_view,
    open_in_frames,
    shut_in_frames,
    with_door_open,
)
from knowledge_sources.methods.arrays import Image
from knowledge_sources.methods.doors.belief import update_door
from knowledge_sources.methods.doors.leaf import describe, measure_opening, predict_opening, weigh_leaf
from knowledge_sources.methods.features.picture import read_picture
from knowledge_sources.questions import (
    find_belief,
    find_frames,
    find_robot_in,
    is_in_doubt,
    is_over,
    is_up_to_date,
)
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.building.locale_frame import LocaleFrame
from world_models.entries.body import CameraPicture
from world_models.entries.door_state import DoorPicture, DoorState
from world_models.entries.location import Hypothesis
from world_models.entries.task import Milestone


class DoorWatcher(OlderSource):
    """Looks whether the doors in view are open or shut, and puts what it finds into the frames of both their rooms.

    It looks at pictures as long as the belief is trusted: at those that track landmarks, and at those by which a
    milestone was verified. An opening shows what the model has beyond, or a leaf. That adds to the log odds of the
    door; at stated odds, by pictures from two places at least, the door is shut, and the sketcher draws another way.
    One that is believed to be shut and shows what is beyond is open again.
    """

    level = Level.ACTION
    on = (
        Watch(CameraPicture, (Posted,), lambda f: f.purpose == "track"),
        Watch(Milestone, (Revised,), lambda m: m.status == "verified"),
    )
    writes = (DoorState, LocaleFrame)

    def judge(self, view: View, trigger: Change) -> float | None:
        belief, frame = find_belief(view), view.latest(CameraPicture)
        if belief is None or frame is None or not self._is_trusted(view, belief.value):
            return None
        return 0.8 if any(True for _ in list_doors_in_view(view, belief.value)) else None

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, frame = find_belief(view), view.latest(CameraPicture)
        if belief is None or frame is None:
            return
        picture = read_picture(frame.value.jpeg)
        for watched in list(list_doors_in_view(view, belief.value)):
            yield from self._watch(view, watched, belief, frame, picture.half)

    def _is_trusted(self, view: View, belief: Hypothesis) -> bool:
        """Whether the belief includes every motion, nothing doubts it, and it is precise enough to look at doors."""
        if is_over(view) or is_in_doubt(view) or not is_up_to_date(view):
            return False
        return belief.sigma_m <= MAX_SIGMA_M and belief.sigma_rad <= MAX_SIGMA_RAD

    def _watch(
        self, view: View, watched: Watched, belief: Entry[Hypothesis], frame: Entry[CameraPicture], image: Image
    ) -> Iterable[Effect]:
        """Weigh what a picture shows of a door, and revise what is believed of it."""
        door, locale = watched.doorway, belief.value.locale
        robot = find_robot_in(view, locale)
        pose, covariance = belief.value.world_from_robot(robot.world), belief.value.covariance_world(robot.world)
        frames = find_frames(view, door.between)
        beyond = with_door_open(view, door.name, frames) if watched.is_shut else robot.world
        opening = predict_opening(robot, pose, covariance, door, locale, beyond)
        evidence = None if opening is None else measure_opening(robot, opening, image)
        if opening is None or evidence is None:
            return
        known = find_door_state(view, door.name)
        ratio = weigh_leaf(evidence)
        picture = DoorPicture(frame.id, opening.box_px, pose.x_m, pose.y_m, pose.heading_rad, ratio,
                              describe(evidence, ratio))
        if known is None and (ratio > 0.0) == watched.is_shut:
            return  # as it is believed to be
        now = update_door(None if known is None else known.value, door.name, door.between, picture,
                          frame.value.sim_time_s, is_believed_shut=watched.is_shut)
        if now is None or (known is not None and now.state == known.value.state == "open"):
            return
        because = (frame, belief) if known is None else (frame, belief, known)
        found = Post(now, because) if known is None else Revise(known, now, because)
        yield found
        if now.state == "shut" and not watched.is_shut:
            yield from shut_in_frames(door.name, self.name, frames, found)
        elif now.state == "open" and watched.is_shut:
            yield from open_in_frames(door.name, frames, found)

