"""Could it be the next door? A place, against those at which its room repeats itself.

Lines that a view shares with the view at the next door speak for both. What tells them apart is what only one of them
shows: the picture has it, or has it not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.agreement import coverage
from knowledge_sources.methods.repetition import repetitions
from knowledge_sources.methods.rivals import ALIKE_PX, ALIKE_RAD
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility import VisibleLines, visible_lines

Floats = NDArray[np.float64]

LENGTH_PX, CONTRAST, SIGHT_M = 12.0, 0.05, 15.0
"""Lines that are longer, clearer and nearer than this are looked for."""
LINE_PX, LONG_PX = 30.0, 100.0
"""So much length counts as one line; what is longer than LONG_PX tells no more."""
TOLERANCE_PX, TOLERANCE_RAD = 2.5, 0.06


class Lookalike(NamedTuple):
    """The place that is hardest to tell from the one that is believed: ``margin`` lines speak against it."""

    world_from_robot: Pose2
    margin: float


def hardest_to_tell(robot: RobotModel, segments_px: Floats, room: str, pose: Pose2) -> Lookalike | None:
    """Of the places at which a room repeats itself, the one that segments (k, 2, 2) speak least against; None: none."""
    own, outline = view(robot, pose).segments_px, robot.world.outline(room)
    low, high = outline.min(axis=0), outline.max(axis=0)
    places = [other for _, other in repetitions(robot.world, room, pose, (room,))
              if np.all((low <= other.position) & (other.position <= high))]
    margins = [margin(own, view(robot, other).segments_px, segments_px) for other in places]
    if not margins:
        return None
    least = int(np.argmin(margins))
    return Lookalike(places[least], margins[least])


def view(robot: RobotModel, pose: Pose2) -> VisibleLines:
    """The lines that should be seen from a pose."""
    return visible_lines(robot.world, robot.camera, robot.camera_from_world(pose), min_length_px=LENGTH_PX,
                         min_contrast=CONTRAST, max_distance_m=SIGHT_M)


def margin(one: Floats, other: Floats, segments_px: Floats) -> float:
    """By how many lines segments (k, 2, 2) speak rather for one view (n, 2, 2) than for another (m, 2, 2).

    Only lines count that the other view lacks; of each, what is accounted for beyond a half speaks for its view, what
    is missing beyond a half against it.
    """
    return _told(one, other, segments_px) - _told(other, one, segments_px)


def _told(view_px: Floats, other_px: Floats, segments_px: Floats) -> float:
    if not len(view_px):
        return 0.0
    lines = np.minimum(np.linalg.norm(view_px[:, 1] - view_px[:, 0], axis=1), LONG_PX) / LINE_PX
    lacking = 1.0 - np.nan_to_num(coverage(view_px, other_px, ALIKE_PX, ALIKE_RAD)) if len(other_px) else 1.0
    found = np.nan_to_num(coverage(view_px, segments_px, TOLERANCE_PX, TOLERANCE_RAD)) if len(segments_px) else 0.0
    return float(np.sum(lines * lacking * (found - 0.5)))
