"""What speaks for a pose, as a few numbers, each of which is better the larger it is.

A covariance looks the same in the wrong corridor; these do not. All follow from sets of lines, segments and faces, so
that their order does not matter.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.pose.planar import compute_point_jacobian
from knowledge_sources.methods.verification.agreement import compute_coverage
from knowledge_sources.methods.verification.color_check import ColorCheck
from knowledge_sources.methods.verification.line_check import LineCheck
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
LONG_PX = 100.0
"""Longer lines tell no more."""
STRICT_PX = 1.0
"""What lies so near its line does so because it is that line; chance spreads over the whole tolerance."""
STEPS = np.array([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.7, 0.7, 0.0), (0.7, -0.7, 0.0), (0.0, 0.0, 0.4)])
"""Ways off the pose (x, y [m], heading [rad]) of each of which lines must tell."""
MOST_PX_PER_M = 400.0
MOST_SIGMAS = 6.0
REACH = 4.0
"""Of three numbers that go together, one in a thousand lies further out than so many deviations."""
LEAST_PROBABILITY = 1e-12


@dataclass(frozen=True, slots=True)
class PoseEvidence:
    """What speaks for a pose; :mod:`knowledge_sources.methods.verification.pose_confidence` weighs it.

    Attributes:
        covered: part of the lines' length in view that is accounted for.
        weakest: the same, each line counting as far as it tells of the way off the pose of which least is told.
        sharp: part of what is accounted for that is so within a pixel.
        beyond_chance: how improbable it is that as many lines agree by chance: 0 (certain) to 1 (1e-12).
        lines: how many lines are accounted for, as log2(1 + n).
        near: how near the pose is to the belief, in deviations of both: 0 beyond 6, 1 where it is the same.
        faces: part of the faces that has the colours that the model says, beyond chance; 0 where none can be tested.
        faces_tested: how many faces were, as log2(1 + n).
    """

    covered: float
    weakest: float
    sharp: float
    beyond_chance: float
    lines: float
    near: float
    faces: float
    faces_tested: float

    @property
    def values(self) -> Floats:
        """(k,) in the order of the attributes."""
        return np.array(astuple(self))


NAMES = tuple(field.name for field in fields(PoseEvidence))


def compute_evidence(
    robot: RobotModel, lines_world: Floats, segments_px: Floats, pose: Pose2, covariance: Floats, belief: Pose2,
    belief_covariance: Floats, lines: LineCheck, faces: ColorCheck,
) -> PoseEvidence:
    """Of expected lines (m, 2, 3), segments (k, 2, 2), a fix and the belief that it was sought from (3, 3), all world.

    ``lines`` is what :func:`~knowledge_sources.methods.verification.line_check.check_lines` found, ``faces`` what the
    color check did.
    """
    found = np.nan_to_num(lines.agreement.coverage)
    span = np.linalg.norm(lines.projected_px[:, 1] - lines.projected_px[:, 0], axis=1)
    length = np.minimum(np.nan_to_num(span), LONG_PX)
    strict = np.nan_to_num(compute_coverage(lines.projected_px, segments_px, STRICT_PX, 0.06))
    told = length[:, None] * _told(robot, lines_world, pose)
    agreed = lines.agreement
    return PoseEvidence(
        covered=_part(length * found, length),
        weakest=float(min((_part(told[:, k] * found, told[:, k]) for k in range(len(STEPS))), default=0.0)),
        sharp=_part(length * strict, length * found),
        beyond_chance=math.log10(max(agreed.p_false, LEAST_PROBABILITY)) / math.log10(LEAST_PROBABILITY),
        lines=math.log2(1.0 + agreed.matched),
        near=1.0 - min(_sigmas(pose, belief, covariance + belief_covariance), MOST_SIGMAS) / MOST_SIGMAS,
        faces=max(faces.agreeing - faces.chance, 0.0) if faces.is_testable else 0.0,
        faces_tested=math.log2(1.0 + faces.count) if faces.is_testable else 0.0,
    )


def _part(of: Floats, all_of_it: Floats) -> float:
    whole = float(np.sum(all_of_it))
    return float(np.sum(of)) / whole if whole > 1e-9 else 0.0


def compute_motion_tolerance_px(robot: RobotModel, lines_world: Floats, pose: Pose2, covariance: Floats) -> float:
    """How far the lines (m, 2, 3) may lie from where they were expected, by the covariance (3, 3) of the place: the
    median over them of :data:`REACH` deviations across each [px]."""
    if not len(lines_world):
        return 0.0
    _, across = _across(robot, lines_world, pose)
    middle = across.mean(axis=1)
    return REACH * float(np.median(np.sqrt(np.einsum("nk,kl,nl->n", middle, covariance, middle))))


def _told(robot: RobotModel, lines_world: Floats, pose: Pose2) -> Floats:
    """(m, steps) how far each line moves across itself in the image for each of the steps off the pose, bounded."""
    if not len(lines_world):
        return np.zeros((0, len(STEPS)))
    ahead, across = _across(robot, lines_world, pose)
    moved = np.abs(across @ _in_world(pose).T).max(axis=1)
    moved[~ahead] = 0.0
    return np.asarray(np.minimum(moved, MOST_PX_PER_M))


def _across(robot: RobotModel, lines_world: Floats, pose: Pose2) -> tuple[NDArray[np.bool_], Floats]:
    """Which lines (m,) lie before the camera, and how their ends (m, 2, 3) move across them by (x, y, heading) [px]."""
    state, focal = np.array([pose.x_m, pose.y_m, pose.heading_rad]), np.array([robot.camera.fx, robot.camera.fy])
    mount = robot.mount.camera_from_robot
    points, pixels, slopes = compute_point_jacobian(lines_world.reshape(-1, 3), focal, state, mount)
    ends = pixels.reshape(-1, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    across = np.einsum("nj,nejk->nek", normal, slopes.reshape(-1, 2, 2, 3))
    return np.all(points[:, 2].reshape(-1, 2) > 0.1, axis=1), np.asarray(across)


def _in_world(pose: Pose2) -> Floats:
    """The steps, which are in the robot's frame, in the world's."""
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return np.asarray(STEPS @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def _sigmas(pose: Pose2, belief: Pose2, covariance: Any) -> float:
    """How far apart two poses are, in deviations."""
    off = np.array([pose.x_m - belief.x_m, pose.y_m - belief.y_m, wrap_angle(pose.heading_rad - belief.heading_rad)])
    return math.sqrt(max(0.0, float(off @ np.linalg.solve(covariance + 1e-12 * np.eye(3), off))))
