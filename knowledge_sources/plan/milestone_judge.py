"""Milestone judge (§4, §6): verified, refuted or not testable, with the evidence."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.methods.localization.aliasing import find_strongest_alias
from knowledge_sources.methods.verification.color_check import ColorCheck, check_colors, decode_small_color
from knowledge_sources.methods.verification.line_check import LineCheck, check_lines
from knowledge_sources.methods.verification.pose_confidence import POSE_CONFIDENCE
from knowledge_sources.methods.verification.pose_evidence import compute_evidence, compute_motion_tolerance_px
from knowledge_sources.methods.verification.predicted_lines import predict_lines
from knowledge_sources.questions import has_followed, held, open_discrepancy, standing_in
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import DEFAULT
from knowledge_sources.tolerances import FLOOR_PX, PLAN_PX
from world_models.entries.body import Frame
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import LineMatch, PoseFix, Segments
from world_models.entries.task import Certificate, Milestone
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

WRONG_BEFORE, WRONG_UNFOLLOWED = 0.05, 0.12
"""Where nothing is in doubt, a belief is taken to be wrong with this probability before the robot looks: if landmarks
were followed up to here, and if none were."""
DARK = 6.0
"""A frame of less contrast (standard deviation of its grey values) shows nothing."""


MOST_LOOKS = 3
"""From so many directions a milestone is looked for before it counts against the belief that it cannot be told."""
AS_MUCH, AS_LIKELY = 0.8, 0.3
"""Another place of which this part of the agreement is seen is not ruled out. Of those for which another one was not,
three in ten were wrong, as counted where half of all are (``harvey experiment milestones``, 993 of 10,289 cases).
"""

UNMISTAKABLE, CLEAR, LEAST_MARGIN = 2e-4, 2e-3, 1.0
"""Less likely to be wrong than the first, a place is not compared with others; than the second, only with those at
which its room repeats itself; else with wherever in its room the picture fits. At least so many lines must speak for it
that the others do not have."""
Floats = NDArray[np.float64]


class MilestoneJudge(RobotKnowledgeSource):
    """Certifies a milestone from a pose fix, and posts by how much what was expected and what was seen differ.

    Lines and the colours of faces speak for the pose
    (:class:`knowledge_sources.methods.verification.pose_evidence.PoseEvidence`); what they are worth was counted on
    rendered floors. A deviation may be as large as the wheels are known to err since the belief was sure; where
    something happened that they do not explain, as large as the matcher looks (§6.1.4).
    """

    level = Level.PLAN
    watches = (Watch(PoseFix, (Posted,)),)
    writes = (Certificate, Milestone, Discrepancy)

    def rate(self, view: View, trigger: Change) -> float | None:
        return 0.8 if _milestone_of(view, trigger.entry.value) is not None else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        fix, milestone = trigger.entry, _milestone_of(view, trigger.entry.value)
        if milestone is None:
            return
        certificate = self._certificate(view, fix, milestone)
        verdict = Post(certificate, (fix, milestone))
        yield verdict
        yield Revise(milestone, replace(milestone.value, status=certificate.verdict), (verdict,))
        c = certificate
        if _may_look_again(c, milestone.value):
            return
        magnitude = c.deviation_px if c.verdict == "verified" or c.deviation_px > PLAN_PX else math.inf
        what = f"{milestone.value.what.partition(', because')[0]} is {c.verdict}"
        found = Discrepancy(Level.PLAN, what, magnitude, (0.0, PLAN_PX), "px")
        last = open_discrepancy(view, Level.PLAN)
        yield Post(found, (verdict,)) if last is None else Revise(last, found, (verdict,))

    def _certificate(self, view: View, fix: Entry[PoseFix], milestone: Entry[Milestone]) -> Certificate:
        match: LineMatch = view[fix.value.match].value
        segments: Segments = view[match.segments].value
        m, pose, belief = milestone.value, fix.value.world_from_robot, held(view)
        robot = self._robot if belief is None else standing_in(view, self._robot, belief.value.locale)
        before = pose if belief is None else belief.value.world_from_robot(robot.world)
        spread = fix.value.covariance if belief is None else belief.value.covariance_world(robot.world)
        lines = np.array(m.expected, float).reshape(-1, 2, 3)
        agreed = check_lines(robot, lines, segments.segments_px, pose)
        frame: Frame = view[segments.frame].value
        faces = check_colors(robot, pose, decode_small_color(frame.jpeg), m.looks)
        told = compute_evidence(
            robot, lines, segments.segments_px, pose, fix.value.covariance, before, spread, agreed, faces)
        p_false = POSE_CONFIDENCE.p_false(told)
        tolerance_px = FLOOR_PX + compute_motion_tolerance_px(robot, lines, before, spread + fix.value.covariance)
        in_doubt, followed = open_discrepancy(view, Level.PLAN) is not None, has_followed(view)
        sure = POSE_CONFIDENCE.accepts(p_false)  # so much agrees only at the right place, whatever the wheels did
        if sure or in_doubt or tolerance_px > PLAN_PX:
            tolerance_px = PLAN_PX
        wrong_before = 0.5 if in_doubt else WRONG_BEFORE if followed else WRONG_UNFOLLOWED
        is_enough = POSE_CONFIDENCE.accepts(p_false, wrong_before)
        shift_px = _median_shift(np.array(m.expected_px, float).reshape(-1, 2, 2), agreed.projected_px)
        verdict, reason = _verdict(
            len(lines), segments.contrast, agreed, faces, p_false, is_enough, shift_px, tolerance_px)
        if verdict == "verified" and belief is not None:
            other, room = _as_likely(view, robot, before, pose, segments, agreed), belief.value.locale
            elsewhere = ""
            if other is not None:
                elsewhere = f"as much agrees at {other.id}"
            elif (p_false > UNMISTAKABLE and (in_doubt or not followed)
                  and _may_be_elsewhere(robot, segments.segments_px, room, pose, p_false)):
                elsewhere = f"it may be another door of {room}, or its other side"
            if elsewhere:
                verdict, reason, p_false = "not testable", f"{reason}; but {elsewhere}", max(p_false, AS_LIKELY)
        residuals = fix.value.residuals_px[fix.value.inliers]
        return Certificate(
            milestone=milestone.id,
            fix=fix.id,
            verdict=verdict,
            reason=reason,
            expected=len(lines),
            matched=len(np.unique(match.pairs[:, 0])),
            inliers=int(np.count_nonzero(fix.value.inliers)),
            coverage=agreed.coverage,
            residual_px=float(np.sqrt(np.mean(residuals**2))) if len(residuals) else math.inf,
            deviation_m=pose.distance_to(before),
            deviation_rad=wrap_angle(pose.heading_rad - before.heading_rad),
            deviation_px=shift_px,
            tolerance_px=tolerance_px,
            p_false=p_false,
            faces=faces.count,
            faces_alike=faces.agreeing,
        )


def _may_look_again(certificate: Certificate, milestone: Milestone) -> bool:
    """Whether another view may tell what this one could not."""
    return certificate.verdict == "not testable" and len(milestone.tried) + 1 < MOST_LOOKS


def _milestone_of(view: View, fix: PoseFix) -> Entry[Milestone] | None:
    match = view.get(fix.match)
    milestone = None if match is None else view.get(match.value.milestone)
    return milestone if milestone is not None and milestone.value.status == "expected" else None


def _verdict(
    expected: int, contrast: float, agreed: LineCheck, faces: ColorCheck, p_false: float, is_enough: bool,
    shift_px: float, tolerance_px: float,
) -> tuple[str, str]:
    a = agreed.agreement
    if contrast < DARK:
        return "not testable", f"the frame is dark (contrast {contrast:.1f} of 255)"
    if expected < DEFAULT.verification.min_matched_lines:
        return "not testable", f"only {expected} lines are expected in this view"
    colours = f" and {round(faces.agreeing * faces.count)} of {faces.count} faces' colours" if faces.is_testable else ""
    found = f"{a.matched} of {a.visible} lines, {agreed.coverage:.0%} of their length,{colours} accounted for"
    if p_false >= POSE_CONFIDENCE.refute:
        return "refuted", f"{found}; at a wrong place {a.chance:.0%} are by chance"
    where = f"{found}, {shift_px:.1f} px from where expected"
    if not is_enough or a.matched < DEFAULT.verification.min_matched_lines:
        return "not testable", f"{where}: not enough to tell the place by"
    if shift_px > tolerance_px:
        return "refuted", f"{where}: more than the {tolerance_px:.0f} px that the plan may be adjusted by"
    return "verified", where


def _as_likely(
    view: View, robot: RobotModel, before: Pose2, pose: Pose2, segments: Segments, agreed: LineCheck
) -> Entry[Hypothesis] | None:
    """Another hypothesis with which the picture agrees as well, once corrected as the belief is from ``before``."""
    correction = before.inverse() @ pose
    for other in view.where(Hypothesis, lambda h: h.status == "candidate"):
        there = other.value.world_from_robot(robot.world) @ correction
        lines = predict_lines(robot, there).lines_world
        if check_lines(robot, lines, segments.segments_px, there).coverage >= AS_MUCH * agreed.coverage:
            return other
    return None


def _may_be_elsewhere(robot: RobotModel, segments_px: Floats, room: str, pose: Pose2, p_false: float) -> bool:
    """Whether what was seen may be seen, just as well, from elsewhere in the room."""
    other = find_strongest_alias(robot, segments_px, room, pose, search=p_false > CLEAR)
    return other is not None and other.margin < LEAST_MARGIN


def _median_shift(before_px: Floats, after_px: Floats) -> float:
    """Median distance of line middles before and after [px]; infinite where none is in view."""
    shift = np.linalg.norm(before_px.mean(axis=1) - after_px.mean(axis=1), axis=1)
    shift = shift[np.isfinite(shift)]
    return float(np.median(shift)) if len(shift) else math.inf
