"""Matcher (§6.1): which segments show which of the lines that a milestone expects."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post
from blackboard.level import Level
from knowledge_sources.camera_knowledge import compute_camera_covariance, compute_camera_px, find_camera
from knowledge_sources.methods.localization.camera_matching import match_with_camera
from knowledge_sources.methods.matching import FloorMatch, Match, PoseMatch, match_lines, match_on_floor
from knowledge_sources.methods.pose.displacements import compute_sigmas_px, fit_displacements
from knowledge_sources.questions import find_belief, find_robot
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import LineMatch, Segments
from world_models.entries.task import Milestone
from world_models.frames import frozen
from world_models.robot import RobotModel

Floats = NDArray[np.float64]


class Matcher(RobotKnowledgeSource):
    """Matches the lines that a milestone expects to the segments of the picture.

    Search, objective and starts are §6.1's. Where the belief is sure enough, the projected model is fitted as a rigid
    figure in the image; else it is fitted by a pose on the floor near the believed one. Where the camera is not well
    known, the pose and the camera's state are fitted together.
    """

    level = Level.PLAN
    watches = (Watch(Segments, (Posted,), lambda s: s.milestone != ""),)
    writes = (LineMatch,)

    def rate(self, view: View, trigger: Change) -> float | None:
        milestone = view.get(trigger.entry.value.milestone)
        return 0.8 if milestone is not None and milestone.value.status == "expected" and find_belief(view) else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        segments, belief = trigger.entry, find_belief(view)
        milestone = view[segments.value.milestone]
        if belief is None:
            return
        m: Milestone = milestone.value
        lines_world = np.array(m.expected, float).reshape(-1, 2, 3)
        data_px = segments.value.segments_px
        if not len(lines_world):
            none = np.zeros((0, 2), np.int64)
            yield Post(LineMatch(milestone.id, segments.id, none, frozen(lines_world), frozen(data_px[:0]), 0.0,
                                 frozen(np.zeros(0))), (segments, milestone, belief))
            return
        camera = compute_camera_covariance(find_camera(view), self._settings.camera_state)
        if m.modes:
            found: Match | PoseMatch = self._match_displaced(find_robot(view), m, lines_world, data_px, belief.value)
        else:
            found = self._match(find_robot(view), m, lines_world, data_px, belief.value, camera)
        pairs = np.asarray(found.pairs, np.int64).reshape(-1, 2)
        yield Post(
            LineMatch(
                milestone.id, segments.id, pairs, frozen(lines_world[pairs[:, 0]]), frozen(data_px[pairs[:, 1]]),
                float(found.e_match), frozen(found.coverage),
            ),
            (segments, milestone, belief),
        )

    def _match(
        self, robot: RobotModel, milestone: Milestone, lines_world: Floats, data_px: Floats, belief: Hypothesis,
        camera_covariance: Floats,
    ) -> Match | PoseMatch:
        s = self._settings.plan
        there = robot.on_floor_of(belief.locale)
        if (compute_camera_px(robot.camera, camera_covariance, s.rigid_distance_m)
                > self._settings.camera_state.max_known_px):
            return match_with_camera(
                lines_world, data_px, robot.camera, there.mount, belief.world_from_robot(robot.world),
                belief.covariance_world(robot.world), camera_covariance, self._settings)
        sigma_px = robot.camera.fx * math.hypot(belief.sigma_rad, belief.sigma_m / s.rigid_distance_m)
        if sigma_px <= s.max_rigid_sigma_px:
            model_px = np.array(milestone.expected_px, float).reshape(-1, 2, 2)
            return match_lines(model_px, data_px, self._settings.matching)
        return match_on_floor(
            lines_world, data_px, robot.camera, there.mount.camera_from_robot,
            belief.world_from_robot(robot.world), belief.covariance_world(robot.world),
            self._settings.matching,
        )

    def _match_displaced(
        self, robot: RobotModel, milestone: Milestone, lines_world: Floats, data_px: Floats, belief: Hypothesis
    ) -> FloorMatch:
        """As :meth:`_match`, of a model that is inexact: wider first, then with its lines displaced as one."""
        s, errors = self._settings, milestone.errors
        mount, camera = robot.on_floor_of(belief.locale).mount.camera_from_robot, robot.camera
        prior, covariance = belief.world_from_robot(robot.world), belief.covariance_world(robot.world)
        wide_px = float(np.median(compute_sigmas_px(lines_world, errors, camera, mount, prior)))
        wider = replace(
            s.matching, max_pose_pair_px=s.matching.max_pose_pair_px + s.pose.displaced_gate_sigmas * wide_px,
            pose_sigma_px=math.hypot(s.matching.pose_sigma_px, wide_px), gate_px=s.matching.gate_px + wide_px)
        found = match_on_floor(lines_world, data_px, camera, mount, prior, covariance, wider)
        fit = fit_displacements(
            lines_world, errors, data_px, camera, mount, found.world_from_robot, covariance, s.pose)
        return replace(found, pairs=fit.pairs)
