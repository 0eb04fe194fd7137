"""Prober (§2, §4): the motion after which a lost robot's next picture tells most."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Level, Post, Posted, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import LOST, SOUND, WHILE_LOST
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import MotorCommand, PlaceSearch


class Prober(RobotKnowledgeSource):
    """Carries out the turn or short safe move by which the candidates' views are expected to differ most."""

    level = closes = Level.GOAL
    priority = Priority.RECOVER
    on = (Watch(PlaceSearch, (Posted,), lambda search: search.status == "probe" and search.probe is not None),)
    needs = (*WHILE_LOST, SOUND)
    writes = (MotorCommand,)

    def act(self, view: View, case: Change) -> Iterable[Effect]:
        s, (turn_rad, move_m) = self._settings.action, case.entry.value.probe or (0.0, 0.0)
        slowly = s.creep_speed_m_per_s if s.keeps_to_seen_floor and move_m > 0.0 else None  # no floor is known free
        yield Post(MotorCommand(turn_rad, move_m, slowly), (case.entry, LOST.of(view)))
