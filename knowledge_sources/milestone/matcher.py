"""Matcher (§6.1): which segments show which of the lines that a milestone expects."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from blackboard import Change, Effect, Entry, Level, Post, Posted, View, Watch
from knowledge_sources.methods.belief import MAX_CAMERA_CHI2
from knowledge_sources.methods.calibration import (
    RIGID_DISTANCE_M,
    add_yaw,
    compute_camera_covariance,
    compute_knocked_covariance,
    is_camera_known,
    loosen,
)
from knowledge_sources.methods.localization import match_with_camera, rate_match
from knowledge_sources.methods.matching import Match, PoseMatch, match_lines, match_on_floor
from knowledge_sources.methods.verification import find_distinct
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, Belief, find_camera
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import LineMatch, Milestone, Segments
from world_models.frames import frozen

MIN_SHARP_PART = 0.6  # where less of the lines' length is covered sharply, the camera may have been knocked
MIN_KNOCK_GAIN = 0.15  # by so much more must be covered sharply with a camera that was knocked
MAX_RIGID_SIGMA_PX = 6.0  # up to this uncertainty lines are matched in the image (§6.1); beyond it, on the floor

Floats = NDArray[np.float64]


Expected = tuple[Entry[Segments], Entry[Milestone]]


class Matcher(RobotKnowledgeSource):
    """Matches the lines that a milestone expects to the segments of the picture.

    Search, objective and starts are §6.1's. Where the belief is sure enough, the projected model is fitted as a rigid
    figure in the image; else it is fitted by a pose on the floor near the believed one. Where the camera is not well
    known, the pose and the camera's state are fitted together. Lines in a pattern that the model lacks are not asked.
    """

    level, priority = Level.PLAN, Priority.SEE
    on = (Watch(Segments, (Posted,), lambda s: s.milestone != ""),)
    needs = (HELD,)
    writes = (LineMatch,)

    def bind(self, view: View, trigger: Change) -> Expected | None:
        """The segments of a picture, and the milestone that waits for it."""
        milestone = view.get(trigger.entry.value.milestone)
        return None if milestone is None or milestone.value.status != "expected" else (trigger.entry, milestone)

    def act(self, view: View, case: Expected) -> Iterable[Effect]:
        (segments, milestone), belief = case, HELD.of(view)
        m, data_px = milestone.value, segments.value.segments_px
        lines_world = np.array(m.expected, float).reshape(-1, 2, 3)
        expected_px = np.array(m.expected_px, float).reshape(-1, 2, 2)
        tested = np.flatnonzero(find_distinct(expected_px, data_px))
        if not len(tested):
            none = np.zeros((0, 2), np.int64)
            yield Post(LineMatch(milestone.id, segments.id, none, frozen(lines_world[:0]), frozen(data_px[:0]), 0.0,
                                 frozen(np.zeros(len(lines_world)))), (segments, milestone, belief.entry))
            return
        found, is_open = self._match(view, expected_px[tested], lines_world[tested], data_px, belief)
        pairs, coverage = np.asarray(found.pairs, np.int64).reshape(-1, 2).copy(), np.zeros(len(lines_world))
        pairs[:, 0], coverage[tested] = tested[pairs[:, 0]], found.coverage
        yield Post(
            LineMatch(
                milestone.id, segments.id, pairs, frozen(lines_world[pairs[:, 0]]), frozen(data_px[pairs[:, 1]]),
                float(found.e_match), frozen(coverage), is_open,
            ),
            (segments, milestone, belief.entry),
        )

    def _match(
        self, view: View, expected_px: Floats, lines_world: Floats, data_px: Floats, belief: Belief
    ) -> tuple[Match | PoseMatch, bool]:
        """The match, and whether it takes the camera for knocked: much more agrees with the picture then."""
        robot, camera = belief.robot, find_camera(view)
        known = compute_camera_covariance(camera)
        prior = belief.pose, belief.covariance
        given = lines_world, data_px, robot.camera, robot.mount
        if not is_camera_known(robot, known):
            return match_with_camera(*given, *prior, known).match, False
        found = rate_match(self._match_with_known_camera(expected_px, lines_world, data_px, belief), *given,
                           prior[0], loosen(prior[1]), known)
        if found.sharp_part >= MIN_SHARP_PART and found.prior_chi2 <= MAX_CAMERA_CHI2:
            return found.match, False
        opened = compute_knocked_covariance(camera)
        knocked = match_with_camera(*given, prior[0], add_yaw(prior[1], opened, known), opened)
        is_knocked = knocked.sharp_part >= found.sharp_part + MIN_KNOCK_GAIN
        return (knocked if is_knocked else found).match, is_knocked

    def _match_with_known_camera(
        self, expected_px: Floats, lines_world: Floats, data_px: Floats, belief: Belief
    ) -> Match | PoseMatch:
        robot, b = belief.robot, belief.value
        sigma_px = robot.camera.fx * math.hypot(b.sigma_rad, b.sigma_m / RIGID_DISTANCE_M)
        if sigma_px <= MAX_RIGID_SIGMA_PX:
            return match_lines(expected_px, data_px)
        return match_on_floor(
            lines_world, data_px, robot.camera, robot.mount.camera_from_robot,
            belief.pose, belief.covariance)
