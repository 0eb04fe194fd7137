"""Floor watcher (§4, §5): how far the floor is free, by each picture, before the next increment is decided."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import islice

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revised, View, Watch
from knowledge_sources.methods.floor import FLOOR_VIEW_DISTANCE_M, FLOOR_VIEW_TURN_RAD, Seen, see_free_floor
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    GOING_ON,
    HELD,
    PICTURE,
    SURE,
    UP_TO_DATE,
    Belief,
    find_motion_between,
    rolling_course,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import LAST_VIEWS, CameraPicture, FloorView, FreeFloor, Hypothesis
from world_models.frames import Pose2, wrap_angle

FLOOR_STEP_M = 0.04  # on the move the floor is looked at again after so much of the way
MAX_FLOOR_SIGMA_M = 0.1  # the floor is looked at while the robot's place is known to this
MAX_FLOOR_SIGMA_RAD = math.radians(1.0)  # the same of its heading

MAX_LIGHT_AGE_S = 20.0  # the light of a picture tells that of the next ones for so long

CORRECTED_BY = ("milestone", "tracks", "relocalization")
"""What the belief rests on when a picture has corrected it."""


class FloorWatcher(RobotKnowledgeSource):
    """Looks at the floor in each picture, once the belief was corrected by it.

    It says how far the floor is free in each direction, and what ends it: something of the model, or a thing that the
    model lacks. Some pictures are kept to compare later ones with: what stands up from the floor moves differently than
    the floor. While the robot's place is in doubt, or not known well, it does not look: it could not tell a wall from a
    thing. In the dark it sees none of the floor, and no thing.
    """

    level, priority = Level.ACTION, Priority.SEE
    on = (
        Watch(CameraPicture, (Posted,), lambda f: f.purpose not in ("milestone", "probe")),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis in CORRECTED_BY),
    )
    needs = (GOING_ON, PICTURE, HELD, UP_TO_DATE, SURE)
    writes = (FreeFloor, FloorView)

    def bind(self, view: View, trigger: Change) -> Entry[CameraPicture] | None:
        """A picture in which the floor was not looked at yet, where the belief is sharp enough to tell by it."""
        frame, belief = PICTURE.of(view), HELD.of(view)
        if belief.value.sigma_m > MAX_FLOOR_SIGMA_M or belief.value.sigma_rad > MAX_FLOOR_SIGMA_RAD:
            return None
        is_seen = any(frame.ref in seen.because for seen in view.newest_first(FreeFloor))
        if is_seen or (rolling_course(view) is not None and _is_near_last(view, belief)):
            return None
        return frame

    def act(self, view: View, case: Entry[CameraPicture]) -> Iterable[Effect]:
        frame, held = case, HELD.of(view)
        belief, locale, robot, pose = held.entry, held.locale, held.seeing, held.pose
        floor_m = robot.world.floor_m(locale)
        kept = [entry for entry in islice(view.newest_first(FloorView), LAST_VIEWS)
                if entry.value.belief == belief.id and entry.value.floor_m == floor_m]
        apart_m = FLOOR_VIEW_DISTANCE_M
        earlier = [entry for entry in kept if _measure_way_m(entry.value, pose) >= apart_m]
        motions = [find_motion_between(view, entry.value, held) for entry in earlier]
        wheels = {entry.id: entry for _, reports in motions for entry in reports}
        lit = _find_lit(view, frame.value.sim_time_s)
        seen = see_free_floor(
            robot, locale, pose, held.covariance, frame.value.jpeg,
            [Seen(view[then.frame].value.jpeg, Pose2(then.x_m, then.y_m, then.heading_rad), motion)
             for then, (motion, _) in zip((entry.value for entry in earlier), motions, strict=True)],
            frame.value.sim_time_s, self._settings, None if lit is None else lit.value.light)
        reasons = (*kept, *wheels.values(), *(() if lit is None else (lit,)))
        yield Post(seen, (frame, belief, *reasons))
        if seen.bearings_rad and (not kept or not _is_like(kept[0].value, pose)):
            yield Post(FloorView(frame.id, belief.id, pose.x_m, pose.y_m, pose.heading_rad, floor_m,
                                 frame.value.sim_time_s, belief.value.sigma_m, belief.value.sigma_rad,
                                 belief.value.motion), (frame, belief))


def _find_lit(view: View, now_s: float) -> Entry[FreeFloor] | None:
    """The last picture of which the light is known, if it was taken shortly before."""
    since_s = now_s - MAX_LIGHT_AGE_S
    return view.latest(FreeFloor, lambda f: f.light is not None and f.seen_s >= since_s)


def _is_near_last(view: View, belief: Belief) -> bool:
    """Whether the floor was looked at from about here: on the move each picture shows hardly more than the last.

    Only so many looks stay on the board; they must reach back to where what is before the robot now was in sight.
    """
    last = view.latest(FreeFloor, lambda f: f.sense == "camera")
    if last is None:
        return False
    eye = belief.pose @ Pose2(belief.robot.mount.forward_m, 0.0, 0.0)
    return math.hypot(last.value.x_m - eye.x_m, last.value.y_m - eye.y_m) < FLOOR_STEP_M


def _is_like(kept: FloorView, pose: Pose2) -> bool:
    """Whether a picture shows hardly more than one that is kept."""
    turned_rad = abs(wrap_angle(pose.heading_rad - kept.heading_rad))
    return _measure_way_m(kept, pose) < FLOOR_VIEW_DISTANCE_M and turned_rad < FLOOR_VIEW_TURN_RAD


def _measure_way_m(kept: FloorView, pose: Pose2) -> float:
    return math.hypot(kept.x_m - pose.x_m, kept.y_m - pose.y_m)
