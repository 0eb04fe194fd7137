"""Is the robot at this pose? The lines that should be seen from it, against the segments that were found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.agreement import Agreement, agreement
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
SHIFTS_M = (0.35, 0.7)
TURNS_RAD = (-0.14, -0.07, 0.07, 0.14)
LEAST_ACCOUNTED = 6
LEAST_COVERAGE = 0.4
MOST_P_FALSE = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Verification:
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
        return a.accounted >= LEAST_ACCOUNTED and self.coverage >= LEAST_COVERAGE and a.p_false <= MOST_P_FALSE


def verify(robot: RobotModel, lines_world: Floats, segments_px: Floats, world_from_robot: Pose2) -> Verification:
    """Compare model lines (m, 2, 3), visible from there, with segments (k, 2, 2) found in the image."""
    here, *displaced = _projected(robot, lines_world, [world_from_robot, *_wrong_poses(world_from_robot)])
    found = agreement(here, segments_px, np.array(displaced))
    lengths = np.linalg.norm(here[:, 1] - here[:, 0], axis=1) if len(here) else np.zeros(0)
    return Verification(found, found.total(lengths), here)


def _projected(robot: RobotModel, lines_world: Floats, poses: list[Pose2]) -> Floats:
    """(p, m, 2, 2) the lines as seen from each pose, NaN where not in view [px]."""
    lines_camera = np.array([robot.camera_from_world(pose).apply(lines_world) for pose in poses])
    seen, _ = robot.camera.project_segments(lines_camera.reshape(-1, 2, 3), Pose.identity())
    return seen.reshape(len(poses), len(lines_world), 2, 2)


def _wrong_poses(pose: Pose2) -> list[Pose2]:
    """Poses nearby at which the robot is not: what agrees there agrees by chance."""
    shifts = [(s * x, s * y) for s in SHIFTS_M for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    return [pose @ Pose2(x, y, turn) for x, y in shifts for turn in TURNS_RAD]
