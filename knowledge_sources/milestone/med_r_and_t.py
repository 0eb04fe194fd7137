"""Med-R-and-T (§6.2.4): the robot's pose from line matches with outliers, by least median of squares."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, View, Watch
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.calibration import (
    add_yaw,
    compute_camera_covariance,
    compute_knocked_covariance,
    find_model_evidence,
    has_counted,
    is_model_doubted,
    is_strange,
    loosen,
    to_tuples,
    widen,
)
from knowledge_sources.methods.features import SIGMA_ACROSS_PX
from knowledge_sources.methods.localization import CAMERA_LINE_SIGMA_PX, MIN_CAMERA_LINES
from knowledge_sources.methods.pose import (
    CameraEstimate,
    PlanarEstimate,
    Rests,
    compute_protection,
    estimate_camera_and_pose,
    planar_from_lines,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, find_camera, find_difference, find_robot, name_model, tell_time_s
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.model_errors import INEXACT_M, LineErrors
from world_models.entries import CameraState, Difference, Evidence, LineMatch, Milestone, PoseFix
from world_models.frames import Pose2, frozen
from world_models.robot import RobotModel

Matched = tuple[Entry[LineMatch], Entry[Milestone]]
PUT_DOWN = "command"
"""Basis of a belief that nothing has moved since the robot was put down."""


class MedRAndT(RobotKnowledgeSource):
    """Solves for the pose on the floor, and names the pairs that are outliers.

    The mounting of the camera is known (§3.2), so three of the six unknowns of §6.2 are left. Subsets of lines propose
    poses, the median residual of all lines chooses one, and the inliers refine it. How well the camera is known is
    known too: what the lines say of it, but for what the model's errors may have done, is posted with the pose, and its
    uncertainty is part of the pose's covariance. Whether the model is inexact where it does not say so is weighed
    against a camera that is otherwise. Where it likely is, or is stated to be, its errors are integrated out, and
    nothing is learnt of the camera.
    """

    level, priority = Level.PLAN, Priority.SEE
    on = (Watch(LineMatch, (Posted,)),)
    needs = (HELD,)
    writes = (PoseFix, Evidence)

    def bind(self, view: View, trigger: Change) -> Matched | None:
        """The lines that were matched, and the milestone that expected them."""
        milestone = view.get(trigger.entry.value.milestone)
        return None if milestone is None else (trigger.entry, milestone)

    def act(self, view: View, case: Matched) -> Iterable[Effect]:
        (match, milestone), belief = case, HELD.of(view)
        m, camera = milestone.value, find_camera(view)
        robot, here = belief.robot, belief.pose
        prior, known = loosen(belief.covariance), compute_camera_covariance(camera)
        if match.value.is_camera_open:
            opened = compute_knocked_covariance(camera)
            prior, known = add_yaw(prior, opened, known), opened
        errors = m.errors.take(match.value.pairs[:, 0])
        evidence, is_doubted = self._weigh_model(view, match, camera, here, prior, errors)
        if is_doubted:
            errors = errors.restate(INEXACT_M)
        learnt = self._learn(robot, match.value, here, prior, known, errors) if errors.is_exact else None
        moves = learnt is not None and (
            match.value.is_camera_open or not has_counted(camera, learnt.world_from_robot))
        if learnt is not None and moves:
            robot = find_robot(view, camera.moved(tuple(learnt.step.tolist()))).on_floor_of(belief.locale)
        found = self._solve(robot, match.value, here, prior, m, errors)
        covariance = found.covariance
        learnt = learnt and replace(learnt, covariance=widen(learnt, here, belief.covariance))
        if learnt is not None:
            spread = learnt.covariance if moves else known
            covariance = covariance + learnt.pose_slopes @ spread @ learnt.pose_slopes.T
        moved, near = learnt if moves else None, np.asarray(found.inliers, bool)
        rests = Rests(
            match.value.lines_world[near], match.value.segments_px[near],
            [m.landmarks[m.landmark_of[i]] for i in match.value.pairs[near, 0]], robot.camera, robot.mount,
            np.zeros(len(known)) if moved is None else moved.step, here, belief.covariance,
            None if belief.value.basis == PUT_DOWN else prior, known,
            excess=(belief.value.excess_m, belief.value.excess_rad),
            walls=errors.take(np.flatnonzero(near)).list_walls())
        because = match, milestone, belief.entry, *view.where(Difference, lambda d: d.about == name_model(view))
        yield Post(
            PoseFix(
                match.id, found.world_from_robot, frozen(covariance), near, frozen(found.residuals_px),
                tuple(reason or "" for reason in found.rejected),
                () if moved is None else tuple(moved.step.tolist()),
                () if moved is None else to_tuples(moved.covariance),
                0.0 if moved is None else moved.prior_chi2,
                compute_protection(found.world_from_robot, covariance, rests),
            ),
            because,
        )
        if evidence is not None:
            yield Post(evidence, because)

    def _weigh_model(
        self, view: View, match: Entry[LineMatch], camera: CameraState, here: Pose2, prior: Floats, errors: LineErrors
    ) -> tuple[Evidence | None, bool]:
        """What is new of whether the model is inexact, where it is not stated, and whether it likely is."""
        is_found = HELD.of(view).world.root_frame().is_inexact  # then what acquits it is told, too
        if match.value.is_camera_open or len(match.value.pairs) < MIN_CAMERA_LINES or not (is_found or errors.is_exact):
            return None, False
        known = find_difference(view, name_model(view))
        evidence = find_model_evidence(match.value.lines_world, match.value.segments_px, errors, camera, here, prior,
                                       tell_time_s(view), known.about)
        if not (is_found or known.counted or is_strange(evidence)):
            return None, False
        return evidence, is_model_doubted((*known.counted, evidence))

    def _learn(
        self, robot: RobotModel, match: LineMatch, here: Pose2, prior: Floats, known: Floats, errors: LineErrors
    ) -> CameraEstimate | None:
        """The camera's state; None where the lines say too little."""
        if len(match.pairs) < MIN_CAMERA_LINES:
            return None
        found = estimate_camera_and_pose(
            match.lines_world, match.segments_px, robot.camera, robot.mount, here, prior, known,
            sigma_px=CAMERA_LINE_SIGMA_PX, errors=errors)
        return found if np.count_nonzero(found.inliers) >= MIN_CAMERA_LINES else None

    def _solve(
        self, robot: RobotModel, match: LineMatch, here: Pose2, prior: Floats, milestone: Milestone,
        errors: LineErrors,
    ) -> PlanarEstimate:
        """The pose with a camera that is taken as it is."""
        return planar_from_lines(
            match.lines_world, match.segments_px, robot.camera, robot.mount.camera_from_robot, here,
            prior_covariance=prior,
            landmark_ids=[milestone.landmark_of[i] for i in match.pairs[:, 0]],
            sigma_px=SIGMA_ACROSS_PX,
            errors=errors,
        )
