"""Views that were taken while the pose was unknown, related by the motions between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.features.manhattan import RIGHT_ANGLE_RAD, find_level_direction
from knowledge_sources.settings import DEFAULT, Settings
from world_models.camera import Camera
from world_models.frames import Pose, Pose2


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """The line segments of one picture, and where the robot was when it was taken.

    Attributes:
        segments_px: (n, 2, 2) found in the picture.
        now_from_then: the robot's pose then, in its frame now.
        covariance: (3, 3) of ``now_from_then`` over (x, y, heading).
    """

    segments_px: Floats
    now_from_then: Pose2
    covariance: Floats

    def pose_then(self, world_from_now: Pose2) -> Pose2:
        """The robot's pose when the picture was taken, if it is at ``world_from_now`` now."""
        return world_from_now @ self.now_from_then


def propagate_pose(now_from_then: Pose2, covariance: Floats, step: Pose2, step_covariance: Floats
                   ) -> tuple[Pose2, Floats]:
    """Express an earlier pose in the robot's frame after one more step, with its covariance (3, 3)."""
    after = step.inverse() @ now_from_then
    c, s = math.cos(step.heading_rad), math.sin(step.heading_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    lever = np.eye(3)
    lever[0, 2], lever[1, 2] = -after.y_m, after.x_m  # an error in the step's heading moves the earlier position
    return after, np.asarray(turn @ covariance @ turn.T + lever @ turn @ step_covariance @ turn.T @ lever.T)


def join_covariances(views: Sequence[CameraView]) -> Floats:
    """Join the covariances of all views' motions, (3n, 3n) over (x, y, heading) of each, in the robot's frame now.

    Views share what was driven after the later one of them: an error of it moves both. Where a view's covariance is
    smaller than that (its turn was measured), the least is added that makes the whole a covariance.
    """
    size, joint = len(views), np.zeros((3 * len(views), 3 * len(views)))
    for k, later in enumerate(views):
        joint[3 * k:3 * k + 3, 3 * k:3 * k + 3] = later.covariance
        for i in range(k):
            shared = find_lever(later.now_from_then, views[i].now_from_then) @ later.covariance
            joint[3 * i:3 * i + 3, 3 * k:3 * k + 3], joint[3 * k:3 * k + 3, 3 * i:3 * i + 3] = shared, shared.T
    values, axes = np.linalg.eigh(joint) if size else (np.zeros(0), joint)
    return np.asarray(axes * np.maximum(values, 0.0) @ axes.T)


def find_lever(here: Pose2, there: Pose2) -> Floats:
    """Jacobian (3, 3) of a pose by one that it is fixed to: an error of that one's heading moves it aside."""
    lever = np.eye(3)
    lever[0, 2], lever[1, 2] = here.y_m - there.y_m, there.x_m - here.x_m
    return lever


def align_headings(
    views: Sequence[CameraView], camera: Camera, camera_from_robot: Pose, settings: Settings = DEFAULT
) -> tuple[CameraView, ...]:
    """Correct the turns between views, in the order in which they were taken, by the level lines they show.

    Odometry errs by a fortieth of a turn. Level lines run in two directions at right angles (Manhattan world), which
    are seen to a tenth of a degree; odometry tells which of the four directions is which. The last view is from where
    the robot is now. If it shows no level lines, the reference is the last view that does, and all turns are known no
    better than that view's.
    """
    axes = _find_axes(views, camera, camera_from_robot, settings)
    if len(axes) < 2:
        return tuple(views)
    tuning, reference = settings.localization, max(axes)
    axis = axes[reference]
    variance = float(views[reference].covariance[2, 2]) + tuning.level_heading_sigma_rad**2
    out, off_later = [views[-1]], 0.0
    for k in range(len(views) - 2, -1, -1):
        view, off = views[k], math.remainder(axis - axes[k], RIGHT_ANGLE_RAD) if k in axes else math.inf
        if abs(off) < tuning.max_heading_correction_rad and k != reference:
            view = replace(view, covariance=_limit_turn_variance(view.covariance, variance))
        else:
            off = off_later
        pose = _correct_turn(view, views[k + 1], out[-1].now_from_then, off_later - off)
        out.append(replace(view, now_from_then=pose))
        off_later = off
    return tuple(reversed(out))


def _find_axes(
    views: Sequence[CameraView], camera: Camera, camera_from_robot: Pose, settings: Settings
) -> dict[int, float]:
    """By index of the views that show level lines: their direction in the frame of now, modulo a right angle [rad]."""
    found = [find_level_direction(v.segments_px, camera, camera_from_robot, settings.features) for v in views]
    return {k: direction + view.now_from_then.heading_rad
            for k, (view, direction) in enumerate(zip(views, found, strict=True)) if direction is not None}


def _correct_turn(view: CameraView, later: CameraView, now_from_later: Pose2, more_rad: float) -> Pose2:
    """The pose of a view if the robot turned by so much more before it moved on to the later one."""
    step = Pose2(0.0, 0.0, more_rad) @ view.now_from_then.inverse() @ later.now_from_then
    return now_from_later @ step.inverse()


def _limit_turn_variance(covariance: Floats, variance: float) -> Floats:
    """The covariance (3, 3) after the turn was measured with a variance: what is correlated with it is known better."""
    known = float(covariance[2, 2])
    if known <= variance:
        return covariance
    gain = covariance[:, 2] / known
    return np.asarray(covariance - np.outer(gain, gain) * (known - variance))
