"""How well does a pose bear out all that was seen? Line by line, glance by glance, against what chance would do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.methods.verification.agreement import compute_agreement, compute_coverage
from knowledge_sources.methods.verification.predicted_lines import predict_lines
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_lines

Floats = NDArray[np.float64]

SEEN_WHERE_IT_IS = 0.85
"""A line that should be seen is, at the right pose: the rest is hidden by what the model lacks, or too faint."""
CHANCE = (0.04, 0.6)
"""Between these the probability that a line is accounted for at a wrong pose is believed."""
TEMPER = 0.5
"""Lines of one thing are seen or missed together: each counts for half a measurement."""
ENOUGH = 8
"""A glance with fewer expected lines says nothing alone."""
LONG_PX = 25.0
"""Segments at least so long should be of something that the model has."""
SHIFTS_M, TURNS_RAD = (0.35, 0.7), (-0.1, 0.1)
"""Poses so far off show what agrees by chance."""


@dataclass(frozen=True, slots=True)
class PoseLikelihood:
    """What speaks for a pose.

    Attributes:
        seen: lines that should be in view, over all glances; accounted: those that are.
        likelihood: logarithm of how much likelier what was seen is there than at a place drawn by chance.
        explained: part of the length of long segments that lies on something that the model shows there, 0..1.
        weakest: the least part of the expected lines that is accounted for in a glance that expects enough of them.
    """

    seen: int
    accounted: int
    likelihood: float
    explained: float
    weakest: float

    def __str__(self) -> str:
        return (f"{self.accounted} of {self.seen} model lines that should be seen from there are in the pictures,"
                f" and {self.explained:.0%} of what is seen is in the model")


def compute_pose_likelihood(robot: RobotModel, glances: Sequence[CameraView], world_from_now: Pose2) -> PoseLikelihood:
    """What all glances say of the pose that the robot has now."""
    seen = accounted = 0
    likelihood, weakest, lengths, explained = [0.0], 1.0, 0.0, 0.0
    for glance in glances:
        then = glance.then(world_from_now)
        lines = predict_lines(robot, then).lines_world
        views = _projected(robot, lines, [then, *_wrong_poses(then)])
        found = compute_agreement(views[0], glance.segments_px, views[1:])
        seen, accounted = seen + found.visible, accounted + found.matched
        likelihood.append(log_likelihood(found.matched, found.visible, found.chance))
        if found.visible >= ENOUGH:
            weakest = min(weakest, found.matched / found.visible)
        length, part = _explained(robot, glance, then)
        lengths, explained = lengths + length, explained + part
    part = explained / lengths if lengths > 0.0 else 0.0
    return PoseLikelihood(seen, accounted, math.fsum(likelihood), part, weakest)


def log_likelihood(accounted: int, seen: int, chance: float) -> float:
    """Of so many lines found of those expected, over what it would be by chance."""
    p = min(max(chance, CHANCE[0]), CHANCE[1])
    found, missed = math.log(SEEN_WHERE_IT_IS / p), math.log((1.0 - SEEN_WHERE_IT_IS) / (1.0 - p))
    return TEMPER * (accounted * found + (seen - accounted) * missed)


def _projected(robot: RobotModel, lines_world: Floats, poses: Sequence[Pose2]) -> Floats:
    """(p, m, 2, 2) the lines as seen from each pose, NaN where not in view [px]."""
    lines_camera = np.array([robot.camera_from_world(pose).apply(lines_world) for pose in poses])
    seen, _ = robot.camera.project_segments(lines_camera.reshape(-1, 2, 3), Pose.identity())
    return np.asarray(seen.reshape(len(poses), len(lines_world), 2, 2))


def _wrong_poses(pose: Pose2) -> list[Pose2]:
    shifts = [(s * x, s * y) for s in SHIFTS_M for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    return [pose @ Pose2(x, y, turn) for x, y in shifts for turn in TURNS_RAD]


def _explained(robot: RobotModel, glance: CameraView, then: Pose2) -> tuple[float, float]:
    """Length of the long segments, and of the part that lies on what the model shows, even faint lines [px]."""
    length = np.linalg.norm(glance.segments_px[:, 1] - glance.segments_px[:, 0], axis=1)
    long = length >= LONG_PX
    if not np.any(long):
        return 0.0, 0.0
    shown = visible_lines(robot.world, robot.camera, robot.camera_from_world(then), min_length_px=4.0,
                          min_contrast=0.01, min_separation_px=0.0)
    covered = compute_coverage(glance.segments_px[long], shown.segments_px, 3.0, 0.06)
    return float(np.sum(length[long])), float(np.sum(length[long] * covered))
