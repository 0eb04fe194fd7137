"""The landmarks that are followed: which are taken, and which still serve."""

from __future__ import annotations

import math
from itertools import islice
from typing import NamedTuple

from blackboard import Effect, Entry, Post, Revise, View
from knowledge_sources.methods.arrays import Floats, Image
from knowledge_sources.methods.features import read_picture
from knowledge_sources.methods.tracking import TEMPLATE_HALF_PX, align_to_edges, select_landmarks
from knowledge_sources.methods.verification import find_errors
from knowledge_sources.reads.conditions import Belief
from world_models.entries import Anchor, CameraPicture, FreeFloor, Hypothesis, Track, Tracks, covariance_tuple
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_lines

MAX_TEMPLATE_DISTANCE_M = 1.3
"""A template is dropped when the robot is further than this from where it was cut: two increments (Table 1:
increments of two feet)."""
MAX_TEMPLATE_DISTANCE_ROLLING_M = 0.8  # the same on the move, where many pictures show the same template
MIN_EDGE_LENGTH_PX = 16.0  # shortest projected model edge that the belief is aligned with before templates are cut
MIN_EDGE_CONTRAST = 0.05  # smallest contrast of such an edge
MAX_EDGE_DISTANCE_M = 15.0  # largest distance of such an edge
MAX_UNSEEN = 3  # after so many pictures without a landmark, and as many looks at no free floor, the place is in doubt


class Renewed(NamedTuple):
    """The tracks, and the belief by which the new ones of them were cut."""

    tracks: Tracks
    hypothesis: Hypothesis


def rectify(robot: RobotModel, frame: Entry[CameraPicture]) -> Image:
    """The rectified picture of a frame."""
    return read_picture(frame.value.jpeg).rectified(robot.lens, robot.camera)


def take_new(
    held: Belief, frame: str, image: Image, kept: tuple[Track, ...], anchors: tuple[Anchor, ...],
    belief: Hypothesis, camera_covariance: Floats | None,
) -> Renewed:
    """Take new landmarks besides those that are kept, once the belief is aligned with the model's edges.

    Args:
        belief: what is held, or that corrected by this picture already.
        frame: id of the picture; image: the picture, rectified.
        camera_covariance: (7, 7); None where the belief rests on this very picture: it is not aligned by it again.
    """
    seeing, world = held.seeing, held.world
    pose = belief.world_from_robot(world)
    lines = visible_lines(
        world, seeing.camera, seeing.camera_from_world(pose), min_length_px=MIN_EDGE_LENGTH_PX,
        min_contrast=MIN_EDGE_CONTRAST, max_distance_m=MAX_EDGE_DISTANCE_M,
    )
    found = None
    is_exact = find_errors(seeing, lines).is_exact  # else the edges are not where the model has them
    if camera_covariance is not None and is_exact:
        found = align_to_edges(seeing, image, lines.lines_world, pose, belief.covariance_world(world),
                               camera_covariance)
    if found is not None:
        pose = found.world_from_robot
        belief = held.moved_to(pose, found.covariance, "tracks")
    items = (*kept, *select_landmarks(seeing, kept, frame, image, pose))
    return Renewed(with_anchors(seeing, frame, items, anchors, belief, len(items)), belief)


def with_anchors(
    robot: RobotModel, frame: str, items: tuple[Track, ...], anchors: tuple[Anchor, ...], belief: Hypothesis,
    taken: int,
) -> Tracks:
    """The tracks, with what was believed where their templates were cut."""
    pose = belief.world_from_robot(robot.world)
    here = Anchor(frame, pose.x_m, pose.y_m, covariance_tuple(belief.covariance_world(robot.world)))
    used = {t.template_frame for t in items}
    kept = tuple(a for a in (*anchors, here) if a.frame in used)
    return Tracks(frame, TEMPLATE_HALF_PX, items, kept, taken)


def find_near_frames(anchors: tuple[Anchor, ...], here: Pose2, robot: RobotModel) -> frozenset[str]:
    """The frames that were taken near enough to here [world] for their templates to be used."""
    far_m = MAX_TEMPLATE_DISTANCE_ROLLING_M if robot.continuous else MAX_TEMPLATE_DISTANCE_M
    return frozenset(a.frame for a in anchors if math.hypot(a.x_m - here.x_m, a.y_m - here.y_m) <= far_m)


def post_or_revise(old: Entry[Tracks] | None, tracks: Tracks, because: tuple[object, ...]) -> Effect:
    return Post(tracks, because) if old is None else Revise(old, tracks, because)


class Following(NamedTuple):
    """The newest picture, the belief by which it was taken, and the landmarks that were followed so far."""

    frame: Entry[CameraPicture]
    belief: Belief
    old: Entry[Tracks] | None


def find_missing_floors(view: View, unseen: int) -> tuple[Entry[FreeFloor], ...]:
    """The last looks at the floor, where each shows none of it free where the model has some, and no picture of as many
    showed a landmark; else none.
    """
    looks = tuple(islice((f for f in view.newest_first(FreeFloor) if f.value.sense == "camera"), MAX_UNSEEN))
    return looks if min(len(looks), unseen) >= MAX_UNSEEN and all(look.value.is_missing for look in looks) else ()


def tell_worst(seen: list[Track]) -> str:
    """The landmark that is furthest from where it was expected, in words."""
    off = [(math.dist(t.predicted_px, t.found_px), t.landmark) for t in seen if t.found_px is not None]
    return f" ({max(off)[1]} is {max(off)[0]:.1f} px off)" if off else " (none of them is found)"
