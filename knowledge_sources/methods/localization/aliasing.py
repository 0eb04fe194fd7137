"""Aliases of a known pose: is the robot perhaps at the next door?

Poses that lie to their room, or to their door, as a pose lies to its own look alike by walls and doors. A pose is
compared with these, and with others of its room at which the picture fits as well. Lines that both views show support
both; what tells them apart are the lines that only one of them shows.

Visible lines are computed on a grid of poses and kept; only their projection is of the exact pose. So they can be
computed beforehand, while the robot has yet to look.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.localization.next_view import SAME_LINE_PX, SAME_LINE_RAD
from knowledge_sources.methods.localization.pose_candidates import are_distinct, find_pose_candidates
from knowledge_sources.methods.localization.refinement import refine_to_likelier
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.methods.verification import (
    LINE_TOLERANCE_RAD,
    MAX_LINE_WEIGHT_PX,
    MIN_COVERED_FRACTION,
    compute_coverage,
    find_errors,
    find_tolerances_px,
    predict_lines,
)
from world_models.building.building import Building
from world_models.building.model_errors import LineErrors
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel

MAX_SIZE_DIFFERENCE_M = 0.1  # difference in the sides of rooms that may be alike
ALIAS_LINE_LENGTH_PX = 30.0  # length that counts as one line of a margin
MAX_FITTING_POSES = 14  # most poses of a room that are tried because the picture fits
VIEW_GRID_M = 0.1  # grid of positions on which visible lines are computed and kept
VIEW_GRID_RAD = math.radians(2.0)  # grid of headings on which visible lines are computed and kept
CACHED_VIEWS = 64  # predicted views on the grid that are kept


def find_repetitions(building: Building, room: str, pose: Pose2, rooms: Sequence[str]) -> Iterator[tuple[str, Pose2]]:
    """Yield room and pose of every place in ``rooms`` that looks like ``pose`` in ``room`` by walls and doors alone.

    Rooms of the same size are laid on each other, turned by right angles, also a room on itself; and the door nearest
    to the pose is laid on every other door.
    """
    middle, size = _find_box(building, room)
    own = Pose2(pose.x_m - float(middle[0]), pose.y_m - float(middle[1]), pose.heading_rad)
    for other in rooms:
        there, sides = _find_box(building, other)
        for quarter in range(4):
            turned = size if quarter % 2 == 0 else size[::-1]
            if np.all(np.abs(turned - sides) < MAX_SIZE_DIFFERENCE_M) and (quarter or other != room):
                yield other, Pose2(float(there[0]), float(there[1]), quarter * 0.5 * math.pi) @ own
    doors = [(name, doorway.pose_from(name)) for name in (room, *(r for r in rooms if r != room))
             for doorway in building.doorways_of(name)]
    nearest = min((door for name, door in doors if name == room), key=pose.distance_to, default=None)
    if nearest is not None:
        yield from ((name, door @ (nearest.inverse() @ pose)) for name, door in doors if door is not nearest)


def _find_box(building: Building, room: str) -> tuple[Floats, Floats]:
    """Middle and sides of the rectangle around a room [m, world]."""
    corners = building.outline(room)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return 0.5 * (low + high), high - low


class AliasView(NamedTuple):
    """The pose that is hardest to tell from the believed one, and the lines by which the picture tells them apart."""

    world_from_robot: Pose2
    margin: float


def list_aliases(
    robot: RobotModel, segments_px: Floats, room: str, pose: Pose2, *, search: bool = False,
) -> list[AliasView]:
    """List the other poses of a room at which segments (k, 2, 2) may have been seen, each with its margin.

    Tried are the poses at which the room repeats itself and, with ``search``, wherever else in it the segments fit:
    notices and painted doors that no plan shows may repeat themselves. A search takes half a second.
    """
    others = [*find_repeated_poses(robot, room, pose),
              *(find_fitting_poses(robot, segments_px, room, pose) if search else ())]
    if not others:
        return []
    own, *there = (score_view(*view, segments_px) for view in predict_views_on_grid(robot, (pose, *others)))
    return [AliasView(other, compute_margin(own, view)) for other, view in zip(others, there, strict=True)]


def compare_places(
    one: tuple[RobotModel, Pose2], other: tuple[RobotModel, Pose2], segments_px: Floats
) -> float:
    """By how many lines segments (k, 2, 2) support one robot and pose more than another, as on another storey."""
    views = (predict_views_on_grid(robot, (pose,))[0] for robot, pose in (one, other))
    return compute_margin(*(score_view(*view, segments_px) for view in views))


def find_repeated_poses(robot: RobotModel, room: str, pose: Pose2) -> list[Pose2]:
    """Find the other poses within a room at which its plan repeats itself."""
    outline = robot.world.outline(room)
    low, high = outline.min(axis=0), outline.max(axis=0)
    return [other for _, other in find_repetitions(robot.world, room, pose, (room,))
            if np.all((low <= other.position) & (other.position <= high))]


def find_fitting_poses(
    robot: RobotModel, segments_px: Floats, room: str, pose: Pose2
) -> list[Pose2]:
    """Find the poses of a room, distinct from a pose, at which segments (k, 2, 2) fit best."""
    views = (CameraView(segments_px, Pose2(0.0, 0.0, 0.0), np.zeros((3, 3))),)
    candidates = find_pose_candidates(robot, views, (room,), MAX_FITTING_POSES)
    refined = (refine_to_likelier(robot, views, c.world_from_robot)[0] for c in candidates)
    return [other for other in refined if are_distinct(other, pose)]


def precompute_views(robot: RobotModel, room: str, pose: Pose2) -> None:
    """Compute what should be visible from a pose and from where the room repeats itself, so that it is at hand."""
    predict_views_on_grid(robot, (pose, *find_repeated_poses(robot, room, pose)))


def predict_views_on_grid(robot: RobotModel, poses: Sequence[Pose2]) -> list[tuple[Floats, Floats]]:
    """Predict the view from each pose: the lines (n, 2, 2) [px] visible from the nearest pose of the grid.

    With each comes how far (n,) a segment may lie from it that covers it [px].
    """
    found = [_find_visible_on_grid(robot, pose) for pose in poses]
    lines = [robot.camera_from_world(pose).apply(some) for pose, (some, _) in zip(poses, found, strict=True)]
    seen, inside = robot.camera.project_segments(np.concatenate(lines).reshape(-1, 2, 3), Pose.identity())
    ends = np.cumsum([len(some) for some in lines])[:-1]
    return [(some[here], find_tolerances_px(robot, *of_grid, pose)[here]) for some, here, of_grid, pose in zip(
        np.split(seen, ends), np.split(inside, ends), found, poses, strict=True)]


class ScoredView(NamedTuple):
    """Lines (n, 2, 2) of a view, and by how much (n,) each supports the view, or if negative contradicts it [lines]."""

    lines_px: Floats
    scores: Floats


def score_view(lines_px: Floats, tolerances_px: Floats, segments_px: Floats) -> ScoredView:
    """Score the lines of a view (n, 2, 2) by how much of each segments (k, 2, 2) cover, more or less than half."""
    length = np.linalg.norm(lines_px[:, 1] - lines_px[:, 0], axis=1)
    lines = np.minimum(length, MAX_LINE_WEIGHT_PX) / ALIAS_LINE_LENGTH_PX
    covered = _cover(lines_px, segments_px, tolerances_px, LINE_TOLERANCE_RAD)
    return ScoredView(lines_px, lines * (covered - MIN_COVERED_FRACTION))


def compute_margin(one: ScoredView, other: ScoredView) -> float:
    """Compute by how many lines the segments support one view more than another, by the lines not in both."""
    return _sum_own(one, other) - _sum_own(other, one)


def _find_visible_on_grid(robot: RobotModel, pose: Pose2) -> tuple[Floats, LineErrors]:
    """The lines (n, 2, 3) [m, world] that are visible from the pose of the grid nearest to a pose, and their errors.

    Kept.
    """
    grid_m, grid_rad = VIEW_GRID_M, VIEW_GRID_RAD
    turned = round(pose.heading_rad / grid_rad) % round(math.tau / grid_rad)
    nearest = (round(pose.x_m / grid_m), round(pose.y_m / grid_m), turned)
    of_grid = Pose2(nearest[0] * grid_m, nearest[1] * grid_m, nearest[2] * grid_rad)
    key = robot.camera, robot.mount.height_m, nearest

    def predict() -> tuple[Floats, LineErrors]:
        lines = predict_lines(robot, of_grid)
        return lines.lines_world, find_errors(robot, lines)

    return robot.world.cached("views on a grid", CACHED_VIEWS, key, predict)


def _sum_own(view: ScoredView, other: ScoredView) -> float:
    """The sum of the scores of the lines that another view lacks."""
    common = _cover(view.lines_px, other.lines_px, SAME_LINE_PX, SAME_LINE_RAD)
    return float(np.sum(view.scores * (1.0 - common)))


def _cover(lines_px: Floats, by_px: Floats, tolerance_px: float | Floats, tolerance_rad: float) -> Floats:
    """(n,) covered part of each line, 0 where it is not in view."""
    return np.nan_to_num(compute_coverage(lines_px, by_px, tolerance_px, tolerance_rad))
