"""Pose candidates on a floor: grid search by chamfer matching, hill climbing, non-maximum suppression.

All positions of all rooms, with the four headings that level lines leave, are scored against all views at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats, Ints
from knowledge_sources.methods.features.manhattan import RIGHT_ANGLE_RAD, find_level_direction
from knowledge_sources.methods.localization.chamfer import ChamferMaps, compute_chamfer_maps, compute_chamfer_scores
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.methods.localization.visibility_map import VisibilityMap, get_visibility_map
from knowledge_sources.settings import DEFAULT, Settings
from knowledge_sources.settings.localization import LocalizationSettings
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

_NEIGHBORS = np.stack(np.meshgrid((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), indexing="ij"),
                      axis=-1).reshape(-1, 3)
_NEIGHBORS.setflags(write=False)
"""(27, 3) steps of hill climbing in x, y and heading."""


@dataclass(frozen=True, slots=True)
class PoseCandidate:
    """A pose of the robot now that is worth refining: its room, the pose, and its score (at most 1)."""

    room: str
    world_from_robot: Pose2
    score: float


def find_pose_candidates(
    robot: RobotModel, views: Sequence[CameraView], rooms: Sequence[str], max_count: int, settings: Settings = DEFAULT
) -> tuple[PoseCandidate, ...]:
    """Find the poses in these rooms that fit all views best, the best first, distinct from each other.

    Empty where no view shows level lines.
    """
    search = _Search.from_views(robot, views, settings)
    if search is None:
        return ()
    tuning = settings.localization
    poses, owners, scores = [np.zeros((0, 3))], [np.zeros(0, np.int64)], [np.zeros(0)]
    maps = [get_visibility_map(robot.world, room, robot.mount.height_m, tuning) for room in rooms]
    for number, room_map in enumerate(maps):
        if len(room_map.positions):
            poses.append(search.build_grid(room_map))
            owners.append(np.full(len(poses[-1]), number))
            scores.append(search.score(room_map, poses[-1], np.tile(room_map.cell, 4), tuning.grid_stride))
    at, owner, score = np.concatenate(poses), np.concatenate(owners), np.concatenate(scores)
    first = _suppress(at, score, tuning.max_climbed, tuning)
    climbed = [search.climb(maps[owner[i]], at[i]) for i in first]
    ends = np.array([pose for pose, _ in climbed]).reshape(-1, 3)
    fits = np.array([fit for _, fit in climbed])
    min_score = tuning.min_relative_score * float(np.max(fits, initial=0.0))
    return tuple(PoseCandidate(rooms[owner[first[i]]], Pose2(*ends[i]), float(fits[i]))
                 for i in _suppress(ends, fits, max_count, tuning) if fits[i] >= min_score)


def are_distinct(a: Pose2, b: Pose2, settings: LocalizationSettings = DEFAULT.localization) -> bool:
    """Whether two poses are far enough apart to be two candidates."""
    return (a.distance_to(b) > settings.min_candidate_distance_m
            or abs(wrap_angle(a.heading_rad - b.heading_rad)) > settings.min_candidate_angle_rad)


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """What poses are scored by: the views, their chamfer maps, and the direction of level lines in the robot's frame.
    """

    robot: RobotModel
    views: tuple[CameraView, ...]
    maps: tuple[ChamferMaps, ...]
    direction_rad: float
    settings: LocalizationSettings

    @staticmethod
    def from_views(robot: RobotModel, views: Sequence[CameraView], settings: Settings) -> _Search | None:
        """None where no view shows level lines. The view with the longest segments that does is taken."""
        mount = robot.mount.camera_from_robot
        for view in sorted(views, key=lambda v: -_total_length(v.segments_px)):
            direction = find_level_direction(view.segments_px, robot.camera, mount, settings.features)
            if direction is not None:
                maps = tuple(compute_chamfer_maps(v.segments_px, robot.camera, settings.localization) for v in views)
                heading = direction + view.now_from_then.heading_rad
                return _Search(robot, tuple(views), maps, heading, settings.localization)
        return None

    def build_grid(self, room_map: VisibilityMap) -> Floats:
        """(4 n, 3) the positions of a room, with each of the four headings that its walls leave."""
        headings = [room_map.axis_rad - self.direction_rad + k * RIGHT_ANGLE_RAD for k in range(4)]
        positions = room_map.positions
        return np.concatenate([np.column_stack([positions, np.full(len(positions), h)]) for h in headings])

    def score(self, room_map: VisibilityMap, poses: Floats, cell: Ints, stride: int = 1) -> Floats:
        """(n,) by how much the visible points agree with all views beyond chance."""
        total = np.zeros((len(poses), 3))
        for view, maps in zip(self.views, self.maps, strict=True):
            g = view.now_from_then
            c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
            then = np.column_stack([poses[:, 0] + c * g.x_m - s * g.y_m, poses[:, 1] + s * g.x_m + c * g.y_m,
                                    poses[:, 2] + g.heading_rad])
            total += compute_chamfer_scores(
                maps, self.robot.camera, self.robot.mount.camera_from_robot, then, room_map.points,
                room_map.directions, room_map.first, room_map.visible, cell, stride, self.settings)
        return np.asarray((total[:, 0] - total[:, 1]) / (total[:, 2] + self.settings.prior_points / stride))

    def climb(self, room_map: VisibilityMap, pose: Floats) -> tuple[Floats, float]:
        """The best pose after one coarse and one fine step, and its score."""
        nearest, score = int(np.argmin(np.sum((room_map.positions - pose[:2]) ** 2, axis=1))), 0.0
        t = self.settings
        for step_m, step_rad in ((t.coarse_climb_m, t.coarse_climb_rad), (t.fine_climb_m, t.fine_climb_rad)):
            near = pose + _NEIGHBORS * (step_m, step_m, step_rad)
            scores = self.score(room_map, near, np.full(len(near), room_map.cell[nearest]))
            best = int(np.argmax(scores))
            pose, score = near[best], float(scores[best])
        return pose, score


def _total_length(segments_px: Floats) -> float:
    return float(np.sum(np.linalg.norm(segments_px[:, 1] - segments_px[:, 0], axis=1)))


def _suppress(poses: Floats, scores: Floats, max_count: int, settings: LocalizationSettings) -> list[int]:
    """Non-maximum suppression: indices of the best poses (n, 3), the best first, each distinct from those before."""
    kept: list[int] = []
    order = np.argsort(-scores, kind="stable")
    free = np.ones(len(poses), bool)
    for i in order.tolist():
        if free[i]:
            kept.append(i)
            if len(kept) == max_count:
                break
            off = poses - poses[i]
            turned = np.abs(np.remainder(off[:, 2] + math.pi, 2.0 * math.pi) - math.pi)
            free &= ((np.hypot(off[:, 0], off[:, 1]) > settings.min_candidate_distance_m)
                     | (turned > settings.min_candidate_angle_rad))
    return kept
