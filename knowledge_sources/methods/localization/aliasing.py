"""Could it be the next door? A place, against others of its room: those at which the plan repeats itself, and those at
which the picture fits as well.

Lines that a view shares with the view at the next door speak for both. What tells them apart is what only one of them
shows: the picture has it, or has it not.

Which lines can be seen is worked out on a grid of poses and remembered, and only their projection is of the very pose:
so it can be thought of beforehand, while the robot has yet to look.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.localization.hypotheses import ALIKE_PX, ALIKE_RAD
from knowledge_sources.methods.localization.pose_candidates import are_distinct, find_pose_candidates
from knowledge_sources.methods.localization.refinement import refine_pose
from knowledge_sources.methods.localization.repetition import find_repetitions
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.methods.verification.agreement import compute_coverage
from knowledge_sources.methods.verification.predicted_lines import predict_lines
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel

Floats = NDArray[np.float64]

LINE_PX, LONG_PX = 30.0, 100.0
"""So much length counts as one line; what is longer than LONG_PX tells no more."""
TOLERANCE_PX, TOLERANCE_RAD = 2.5, 0.06
GRID_M, GRID_RAD = 0.1, math.radians(2.0)
"""From poses so near to each other the same lines are seen, but for a few."""
KEPT_VIEWS = 64
MOST_FITTING = 14
"""So many of the places at which the picture fits best are looked at."""


class Alias(NamedTuple):
    """The place that is hardest to tell from the one that is believed: ``margin`` lines speak against it."""

    world_from_robot: Pose2
    margin: float


def find_strongest_alias(
    robot: RobotModel, segments_px: Floats, room: str, pose: Pose2, *, search: bool = False
) -> Alias | None:
    """Of other places of a room, the one that segments (k, 2, 2) speak least against; None: there is none.

    They are those at which the room repeats itself and, with ``search``, wherever else in it the segments fit: what
    repeats itself may be notices and doors for show, which no plan tells of. A search takes half a second.
    """
    others = [*places(robot, room, pose), *(fitting(robot, segments_px, room, pose) if search else ())]
    if not others:
        return None
    own, *there = (score_view(lines_px, segments_px) for lines_px in predict_views_on_grid(robot, (pose, *others)))
    margins = [margin(own, other) for other in there]
    least = int(np.argmin(margins))
    return Alias(others[least], margins[least])


def places(robot: RobotModel, room: str, pose: Pose2) -> list[Pose2]:
    """The other places within a room at which it repeats itself."""
    outline = robot.world.outline(room)
    low, high = outline.min(axis=0), outline.max(axis=0)
    return [other for _, other in find_repetitions(robot.world, room, pose, (room,))
            if np.all((low <= other.position) & (other.position <= high))]


def fitting(robot: RobotModel, segments_px: Floats, room: str, pose: Pose2) -> list[Pose2]:
    """The places of a room, apart from a pose, at which segments (k, 2, 2) fit best."""
    look = (CameraView(segments_px, Pose2(0.0, 0.0, 0.0), np.zeros((3, 3))),)
    candidates = find_pose_candidates(robot, look, (room,), MOST_FITTING)
    found = (refine_pose(robot, look, c.world_from_robot)[0] for c in candidates)
    return [place for place in found if are_distinct(place, pose)]


def precompute_views(robot: RobotModel, room: str, pose: Pose2) -> None:
    """Think of what would be seen there, and at the places that may look alike: the answers are at hand then."""
    predict_views_on_grid(robot, (pose, *places(robot, room, pose)))


def predict_views_on_grid(robot: RobotModel, poses: Sequence[Pose2]) -> list[Floats]:
    """(n, 2, 2) for each pose: where the lines lie that should be seen from it, as they can be from the next of a grid.
    """
    lines = [robot.camera_from_world(pose).apply(_seen_near(robot, pose)) for pose in poses]
    seen, inside = robot.camera.project_segments(np.concatenate(lines).reshape(-1, 2, 3), Pose.identity())
    ends = np.cumsum([len(some) for some in lines])[:-1]
    return [some[here] for some, here in zip(np.split(seen, ends), np.split(inside, ends), strict=True)]


def _seen_near(robot: RobotModel, pose: Pose2) -> Floats:
    """(n, 2, 3) the lines [m, world] that can be seen from the pose of a grid that is next to one."""
    turned = round(pose.heading_rad / GRID_RAD) % round(math.tau / GRID_RAD)
    nearest = (round(pose.x_m / GRID_M), round(pose.y_m / GRID_M), turned)
    of_grid = Pose2(nearest[0] * GRID_M, nearest[1] * GRID_M, nearest[2] * GRID_RAD)
    return robot.world.cached("views of a grid", KEPT_VIEWS, (robot.camera, robot.mount.height_m, nearest),
                                  lambda: predict_lines(robot, of_grid).lines_world)


class ScoredView(NamedTuple):
    """Lines (n, 2, 2) that a place shows, and what each of them says (n,) if no other place shows it."""

    lines_px: Floats
    says: Floats


def score_view(lines_px: Floats, segments_px: Floats) -> ScoredView:
    """A view (n, 2, 2) held against segments (k, 2, 2): of each line, what is accounted for beyond a half speaks for
    its view, what is missing beyond a half against it.
    """
    lines = np.minimum(np.linalg.norm(lines_px[:, 1] - lines_px[:, 0], axis=1), LONG_PX) / LINE_PX
    return ScoredView(lines_px, lines * (_covered(lines_px, segments_px, TOLERANCE_PX, TOLERANCE_RAD) - 0.5))


def margin(one: ScoredView, other: ScoredView) -> float:
    """By how many lines the same segments speak rather for one view than for another: only lines count that the other
    view lacks.
    """
    return _told(one, other) - _told(other, one)


def _told(view: ScoredView, other: ScoredView) -> float:
    return float(np.sum(view.says * (1.0 - _covered(view.lines_px, other.lines_px, ALIKE_PX, ALIKE_RAD))))


def _covered(lines_px: Floats, by_px: Floats, tolerance_px: float, tolerance_rad: float) -> Floats:
    if not len(lines_px) or not len(by_px):
        return np.zeros(len(lines_px))
    return np.nan_to_num(compute_coverage(lines_px, by_px, tolerance_px, tolerance_rad))
