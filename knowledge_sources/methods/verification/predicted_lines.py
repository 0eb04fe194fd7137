"""The model lines that should be visible from a pose of the robot."""

from __future__ import annotations

from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.verification import VerificationSettings
from world_models.building.model_errors import LineErrors, find_line_errors
from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import VisibleLines, visible_lines


def predict_lines(
    robot: RobotModel, world_from_robot: Pose2, settings: VerificationSettings = DEFAULT.verification
) -> VisibleLines:
    """Predict the model lines that are long, clear and near enough to be looked for from a pose."""
    return visible_lines(
        robot.world, robot.camera, robot.camera_from_world(world_from_robot),
        min_length_px=settings.min_line_length_px, min_contrast=settings.min_line_contrast,
        max_distance_m=settings.max_line_distance_m,
    )


def find_errors(robot: RobotModel, lines: VisibleLines) -> LineErrors:
    """How well the model knows lines that it predicts."""
    return find_line_errors(robot.world, [lines.marks[int(i)] for i in lines.landmark], lines.line.tolist())
