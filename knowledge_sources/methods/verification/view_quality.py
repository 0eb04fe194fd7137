"""Which view tells a place best, and what should be seen in it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features import SIGMA_ACROSS_PX
from knowledge_sources.methods.verification.line_check import (
    ViewQuality,
    compute_view_quality,
    find_errors,
    predict_lines,
)
from knowledge_sources.methods.verification.predicted_colors import predict_face_colors
from world_models.building.model_errors import MEASURED_M, pack_errors
from world_models.entries import Milestone
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import VisibleLines

MAX_EXPECTED_LINES = 60  # most lines that one milestone expects
LOOK_TURNS_RAD = tuple(math.radians(a) for a in (30, -30, 60, -60, 90, -90, 135, -135, 180))
"""Turns from the present heading that are tried for a better view, in this order."""
MAX_COUNTED_LENGTH_PX = 120.0  # a line longer than this is no clearer than one of this length
MAX_COUNTED_CONTRAST = 0.3  # a line of more contrast than this is no clearer than one of this contrast
MAX_SIGMA_PART = 0.3  # a view is good if it tells the place to this part of the subgoal's tolerance
MAX_SIGMA_RAD = math.radians(0.25)  # a view is good if it tells the heading to this standard deviation
MIN_LINES = 10  # fewest lines of a good view
CHECK_TOLERANCE_M = 0.1  # tolerance that a view is chosen by where no subgoal states one
MIN_LOOK_DIFFERENCE_RAD = math.radians(20.0)  # looks whose directions differ by less show much the same


def turn_headings(pose: Pose2) -> list[float]:
    """The headings that are tried for a better view [rad, world]."""
    return [wrap_angle(pose.heading_rad + turn) for turn in LOOK_TURNS_RAD]


def find_untried(headings: Iterable[float], tried: Sequence[float]) -> list[float]:
    """The headings whose views differ from those that were tried."""
    least = MIN_LOOK_DIFFERENCE_RAD
    return [h for h in headings if all(abs(wrap_angle(h - other)) > least for other in tried)]


def list_seen_locales(robot: RobotModel, pose: Pose2, locale: str) -> set[str]:
    """A locale, and those of the landmarks that should be seen from a pose."""
    lines = predict_lines(robot, pose)
    marks = [lines.marks[int(i)] for i in np.unique(lines.landmark)]
    return {locale, *(name for mark in marks for name in (mark.locale, mark.neighbour) if name)}



def choose_heading(
    robot: RobotModel, pose: Pose2, headings: Iterable[float], tolerance_m: float, car: str = "",
) -> float:
    """The first heading whose view is good enough for a tolerance, else the best one [rad, world]."""
    rated: list[tuple[ViewQuality, float]] = []
    for heading in headings:
        quality = _compute_quality(robot, Pose2(pose.x_m, pose.y_m, heading), car)
        if is_good_view(quality, tolerance_m):
            return heading
        rated.append((quality, heading))
    best = min(range(len(rated)), key=lambda i: (rated[i][0].lines < MIN_LINES, rated[i][0].sigma_m, i))
    return rated[best][1]


def is_good_view(quality: ViewQuality, tolerance_m: float) -> bool:
    """Whether a view tells place and heading well enough for a tolerance, by enough lines."""
    sharp = quality.sigma_m <= MAX_SIGMA_PART * tolerance_m and quality.sigma_rad <= MAX_SIGMA_RAD
    return sharp and quality.lines >= MIN_LINES


def predict_milestone(
    robot: RobotModel, pose: Pose2, milestone: Milestone, car: str = ""
) -> Milestone:
    """The milestone with the lines and colours that should be seen from a pose, without those of ``car``."""
    lines = _predict_clear_lines(robot, pose, car)
    marks = sorted({int(i) for i in lines.landmark})
    errors = find_errors(robot, lines, MEASURED_M)
    return replace(
        milestone,
        landmarks=tuple(lines.marks[i].name for i in marks),
        expected=_to_tuples(lines.lines_world),
        expected_px=_to_tuples(lines.segments_px),
        landmark_of=tuple(marks.index(int(i)) for i in lines.landmark),
        face_colors=predict_face_colors(robot, pose),
        displacement_modes=errors.displacement_modes,
        displacements=pack_errors(errors),
        status="expected",
    )


def _compute_quality(robot: RobotModel, pose: Pose2, car: str) -> ViewQuality:
    lines = _predict_clear_lines(robot, pose, car)
    return compute_view_quality(
        lines.lines_world, robot.camera, robot.mount.camera_from_robot, pose, SIGMA_ACROSS_PX)


def _predict_clear_lines(robot: RobotModel, pose: Pose2, car: str) -> VisibleLines:
    """The clearest lines that should be seen from a pose, long ones with contrast, without those of ``car``."""
    lines = predict_lines(robot, pose)
    if car:
        marks = [lines.marks[int(i)] for i in lines.landmark]
        lines = lines[np.array([car not in (mark.locale, mark.neighbour) for mark in marks], bool)]
    if len(lines) <= MAX_EXPECTED_LINES:
        return lines
    lengths = np.linalg.norm(lines.segments_px[:, 1] - lines.segments_px[:, 0], axis=1)
    clear = np.minimum(lengths, MAX_COUNTED_LENGTH_PX) * np.minimum(lines.contrast, MAX_COUNTED_CONTRAST)
    return lines[np.sort(np.argsort(-clear, kind="stable")[:MAX_EXPECTED_LINES])]


def _to_tuples(array: NDArray[np.float64]) -> tuple[tuple[tuple[float, ...], ...], ...]:
    return tuple(tuple(map(tuple, line)) for line in array.tolist())
