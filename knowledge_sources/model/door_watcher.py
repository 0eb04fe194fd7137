"""Door watcher (§4: models are incomplete): doors of the model that are shut, or open again, by what pictures show."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, Revised, View, Watch
from knowledge_sources.methods.arrays import Image
from knowledge_sources.methods.doors import describe, measure_opening, predict_opening, update_door, weigh_leaf
from knowledge_sources.methods.features import compute_mean_and_deviation, is_dark, read_picture
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    GOING_ON,
    HELD,
    MAX_SIGMA_M,
    MAX_SIGMA_RAD,
    PICTURE,
    SURE,
    UP_TO_DATE,
    Belief,
    Watched,
    find_before_door,
    find_door_state,
    find_frames,
    list_doors_in_view,
    with_door_open,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import CameraPicture, DoorPicture, DoorState, Milestone


class DoorWatcher(RobotKnowledgeSource):
    """Looks whether the doors in view are open or shut.

    It looks at pictures as long as the belief is trusted: at those that track landmarks, and at those by which a
    milestone was verified. An opening shows what the model has beyond, or a leaf. That adds to the log odds of the
    door; at stated odds, by pictures from two places at least, it is shut, and the goal sketcher draws another way. One
    that is believed to be shut and shows what is beyond is open again. A dark picture tells nothing of doors,
    nor does one of what was found to stand before them.
    """

    level, priority = Level.ACTION, Priority.SEE
    on = (
        Watch(CameraPicture, (Posted,), lambda f: f.purpose == "track"),
        Watch(Milestone, (Revised,), lambda m: m.status == "verified"),
    )
    needs = (GOING_ON, HELD, PICTURE, UP_TO_DATE, SURE)
    writes = (DoorState,)

    def bind(self, view: View, trigger: Change) -> tuple[Watched, ...] | None:
        """Doors that the newest picture may show, where the belief is sharp enough to look at them."""
        belief = HELD.of(view)
        if belief.value.sigma_m > MAX_SIGMA_M or belief.value.sigma_rad > MAX_SIGMA_RAD:
            return None
        return tuple(list_doors_in_view(view, belief.value)) or None

    def act(self, view: View, case: tuple[Watched, ...]) -> Iterable[Effect]:
        held, frame = HELD.of(view), PICTURE.of(view)
        picture = read_picture(frame.value.jpeg)
        if is_dark(*compute_mean_and_deviation(picture.grey)):
            return
        for watched in case:
            yield from self._watch(view, watched, held, frame, picture.half)

    def _watch(
        self, view: View, watched: Watched, held: Belief, frame: Entry[CameraPicture], image: Image
    ) -> Iterable[Effect]:
        """Weigh what a picture shows of a door, and revise what is believed of it."""
        door, belief, robot, pose = watched.doorway, held.entry, held.seeing, held.pose
        frames = find_frames(view, door.between)
        beyond = with_door_open(view, door.name, frames) if watched.is_shut else robot.world
        before = find_before_door(view, door, held.locale)
        opening = predict_opening(robot, pose, held.covariance, door, held.locale, beyond, before)
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
        yield Post(now, because) if known is None else Revise(known, now, because)

