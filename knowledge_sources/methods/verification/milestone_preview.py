"""A milestone before it is seen: how certain can it become, and does another place of its locale look like it?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.verification.color_check import predict_color_check
from knowledge_sources.methods.verification.line_check import check_lines
from knowledge_sources.methods.verification.pose_confidence import POSE_CONFIDENCE
from knowledge_sources.methods.verification.pose_evidence import compute_evidence
from knowledge_sources.methods.verification.predicted_colors import predict_face_colors
from knowledge_sources.methods.verification.predicted_lines import predict_lines
from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.verification import VerificationSettings
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel


def predict_p_false(
    robot: RobotModel, pose: Pose2, lines_world: Floats, covariance: Floats,
    settings: VerificationSettings = DEFAULT.verification,
) -> float:
    """Predict the probability of a wrong pose if lines (m, 2, 3) and colors are all seen where they are expected.

    ``covariance`` (3, 3) over (x, y, heading) [world] is that of the fix, and of the belief.
    """
    projected = robot.camera.project_segments(lines_world, robot.camera_from_world(pose))[0]
    projected = projected[np.isfinite(projected).all(axis=(1, 2))]
    lines = check_lines(robot, lines_world, projected, pose, settings)
    colors = predict_color_check(predict_face_colors(robot, pose, settings), settings)
    return POSE_CONFIDENCE.p_false(compute_evidence(
        robot, lines_world, projected, pose, covariance, pose, covariance, lines, colors, settings))


def find_alias(
    robot: RobotModel, locale: str, pose: Pose2, lines_world: Floats,
    settings: VerificationSettings = DEFAULT.verification,
) -> Pose2 | None:
    """Find another pose in the same locale from which the model looks the same; None if there is none."""
    colors = _get_colors(robot, pose, settings)
    for other in _repeat(robot, locale, pose):
        segments = predict_lines(robot, other, settings).segments_px
        if check_lines(robot, lines_world, segments, pose, settings).coverage >= settings.alias_min_coverage:
            there = _get_colors(robot, other, settings)
            difference = np.abs(colors[:, None] - there[None]).max(axis=2).min(axis=1, initial=1.0)
            if np.mean(difference <= settings.max_color_difference) >= settings.alias_min_colors:
                return other
    return None


def _get_colors(robot: RobotModel, pose: Pose2, settings: VerificationSettings) -> Floats:
    """(n, 3) of the faces in view."""
    return np.array([color for color, _ in predict_face_colors(robot, pose, settings)]).reshape(-1, 3)


def _repeat(robot: RobotModel, locale: str, pose: Pose2) -> Iterator[Pose2]:
    """Poses where a locale may repeat itself: turned by half a turn, and at each other of its doors."""
    corners = robot.world.outline(locale)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    yield Pose2(2.0 * float(middle[0]) - pose.x_m, 2.0 * float(middle[1]) - pose.y_m,
                wrap_angle(pose.heading_rad + np.pi))
    doors = [doorway.pose_from(locale) for doorway in robot.world.doorways_of(locale)]
    if doors:
        nearest = min(doors, key=pose.distance_to)
        own = nearest.inverse() @ pose
        yield from (door @ own for door in doors if door is not nearest)
