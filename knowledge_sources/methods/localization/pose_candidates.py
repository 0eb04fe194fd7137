"""Where on a floor could the robot be? All places of all rooms and all headings that the level lines leave, scored at
once against everything that was seen; the best are moved to where they fit best.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.manhattan import RIGHT_ANGLE_RAD, find_level_direction
from knowledge_sources.methods.localization.chamfer import ChamferMaps, compute_chamfer_maps, compute_chamfer_scores
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.methods.localization.visibility_map import VisibilityMap, get_visibility_map
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DOUBT = 50.0
"""As if so many more points were looked for that agree by chance: few points are no evidence."""
STRIDE = 2
"""On the grid only one of so many points is looked for."""
APART_M, APART_RAD = 0.45, math.radians(10.0)
"""Proposals nearer to each other than this are one."""
CLIMBED = 60
"""So many of the best places of the grid are moved to where they fit best."""
WORTH = 0.6
"""What fits less than this part as well as the best is no proposal."""
CLIMB = ((0.1, math.radians(0.8)), (0.05, math.radians(0.5)))
"""Steps of place [m] and heading [rad] of the rounds of moving."""


@dataclass(frozen=True, slots=True)
class PoseCandidate:
    """A pose that is worth a closer look: where the robot is now, in which room, and how well it fits (at most 1)."""

    room: str
    world_from_robot: Pose2
    score: float


def find_pose_candidates(
    robot: RobotModel, glances: Sequence[CameraView], rooms: Sequence[str], most: int
) -> tuple[PoseCandidate, ...]:
    """The places and headings in these rooms that fit all glances best, the best first, distinct from each other.

    Empty where no glance shows a level line.
    """
    search = _Search.of(robot, glances)
    if search is None:
        return ()
    poses, owners, scores = [np.zeros((0, 3))], [np.zeros(0, np.int64)], [np.zeros(0)]
    views = [get_visibility_map(robot.world, room, robot.mount.height_m) for room in rooms]
    for number, view in enumerate(views):
        if len(view.positions):
            poses.append(search.grid(view))
            owners.append(np.full(len(poses[-1]), number))
            scores.append(search.scores(view, poses[-1], np.tile(view.cell, 4), STRIDE))
    at, owner, score = np.concatenate(poses), np.concatenate(owners), np.concatenate(scores)
    first = _distinct(at, score, CLIMBED)
    climbed = [search.climbed(views[owner[i]], at[i]) for i in first]
    ends = np.array([pose for pose, _ in climbed]).reshape(-1, 3)
    fits = np.array([fit for _, fit in climbed])
    least = WORTH * float(np.max(fits, initial=0.0))
    return tuple(PoseCandidate(rooms[owner[first[i]]], Pose2(*ends[i]), float(fits[i]))
                 for i in _distinct(ends, fits, most) if fits[i] >= least)


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """What poses are scored by."""

    robot: RobotModel
    glances: tuple[CameraView, ...]
    maps: tuple[ChamferMaps, ...]
    direction_rad: float

    @staticmethod
    def of(robot: RobotModel, glances: Sequence[CameraView]) -> _Search | None:
        mount = robot.mount.camera_from_robot
        richest = sorted(glances, key=lambda g: -_length(g.segments_px))
        found = [(g, d) for g in richest if (d := find_level_direction(g.segments_px, robot.camera, mount)) is not None]
        if not found:
            return None
        glance, direction = found[0]
        maps = tuple(compute_chamfer_maps(g.segments_px, robot.camera) for g in glances)
        return _Search(robot, tuple(glances), maps, direction + glance.now_from_then.heading_rad)

    def grid(self, view: VisibilityMap) -> Floats:
        """(4 n, 3) the places of a room, with each of the four headings that its walls leave."""
        headings = [view.axis_rad - self.direction_rad + k * RIGHT_ANGLE_RAD for k in range(4)]
        return np.concatenate([np.column_stack([view.positions, np.full(len(view.positions), h)]) for h in headings])

    def scores(self, view: VisibilityMap, poses: Floats, cells: Ints, stride: int = 1) -> Floats:
        """(n,) how much better than chance the lines in sight agree with all glances."""
        total = np.zeros((len(poses), 3))
        for glance, maps in zip(self.glances, self.maps, strict=True):
            g = glance.now_from_then
            c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
            then = np.column_stack([poses[:, 0] + c * g.x_m - s * g.y_m, poses[:, 1] + s * g.x_m + c * g.y_m,
                                    poses[:, 2] + g.heading_rad])
            total += compute_chamfer_scores(
                maps, self.robot.camera, self.robot.mount.camera_from_robot, then, view.points, view.directions,
                view.first, view.visible, cells, stride)
        return np.asarray((total[:, 0] - total[:, 1]) / (total[:, 2] + DOUBT / stride))

    def climbed(self, view: VisibilityMap, pose: Floats) -> tuple[Floats, float]:
        """The pose moved to where it fits best, and how well."""
        cell, score = int(np.argmin(np.sum((view.positions - pose[:2]) ** 2, axis=1))), 0.0
        for step_m, step_rad in CLIMB:
            near = pose + _AROUND * (step_m, step_m, step_rad)
            fits = self.scores(view, near, np.full(len(near), view.cell[cell]))
            best = int(np.argmax(fits))
            pose, score = near[best], float(fits[best])
        return pose, score


_AROUND = np.stack(np.meshgrid((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), indexing="ij"),
                   axis=-1).reshape(-1, 3)
_AROUND.setflags(write=False)


def _length(segments_px: Floats) -> float:
    return float(np.sum(np.linalg.norm(segments_px[:, 1] - segments_px[:, 0], axis=1)))


def _distinct(poses: Floats, scores: Floats, most: int) -> list[int]:
    """Numbers of the best poses (n, 3), the best first, each apart from those before it."""
    kept: list[int] = []
    order = np.argsort(-scores, kind="stable")
    free = np.ones(len(poses), bool)
    for i in order.tolist():
        if free[i]:
            kept.append(i)
            if len(kept) == most:
                break
            off = poses - poses[i]
            turned = np.abs(np.remainder(off[:, 2] + math.pi, 2.0 * math.pi) - math.pi)
            free &= (np.hypot(off[:, 0], off[:, 1]) > APART_M) | (turned > APART_RAD)
    return kept


def are_distinct(a: Pose2, b: Pose2) -> bool:
    """Whether two poses are two candidates."""
    return a.distance_to(b) > APART_M or abs(wrap_angle(a.heading_rad - b.heading_rad)) > APART_RAD
