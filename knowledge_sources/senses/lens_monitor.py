"""Lens monitor (§3.2): lines that fit a pose, but bend as another lens, focal length, mounting or wall has it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from blackboard import Change, Effect, Level, Post, Posted, View, Watch, rule
from knowledge_sources.methods.calibration import (
    MIN_MOVE_M,
    MIN_TURN_RAD,
    SeenLines,
    compute_camera_covariance,
    explain,
    open_rivals,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import CAMERA, HELD, is_worth_telling
from world_models.building.locale_frame import FrameRequest
from world_models.entries import Evidence, PoseFix

ABOUT = "camera"


def find_bent(view: View, trigger: Change) -> Post | None:
    """What is not as expected of a fix; None where all is. Looks from other places or in other directions add up.

    Where the model is inexact they tell nothing.
    """
    entry, fix = trigger.entry, trigger.entry.value
    match = view.get(fix.match)
    milestone = None if match is None else view.get(match.value.milestone)
    if match is None or milestone is None or milestone.value.is_inexact:
        return None
    m, pairs = milestone.value, match.value
    robot, known = HELD.of(view).robot, compute_camera_covariance(CAMERA.of(view).value)
    names = [m.landmarks[m.landmark_of[line]] for line in pairs.pairs[:, 0]]
    explained = explain(open_rivals(SeenLines(
        pairs.lines_world, pairs.segments_px, names, fix.world_from_robot, robot.camera, robot.mount,
        np.array(fix.camera_step or (0.0,) * len(known)), known)))
    if not is_worth_telling(view, ABOUT, explained):
        return None
    segments, there = view.get(pairs.segments), fix.world_from_robot
    frame = None if segments is None else view.get(segments.value.frame)
    shows = f"how {len(names)} lines lie beside where {entry.id} has them"
    told = Evidence(ABOUT, shows, explained, there.x_m, there.y_m, there.heading_rad, MIN_MOVE_M, MIN_TURN_RAD,
                    0.0 if frame is None else frame.value.sim_time_s)
    return Post(told, (entry, match, milestone))


@rule(on=Watch(PoseFix, (Posted,)), writes=(Evidence, FrameRequest), needs=(HELD, CAMERA),
      bind=find_bent, priority=Priority.ENTER, level=Level.PLAN)
def lens_monitor(_view: View, case: Post) -> Iterable[Effect]:
    """Says what the residuals of a pose fix tell of the camera, before the fix is judged."""
    yield case
