"""Before it is seen: how surely could a milestone be told at best, and does another place of the building look like it?
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.verification.color_check import predict_color_check, predict_face_colors
from knowledge_sources.methods.verification.line_check import check_lines
from knowledge_sources.methods.verification.pose_confidence import POSE_CONFIDENCE
from knowledge_sources.methods.verification.pose_evidence import compute_evidence
from world_models.building.locales import Doorway
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_lines

Floats = NDArray[np.float64]
LENGTH_PX, CONTRAST, SIGHT_M = 12.0, 0.05, 15.0
AS_MUCH = 0.8
"""Another place from which this part of the lines lies where it is expected looks like it, if the colours do too."""
COLOURS, SAME_COLOUR = 0.8, 0.08
"""And this part of the colours, which are the same where they differ by no more, 0..1."""


def predict_p_false(robot: RobotModel, pose: Pose2, lines_world: Floats, covariance: Floats) -> float:
    """The probability of a wrong pose that would be stated if everything were seen where it is expected."""
    shown = robot.camera.project_segments(lines_world, robot.camera_from_world(pose))[0]
    shown = shown[np.isfinite(shown).all(axis=(1, 2))]
    agreed = check_lines(robot, lines_world, shown, pose)
    colors = predict_color_check(predict_face_colors(robot, pose))
    return POSE_CONFIDENCE.p_false(
        compute_evidence(robot, lines_world, shown, pose, covariance, pose, covariance, agreed, colors))


def find_alias(robot: RobotModel, locale: str, pose: Pose2, lines_world: Floats) -> Pose2 | None:
    """Another place of the same locale from which the model looks as it does from here; None where there is none."""
    colours = _colours(robot, pose)
    for there in _alike(robot, locale, pose):
        seen = visible_lines(robot.world, robot.camera, robot.camera_from_world(there), min_length_px=LENGTH_PX,
                             min_contrast=CONTRAST, max_distance_m=SIGHT_M).segments_px
        if check_lines(robot, lines_world, seen, pose).coverage >= AS_MUCH:
            apart = np.abs(colours[:, None] - _colours(robot, there)[None]).max(axis=2).min(axis=1, initial=1.0)
            if np.mean(apart <= SAME_COLOUR) >= COLOURS:
                return there
    return None


def _colours(robot: RobotModel, pose: Pose2) -> Floats:
    """(n, 3) of the faces in view."""
    return np.array([colour for colour, _ in predict_face_colors(robot, pose)]).reshape(-1, 3)


def _alike(robot: RobotModel, locale: str, pose: Pose2) -> Iterator[Pose2]:
    """Where a locale may repeat itself: turned half round about its middle, and as far from each other of its doors."""
    corners = robot.world.outline(locale)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    yield Pose2(2.0 * float(middle[0]) - pose.x_m, 2.0 * float(middle[1]) - pose.y_m,
                wrap_angle(pose.heading_rad + np.pi))
    doors = [_frame(doorway, locale) for doorway in robot.world.doorways_of(locale)]
    if doors:
        nearest = min(doors, key=pose.distance_to)
        own = nearest.inverse() @ pose
        yield from (door @ own for door in doors if door is not nearest)


def _frame(doorway: Doorway, locale: str) -> Pose2:
    """In the middle of a doorway, looking out of the locale."""
    x, y = doorway.threshold_of(locale).mean(axis=0)
    ahead = doorway.outward_from(locale)
    return Pose2(float(x), float(y), float(np.arctan2(ahead[1], ahead[0])))
