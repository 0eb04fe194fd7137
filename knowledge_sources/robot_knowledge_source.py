"""RobotKnowledgeSource: what the knowledge sources of a robot have in common."""

from __future__ import annotations

from blackboard.knowledge_source import KnowledgeSource
from knowledge_sources.settings import DEFAULT, Settings
from world_models.robot import RobotModel


class RobotKnowledgeSource(KnowledgeSource):
    """A knowledge source of a robot: beside the board it knows the robot's model and its settings, and nothing else."""

    def __init__(self, robot: RobotModel, settings: Settings = DEFAULT) -> None:
        self._robot = robot
        self._settings = settings
