"""The model lines that should be visible from a pose."""

from __future__ import annotations

from world_models.frames import Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import VisibleLines, visible_lines


def predict_lines(robot: RobotModel, world_from_robot: Pose2) -> VisibleLines:
    """Predict the model lines that are long, clear and near enough to be looked for from a pose."""
    return visible_lines(robot.world, robot.camera, robot.camera_from_world(world_from_robot), min_length_px=12.0,
                         min_contrast=0.05, max_distance_m=15.0)
