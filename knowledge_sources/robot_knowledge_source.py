"""RobotKnowledgeSource: what the knowledge sources of a robot have in common."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

from blackboard.board import View
from blackboard.change import Change
from blackboard.effect import Effect
from blackboard.knowledge_source import KnowledgeSource
from knowledge_sources.settings import DEFAULT, Settings
from world_models.building.locale_frame import FrameRequest


class RobotKnowledgeSource(KnowledgeSource):
    """A knowledge source of a robot: it has its settings, and reads everything else from the view.

    The building and the robot are entries too (:mod:`knowledge_sources.questions`). Where a locale frame is missing the
    act is broken off, asks for it, and comes again when it is there; so each may write a FrameRequest.
    """

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if FrameRequest not in cls.writes:
            cls.writes = (*cls.writes, FrameRequest)

    def __init__(self, settings: Settings = DEFAULT) -> None:
        self._settings = settings


class OlderSource(RobotKnowledgeSource):
    """One that judges and answers a trigger without binding what it found between the two."""

    writes: ClassVar[tuple[type[Any], ...]] = ()

    def bind(self, view: View, trigger: Change) -> tuple[Change, float] | None:
        rating = self.judge(view, trigger)
        return None if rating is None else (trigger, rating)

    def rate(self, case: tuple[Change, float]) -> float:
        return case[1]

    def act(self, view: View, case: tuple[Change, float]) -> Iterable[Effect]:
        return self.answer(view, case[0])

    def judge(self, view: View, trigger: Change) -> float | None:
        return self.priority

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        raise NotImplementedError
