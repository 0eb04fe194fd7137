"""The log likelihood of a pose by all views: matched and missed lines, against what chance would match."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.localization.views import CameraView
from knowledge_sources.methods.verification.agreement import compute_agreement, compute_coverage
from knowledge_sources.methods.verification.predicted_lines import predict_lines
from knowledge_sources.settings import DEFAULT, Settings
from knowledge_sources.settings.localization import LocalizationSettings
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_lines


@dataclass(frozen=True, slots=True)
class PoseLikelihood:
    """How well a pose explains all views.

    Attributes:
        visible, matched: numbers of lines that should be in view, over all views, and of those that are found.
        log_likelihood: logarithm of the likelihood ratio of this pose to one drawn by chance.
        explained: part of the length of long segments that lies on a model line, 0..1.
        weakest_view: smallest matched part of the predicted lines of a view that has enough of them, 0..1.
    """

    visible: int
    matched: int
    log_likelihood: float
    explained: float
    weakest_view: float

    def is_sufficient(self, settings: LocalizationSettings = DEFAULT.localization) -> bool:
        """Whether the pose can be accepted.

        Enough lines must be matched, in every view, and the segments be explained, or else the log likelihood be so
        large that the model may lack much of what is seen.
        """
        fraction = self.matched / max(self.visible, 1)
        is_sure = (self.log_likelihood >= settings.sure_log_likelihood
                   and self.matched >= settings.sure_matched_fraction * self.visible)
        is_explained = self.explained >= max(settings.min_explained_fraction, settings.min_fraction_sum - fraction)
        return (self.matched >= settings.min_matched_lines
                and self.matched >= settings.min_matched_fraction * self.visible
                and self.weakest_view >= settings.min_view_fraction and (is_explained or is_sure))

    def __str__(self) -> str:
        return (f"{self.matched} of {self.visible} model lines that should be seen from there are in the pictures,"
                f" and {self.explained:.0%} of what is seen is in the model")


def compute_pose_likelihood(
    robot: RobotModel, views: Sequence[CameraView], world_from_now: Pose2, settings: Settings = DEFAULT
) -> PoseLikelihood:
    """Compute the likelihood of the robot's pose now by all views."""
    tuning = settings.localization
    visible = matched = 0
    terms, weakest, lengths, explained = [0.0], 1.0, 0.0, 0.0
    for view in views:
        then = view.pose_then(world_from_now)
        lines = predict_lines(robot, then, settings.verification).lines_world
        projected = _project(robot, lines, [then, *_displace(then, tuning)])
        agreement = compute_agreement(projected[0], view.segments_px, projected[1:], settings.verification)
        visible, matched = visible + agreement.visible, matched + agreement.matched
        terms.append(compute_log_ratio(agreement.matched, agreement.visible, agreement.chance, tuning))
        if agreement.visible >= tuning.min_view_lines:
            weakest = min(weakest, agreement.matched / agreement.visible)
        length, part = _explain(robot, view, then, settings)
        lengths, explained = lengths + length, explained + part
    part = explained / lengths if lengths > 0.0 else 0.0
    return PoseLikelihood(visible, matched, math.fsum(terms), part, weakest)


def compute_log_ratio(
    matched: int, visible: int, chance: float, settings: LocalizationSettings = DEFAULT.localization
) -> float:
    """Compute the tempered log likelihood ratio of so many matched lines at the right pose and at a wrong one."""
    p, rate = min(max(chance, settings.min_chance), settings.max_chance), settings.detection_rate
    found, missed = math.log(rate / p), math.log((1.0 - rate) / (1.0 - p))
    return settings.line_independence * (matched * found + (visible - matched) * missed)


def _project(robot: RobotModel, lines_world: Floats, poses: Sequence[Pose2]) -> Floats:
    """(p, m, 2, 2) the lines as seen from each pose, NaN where not in view [px]."""
    lines_camera = np.array([robot.camera_from_world(pose).apply(lines_world) for pose in poses])
    seen, _ = robot.camera.project_segments(lines_camera.reshape(-1, 2, 3), Pose.identity())
    return np.asarray(seen.reshape(len(poses), len(lines_world), 2, 2))


def _displace(pose: Pose2, settings: LocalizationSettings) -> list[Pose2]:
    """Sixteen wrong poses around a pose: four directions, two distances, two turns."""
    shifts = [(by * x, by * y) for by in (settings.displacement_m, 2.0 * settings.displacement_m)
              for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    return [pose @ Pose2(x, y, turn) for x, y in shifts for turn in (-settings.displacement_rad,
                                                                     settings.displacement_rad)]


def _explain(robot: RobotModel, view: CameraView, then: Pose2, settings: Settings) -> tuple[float, float]:
    """Length of the long segments, and of the part of them that lies on model lines, also on faint ones [px]."""
    tuning = settings.localization
    length = np.linalg.norm(view.segments_px[:, 1] - view.segments_px[:, 0], axis=1)
    long = length >= tuning.min_explained_length_px
    if not np.any(long):
        return 0.0, 0.0
    shown = visible_lines(
        robot.world, robot.camera, robot.camera_from_world(then), min_length_px=tuning.min_explaining_length_px,
        min_contrast=tuning.min_explaining_contrast, min_separation_px=0.0)
    covered = compute_coverage(
        view.segments_px[long], shown.segments_px, tuning.explained_tolerance_px,
        settings.verification.line_tolerance_rad, settings.verification)
    return float(np.sum(length[long])), float(np.sum(length[long] * covered))
