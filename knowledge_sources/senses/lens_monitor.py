"""Lens monitor (§3.2): lines that fit a pose, but bend as another lens, focal length, mounting or wall has it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, View, Watch
from knowledge_sources.methods.calibration import (
    MIN_MOVE_M,
    MIN_TURN_RAD,
    SeenLines,
    compute_camera_covariance,
    explain,
    open_rivals,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import CAMERA, HELD
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import SENSES, Difference, Evidence, LineMatch, Milestone, PoseFix

ABOUT = "camera"
WORTH_TELLING = 2.0
"""Below this log ratio of a sense everything is as expected; once something was not, that is told too."""


class Case(NamedTuple):
    """A pose fix, and the match and the milestone that it rests on."""

    fix: Entry[PoseFix]
    match: Entry[LineMatch]
    milestone: Entry[Milestone]


class LensMonitor(RobotKnowledgeSource):
    """Says what the residuals of a pose fix tell of the camera, before the fix is judged.

    Looks from other places or in other directions add up. Where the model is inexact they tell nothing.
    """

    level, priority = Level.PLAN, Priority.ENTER
    on = (Watch(PoseFix, (Posted,)),)
    needs = (HELD, CAMERA)
    writes = (Evidence,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        match = view.get(trigger.entry.value.match)
        milestone = None if match is None else view.get(match.value.milestone)
        if match is None or milestone is None or milestone.value.displacement_modes:
            return None
        return Case(trigger.entry, match, milestone)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        fix, match, m = case.fix.value, case.match.value, case.milestone.value
        robot, known = HELD.of(view).robot, compute_camera_covariance(CAMERA.of(view).value)
        names = [m.landmarks[m.landmark_of[line]] for line in match.pairs[:, 0]]
        step = np.array(fix.camera_step or (0.0,) * len(known))
        opened = open_rivals(SeenLines(match.lines_world, match.segments_px, names, fix.world_from_robot, robot.camera,
                                  robot.mount, step, known))
        explained = explain(opened)
        is_open = view.latest(Difference, lambda d: d.about == ABOUT) is not None
        if explained and (is_open or any(e.log_ratio > WORTH_TELLING for e in explained if e.kind in SENSES)):
            segments = view.get(match.segments)
            frame = None if segments is None else view.get(segments.value.frame)
            there, seen_s = fix.world_from_robot, 0.0 if frame is None else frame.value.sim_time_s
            shows = f"how {len(names)} lines lie beside where {case.fix.id} has them"
            yield Post(Evidence(ABOUT, shows, explained, there.x_m, there.y_m, there.heading_rad, MIN_MOVE_M,
                                MIN_TURN_RAD, seen_s), (case.fix, case.match, case.milestone))
