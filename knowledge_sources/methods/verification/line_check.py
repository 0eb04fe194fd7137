"""Is the robot at this pose? The lines that should be seen from it, against the segments that were found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.pose.planar import compute_camera_poses
from knowledge_sources.methods.verification.agreement import Agreement, compute_agreement
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
SHIFTS_M = (0.35, 0.7)
TURNS_RAD = (-0.14, -0.07, 0.07, 0.14)
LEAST_ACCOUNTED = 6
LEAST_COVERAGE = 0.4
MOST_P_FALSE = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class LineCheck:
    """The evidence for a pose.

    Attributes:
        agreement: which lines are accounted for.
        coverage: part of their length in view that is, 0..1.
        projected_px: (m, 2, 2) the lines at this pose, NaN where not in view.
    """

    agreement: Agreement
    coverage: float
    projected_px: Floats

    @property
    def holds(self) -> bool:
        """Whether enough is accounted for, and could not well be by chance."""
        a = self.agreement
        return a.matched >= LEAST_ACCOUNTED and self.coverage >= LEAST_COVERAGE and a.p_false <= MOST_P_FALSE


def check_lines(robot: RobotModel, lines_world: Floats, segments_px: Floats, world_from_robot: Pose2) -> LineCheck:
    """Compare model lines (m, 2, 3), visible from there, with segments (k, 2, 2) found in the image."""
    state = np.array([world_from_robot.x_m, world_from_robot.y_m, world_from_robot.heading_rad])
    here, displaced = np.split(_projected(robot, lines_world, np.concatenate([state[None], _wrong(state)])), [1])
    found = compute_agreement(here[0], segments_px, displaced)
    lengths = np.linalg.norm(here[0, :, 1] - here[0, :, 0], axis=1)
    return LineCheck(found, found.total(lengths), here[0])


def _projected(robot: RobotModel, lines_world: Floats, states: Floats) -> Floats:
    """(p, m, 2, 2) the lines as seen from states (p, 3), world, NaN where not in view [px]."""
    turns, shifts = compute_camera_poses(states, robot.mount.camera_from_robot)
    lines_camera = lines_world.reshape(1, -1, 3) @ np.swapaxes(turns, 1, 2) + shifts[:, None]
    seen, _ = robot.camera.project_segments(lines_camera.reshape(-1, 2, 3), Pose.identity())
    return seen.reshape(len(states), -1, 2, 2)


def _wrong(state: Floats) -> Floats:
    """(p, 3) states nearby at which the robot is not: what agrees there agrees by chance."""
    c, s = np.cos(state[2]), np.sin(state[2])
    away = np.array([(by * x, by * y) for by in SHIFTS_M for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))])
    shifts = np.repeat(away @ np.array([[c, s], [-s, c]]), len(TURNS_RAD), axis=0)
    return np.asarray(state + np.column_stack([shifts, np.tile(TURNS_RAD, len(away))]))
