"""Relocalizer (§2, §4): goal-level servoing."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard.board import View
from blackboard.change import Change, Watch
from blackboard.effect import Effect
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from world_models.location import Hypothesis
from world_models.robot import RobotModel


class Relocalizer(KnowledgeSource):
    """To be written."""

    level = Level.GOAL
    closes = Level.GOAL
    watches = (Watch(Discrepancy, where=lambda d: d.is_open and d.level is Level.GOAL),)
    writes = (Hypothesis,)

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot

    def rate(self, view: View, trigger: Change) -> float | None:
        return None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        return ()
