"""Matcher (§6.1): which of the segments show which of the lines that a milestone expects."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from knowledge_sources.methods.matching import match_lines
from knowledge_sources.questions import held
from world_models.frames import frozen
from world_models.percepts import LineMatch, Segments
from world_models.robot import RobotModel
from world_models.task import Milestone

PAIR_PX = (4.0, 15.0)
"""A pair may lie apart by the belief's uncertainty in the image, within these bounds [px]."""
NEAR_M = 2.0
"""The distance for which that uncertainty is taken."""


class Matcher(KnowledgeSource):
    """Matches the projected model to the data lines in the image, before any pose is solved for."""

    level = Level.PLAN
    watches = (Watch(Segments, (Posted,), lambda s: s.milestone != ""),)
    writes = (LineMatch,)

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot

    def rate(self, view: View, trigger: Change) -> float | None:
        milestone = view.get(trigger.entry.value.milestone)
        return 0.8 if milestone is not None and milestone.value.status == "expected" else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        segments, milestone = trigger.entry, view.get(trigger.entry.value.milestone)
        if milestone is None:
            return
        m: Milestone = milestone.value
        model_px = np.array(m.expected_px, float).reshape(-1, 2, 2)
        lines_world = np.array(m.expected, float).reshape(-1, 2, 3)
        data_px = segments.value.segments_px
        found = match_lines(model_px, data_px, pair_px=self._pair_px(view), objective="likelihood")
        pairs = np.asarray(found.pairs, np.int64).reshape(-1, 2)
        yield Post(
            LineMatch(
                milestone.id, segments.id, pairs, frozen(lines_world[pairs[:, 0]]), frozen(data_px[pairs[:, 1]]),
                float(found.e_match), frozen(found.coverage),
            ),
            (segments, milestone),
        )

    def _pair_px(self, view: View) -> float:
        belief = held(view)
        if belief is None:
            return PAIR_PX[1]
        spread = 2.0 * self._robot.camera.fx * belief.value.sigma_m / NEAR_M
        return float(min(max(PAIR_PX[0], spread), PAIR_PX[1]))
