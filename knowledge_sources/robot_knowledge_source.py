"""RobotKnowledgeSource: what the knowledge sources of a robot have in common."""

from __future__ import annotations

from blackboard.knowledge_source import KnowledgeSource
from world_models.robot import RobotModel


class RobotKnowledgeSource(KnowledgeSource):
    """A knowledge source that knows, beside the board, what the robot knows of itself and its world; nothing else."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
