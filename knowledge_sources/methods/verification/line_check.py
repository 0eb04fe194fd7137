"""Is the robot at this pose, by its lines? Predicted model lines against the segments that were found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.pose.displacements import fit_displacements
from knowledge_sources.methods.pose.planar import compute_camera_poses, to_pose2
from knowledge_sources.methods.verification.agreement import Agreement, compute_agreement
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.pose import PoseSettings
from knowledge_sources.settings.verification import VerificationSettings
from world_models.building.model_errors import LineErrors
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel


@dataclass(frozen=True, slots=True, eq=False)
class LineCheck:
    """What the segments of a picture say of the lines predicted at a pose.

    Attributes:
        agreement: which lines are matched, and how many would be by chance.
        coverage: covered part of their length in view, 0..1.
        projected_px: (m, 2, 2) the lines at this pose, NaN where not in view.
    """

    agreement: Agreement
    coverage: float
    projected_px: Floats


def check_lines(
    robot: RobotModel, lines_world: Floats, segments_px: Floats, world_from_robot: Pose2,
    settings: VerificationSettings = DEFAULT.verification, errors: LineErrors | None = None,
    pose_settings: PoseSettings = DEFAULT.pose,
) -> LineCheck:
    """Compare model lines (m, 2, 3) [m, world], visible from a pose, with segments (k, 2, 2) of the picture.

    Where the model is inexact, by ``errors``, its lines are displaced as they fit best: at this pose, and as freely at
    the wrong ones at which chance is counted.
    """
    state = np.array([world_from_robot.x_m, world_from_robot.y_m, world_from_robot.heading_rad])
    states = np.concatenate([state[None], _displace(state, settings.displacement_m, settings.displacement_rad)])
    if errors is None or errors.is_exact:
        projected = _project(robot, lines_world, states)
    else:
        few = np.concatenate([states[:1], _take_few(states[1:])])
        projected = np.concatenate([
            _project_displaced(robot, lines_world, errors, segments_px, s, pose_settings) for s in few])
    here, displaced = np.split(projected, [1])
    agreement = compute_agreement(here[0], segments_px, displaced, settings)
    lengths = np.linalg.norm(here[0, :, 1] - here[0, :, 0], axis=1)
    return LineCheck(agreement, agreement.covered_length(lengths), here[0])


def _project(robot: RobotModel, lines_world: Floats, states: Floats) -> Floats:
    """(p, m, 2, 2) the lines as seen from states (p, 3), world, NaN where not in view [px]."""
    turns, shifts = compute_camera_poses(states, robot.mount.camera_from_robot)
    lines_camera = lines_world.reshape(1, -1, 3) @ np.swapaxes(turns, 1, 2) + shifts[:, None]
    seen, _ = robot.camera.project_segments(lines_camera.reshape(-1, 2, 3), Pose.identity())
    return seen.reshape(len(states), -1, 2, 2)


def _project_displaced(
    robot: RobotModel, lines_world: Floats, errors: LineErrors, segments_px: Floats, state: Floats,
    settings: PoseSettings,
) -> Floats:
    """(1, m, 2, 2) the lines as seen from a state (3,), displaced as they fit the segments best [px]."""
    fit = fit_displacements(
        lines_world, errors, segments_px, robot.camera, robot.mount.camera_from_robot, to_pose2(state),
        settings=settings)
    return _project(robot, fit.lines_world, state[None])


def _take_few(states: Floats) -> Floats:
    """(8, 3) of the wrong states (32, 3): each direction and distance, with one of the turns."""
    return states[[4 * k + k % 4 for k in range(8)]]


def _displace(state: Floats, shift_m: float, turn_rad: float) -> Floats:
    """(32, 3) wrong states around a state (x, y, heading): four directions, two distances, four turns."""
    c, s = np.cos(state[2]), np.sin(state[2])
    away = np.array([(by * x, by * y) for by in (shift_m, 2.0 * shift_m)
                     for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))])
    turns = turn_rad * np.array([-2.0, -1.0, 1.0, 2.0])
    shifts = np.repeat(away @ np.array([[c, s], [-s, c]]), len(turns), axis=0)
    return np.asarray(state + np.column_stack([shifts, np.tile(turns, len(away))]))
