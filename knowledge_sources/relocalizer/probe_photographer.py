"""Probe photographer (§2, §4): goal-level perceptual servoing begins with a picture of where the robot stands."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revised, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import LOST, WHILE_LOST, is_dark
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Discrepancy, Hypothesis, MotionReport, PictureRequest, Segments

MAX_DARK_FRAMES = 150  # so many dark frames are taken while waiting for light


class ProbePhotographer(RobotKnowledgeSource):
    """Asks for a picture when the robot is lost and has none from where it stands, or only dark ones."""

    level = closes = Level.GOAL
    priority = Priority.RECOVER
    on = (
        Watch(Discrepancy, (Posted,), lambda d: d.is_open and d.level is Level.GOAL),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis == "odometry"),
        Watch(Segments, (Posted,), lambda s: s.milestone == ""),
    )
    needs = WHILE_LOST
    writes = (PictureRequest,)

    def bind(self, view: View, trigger: Change) -> Entry[Any] | None:
        """What makes a picture due."""
        moved = view.latest(MotionReport)
        probes = [s for s in view.since(Segments, LOST.of(view).cycle) if s.value.milestone == ""]
        since = 0 if moved is None else moved.cycle
        is_seen = any(s.cycle >= since and not is_dark(s.value) for s in probes)
        return None if is_seen or len(probes) >= MAX_DARK_FRAMES else trigger.entry

    def act(self, view: View, case: Entry[Any]) -> Iterable[Effect]:
        yield Post(PictureRequest("probe"), (case, LOST.of(view)))
