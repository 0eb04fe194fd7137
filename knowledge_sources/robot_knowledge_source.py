"""RobotKnowledgeSource: what the knowledge sources of a robot have in common."""

from __future__ import annotations

from typing import Any

from blackboard import KnowledgeSource
from knowledge_sources.settings import DEFAULT, Settings
from world_models.building.locale_frame import FrameRequest


class RobotKnowledgeSource(KnowledgeSource):
    """A knowledge source of a robot: it has its settings, and reads everything else from the view.

    The building and the robot are entries too (:mod:`knowledge_sources.reads.questions`). Where a locale frame is
    missing the act is broken off, asks for it, and comes again when it is there; so each may write a FrameRequest.
    """

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if FrameRequest not in cls.writes:
            cls.writes = (*cls.writes, FrameRequest)

    def __init__(self, settings: Settings = DEFAULT) -> None:
        self._settings = settings
