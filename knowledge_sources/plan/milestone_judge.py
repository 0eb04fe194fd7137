"""Milestone judge (§4, §6): a milestone is verified, refuted or not testable, with the evidence."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from knowledge_sources.camera_knowledge import add_yaw, compute_camera_covariance, find_camera, is_camera_known
from knowledge_sources.methods.features.picture import read_picture
from knowledge_sources.methods.localization.aliasing import find_strongest_alias
from knowledge_sources.methods.verification.color_check import ColorCheck, check_colors
from knowledge_sources.methods.verification.line_check import LineCheck, check_lines, find_errors, predict_lines
from knowledge_sources.methods.verification.pose_confidence import (
    POSE_CONFIDENCE,
    compute_evidence,
    compute_motion_tolerance_px,
)
from knowledge_sources.questions import find_belief, find_robot, find_robot_in, has_followed, open_discrepancy
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.entries.body import CameraPicture
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import LineMatch, PoseFix, Segments
from world_models.entries.task import Certificate, Milestone, MilestoneVerdict
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

MIN_ALIAS_PART = 0.8  # another place at which this part of the agreement is seen is not ruled out
P_FALSE_ALIAS = 0.3
"""Probability of a wrong place where another one is not ruled out (harvey experiment milestones: 993 of 10,289
cases)."""
MAX_P_FALSE_UNMISTAKABLE = 2e-4  # up to this probability of a wrong place, it is not compared with others
MAX_P_FALSE_CLEAR = 2e-3
"""Up to this one, only with places at which the room repeats itself; beyond, with the whole room."""
MIN_ALIAS_MARGIN = 1.0  # fewest lines that must speak for the place and not for the other one

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """What a picture says of a milestone, before anything is decided.

    Attributes:
        robot: the model on the floor of the belief, behind what stands before its camera.
        room: the locale of the belief; "" where there is none.
        segments: of the picture.
        pose: as solved for; before: as believed before the look.
        expected: number of lines that should be seen.
        lines: how they agree with the segments; faces: how the faces' colours agree.
        p_false: probability that the pose is wrong, by lines and colours.
        is_enough: whether that is little enough to accept the pose.
        shift_px: median distance of the lines from where they were expected.
        tolerance_px: the largest that may be.
        is_inexact: whether the model's lines may be displaced.
        is_weak: whether what was believed before adds little: it is in doubt, leaves much open in the picture, or no
            landmarks were followed.
        camera_chi2: squared distance of the camera, as solved for, from what was believed of it.
        is_camera_known: whether the camera's mounting is known well enough for the picture to be predicted.
    """

    robot: RobotModel
    room: str
    segments: Segments
    pose: Pose2
    before: Pose2
    expected: int
    lines: LineCheck
    faces: ColorCheck
    p_false: float
    is_enough: bool
    shift_px: float
    tolerance_px: float
    is_weak: bool
    is_inexact: bool
    camera_chi2: float
    is_camera_known: bool


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is decided: ``verified``, ``refuted`` or ``not testable``, in words why, and how likely it is wrong."""

    kind: MilestoneVerdict
    reason: str
    p_false: float


class MilestoneJudge(OlderSource):
    """Certifies a milestone from a pose fix, and posts how far the picture differs from what was expected.

    The evidence are lines and the colours of faces (:mod:`knowledge_sources.methods.verification.pose_confidence`),
    weighted as fitted on rendered floors. The largest deviation is what the wheels can do since the belief was sure,
    for a place that is surely seen at least the matcher's window (§6.1.4); where the belief is in doubt, it is that
    window. Before the first milestone it is what the mission says of how the robot is put down. That landmarks were
    followed speaks for the place only where the belief leaves little open in the picture: a place one door further on
    has much the same landmarks.
    """

    level = Level.PLAN
    on = (Watch(PoseFix, (Posted,)),)
    writes = (Certificate, Milestone, Discrepancy)

    def judge(self, view: View, trigger: Change) -> float | None:
        return 0.8 if _milestone_of(view, trigger.entry.value) is not None else None

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        fix, milestone = trigger.entry, _milestone_of(view, trigger.entry.value)
        if milestone is None:
            return
        weighed = self._weigh(view, fix.value, milestone.value)
        verdict = self._decide(view, weighed)
        certificate = Post(_to_certificate(view, fix, milestone, weighed, verdict), (fix, milestone))
        yield certificate
        yield Revise(milestone, replace(milestone.value, status=verdict.kind), (certificate,))
        if self._may_look_again(verdict, milestone.value):
            return
        most_px = max(self._settings.plan.max_deviation_px, weighed.tolerance_px)
        is_measured = verdict.kind == "verified" or weighed.shift_px > most_px
        magnitude = weighed.shift_px if is_measured else math.inf
        what = f"{milestone.value.what.partition(', because')[0]} is {verdict.kind}"
        found = Discrepancy(Level.PLAN, what, magnitude, (0.0, most_px), "px")
        last = open_discrepancy(view, Level.PLAN)
        yield Post(found, (certificate,)) if last is None else Revise(last, found, (certificate,))

    def _weigh(self, view: View, fix: PoseFix, milestone: Milestone) -> Weighed:
        """Compare the lines and the colours of faces with the picture, and weigh them to a probability."""
        s = self._settings
        match: LineMatch = view[fix.match].value
        segments: Segments = view[match.segments].value
        frame: CameraPicture = view[segments.frame].value
        pose, belief = fix.world_from_robot, find_belief(view)
        camera = find_camera(view).moved(fix.camera_step) if fix.camera_step else None
        robot = find_robot(view, camera) if belief is None else find_robot_in(view, belief.value.locale, camera)
        before = pose if belief is None else belief.value.world_from_robot(robot.world)
        covariance = fix.covariance if belief is None else belief.value.covariance_world(robot.world)
        known = compute_camera_covariance(find_camera(view), s.camera_state)
        if fix.camera_step:
            covariance = add_yaw(covariance, np.array(fix.camera_covariance), known)
        lines = np.array(milestone.expected, float).reshape(-1, 2, 3)
        agreed = check_lines(robot, lines, segments.segments_px, pose, s.verification, milestone.errors, s.pose)
        plain_px = agreed.projected_px if not milestone.displacement_modes else check_lines(
            robot, lines, segments.segments_px, pose, s.verification).projected_px
        faces = check_colors(robot, pose, read_picture(frame.jpeg).quarter, milestone.face_colors, s)
        weight = compute_evidence(
            robot, lines, segments.segments_px, pose, fix.covariance, before, covariance, agreed, faces)
        p_false = POSE_CONFIDENCE.p_false(weight)
        in_doubt = open_discrepancy(view, Level.PLAN) is not None
        covariance = covariance + fix.covariance
        motion_px = compute_motion_tolerance_px(robot, lines, before, covariance, s.verification)
        followed = has_followed(view, s.action) and motion_px <= s.plan.max_followed_px
        tolerance_px = s.action.min_tolerance_px + motion_px
        is_sure = POSE_CONFIDENCE.accepts(p_false)  # so much agrees at the right place only
        expected_px = np.array(milestone.expected_px, float).reshape(-1, 2, 2)
        if camera is not None:  # how far the robot is from where it was believed, not the camera
            expected_px = robot.camera.project_segments(lines, robot.camera_from_world(before))[0]
        is_as_put_down = belief is not None and belief.value.basis == "command"
        if is_sure or in_doubt:
            most_px = s.plan.max_deviation_px
            tolerance_px = most_px if in_doubt and not is_as_put_down else max(most_px, tolerance_px)
        p_wrong = s.plan.p_wrong_followed if followed else s.plan.p_wrong_unfollowed
        p_wrong = _update(s.plan.p_wrong_in_doubt if in_doubt else p_wrong, milestone.log_odds_so_far)
        return Weighed(
            robot=robot,
            room="" if belief is None else belief.value.locale,
            segments=segments,
            pose=pose,
            before=before,
            expected=len(lines),
            lines=agreed,
            faces=faces,
            p_false=p_false,
            is_enough=POSE_CONFIDENCE.accepts(p_false, p_wrong),
            shift_px=_median_shift(expected_px, plain_px),
            tolerance_px=tolerance_px if is_as_put_down or is_sure else min(tolerance_px, s.plan.max_deviation_px),
            is_weak=in_doubt or not followed,
            is_inexact=bool(milestone.displacement_modes),
            camera_chi2=fix.camera_chi2,
            is_camera_known=is_camera_known(robot, known, s),
        )

    def _decide(self, view: View, weighed: Weighed) -> Verdict:
        """Verified, refuted or not testable; what would be verified is first held against other places."""
        kind, reason = self._first_verdict(weighed)
        elsewhere = self._elsewhere(view, weighed) if kind == "verified" and weighed.room else ""
        if elsewhere:
            p_false = max(weighed.p_false, P_FALSE_ALIAS)
            return Verdict("not testable", f"{reason}; but {elsewhere}", p_false)
        return Verdict(kind, reason, weighed.p_false)

    def _first_verdict(self, w: Weighed) -> tuple[MilestoneVerdict, str]:
        """The verdict by this place alone, and why."""
        a, faces = w.lines.agreement, w.faces
        if w.segments.contrast < self._settings.plan.min_contrast:
            return "not testable", f"the frame is dark (contrast {w.segments.contrast:.1f} of 255)"
        if w.expected < self._settings.verification.min_matched_lines:
            return "not testable", f"only {w.expected} lines are expected in this view"
        colours = f" and {round(faces.agreeing * faces.count)} of {faces.count} faces' colours" * faces.is_testable
        found = f"{a.matched} of {a.visible} lines, {w.lines.coverage:.0%} of their length,{colours} accounted for"
        if w.p_false >= POSE_CONFIDENCE.refute:
            if not w.is_camera_known:  # a place where the camera's own error hides what agrees
                return "not testable", f"{found}: the camera is not known well enough to tell"
            kind: MilestoneVerdict = "not testable" if w.is_inexact else "refuted"
            return kind, f"{found}; at a wrong place {a.chance:.0%} are by chance"
        where = f"{found}, {w.shift_px:.1f} px from where expected"
        if w.camera_chi2 > self._settings.camera_state.max_chi2:
            return "refuted", f"{where}: only with a camera that is mounted otherwise than it can be"
        if not w.is_enough or a.matched < self._settings.verification.min_matched_lines:
            return "not testable", f"{where}: not enough to tell the place by"
        if w.shift_px > w.tolerance_px:
            return "refuted", f"{where}: more than the {w.tolerance_px:.0f} px that the plan may be adjusted by"
        return "verified", where

    def _elsewhere(self, view: View, weighed: Weighed) -> str:
        """Where else the picture may have been taken, in words; "" where nowhere."""
        other = self._find_likely_hypothesis(view, weighed)
        if other is not None:
            return f"as much agrees at {other.id}"
        if weighed.p_false <= MAX_P_FALSE_UNMISTAKABLE or not weighed.is_weak:
            return ""
        alias = find_strongest_alias(weighed.robot, weighed.segments.segments_px, weighed.room, weighed.pose,
                                     search=weighed.p_false > MAX_P_FALSE_CLEAR, settings=self._settings)
        if alias is not None and alias.margin < MIN_ALIAS_MARGIN:
            return f"it may be another door of {weighed.room}, or its other side"
        return ""

    def _find_likely_hypothesis(self, view: View, weighed: Weighed) -> Entry[Hypothesis] | None:
        """A candidate with which the picture agrees as well, once it is corrected as the belief is."""
        correction = weighed.before.inverse() @ weighed.pose
        s = self._settings.verification
        least = MIN_ALIAS_PART * weighed.lines.coverage
        for other in view.where(Hypothesis, lambda h: h.status == "candidate"):
            there = other.value.world_from_robot(weighed.robot.world) @ correction
            lines = predict_lines(weighed.robot, there, s)
            found = check_lines(weighed.robot, lines.lines_world, weighed.segments.segments_px, there, s,
                                find_errors(weighed.robot, lines), self._settings.pose)
            if found.coverage >= least:
                return other
        return None

    def _may_look_again(self, verdict: Verdict, milestone: Milestone) -> bool:
        """Whether another view may tell what this one could not."""
        s = self._settings.plan
        most = s.max_inexact_looks if milestone.displacement_modes or milestone.log_odds_so_far else s.max_looks
        return verdict.kind == "not testable" and len(milestone.tried) + 1 < most


def _milestone_of(view: View, fix: PoseFix) -> Entry[Milestone] | None:
    match = view.get(fix.match)
    milestone = None if match is None else view.get(match.value.milestone)
    return milestone if milestone is not None and milestone.value.status == "expected" else None


def _to_certificate(
    view: View, fix: Entry[PoseFix], milestone: Entry[Milestone], weighed: Weighed, verdict: Verdict
) -> Certificate:
    match: LineMatch = view[fix.value.match].value
    residuals = fix.value.residuals_px[fix.value.inliers]
    return Certificate(
        milestone=milestone.id,
        fix=fix.id,
        verdict=verdict.kind,
        reason=verdict.reason,
        expected=weighed.expected,
        matched=len(np.unique(match.pairs[:, 0])),
        inliers=int(np.count_nonzero(fix.value.inliers)),
        coverage=weighed.lines.coverage,
        residual_px=float(np.sqrt(np.mean(residuals**2))) if len(residuals) else math.inf,
        deviation_m=weighed.pose.distance_to(weighed.before),
        deviation_rad=wrap_angle(weighed.pose.heading_rad - weighed.before.heading_rad),
        deviation_px=weighed.shift_px,
        tolerance_px=weighed.tolerance_px,
        p_false=verdict.p_false,
        faces=weighed.faces.count,
        faces_alike=weighed.faces.agreeing,
    )


def _update(p_wrong: float, log_odds: float) -> float:
    """The probability of a wrong place after evidence, by Bayes' rule."""
    if not log_odds:
        return p_wrong
    odds = p_wrong / (1.0 - p_wrong) * math.exp(log_odds)
    return odds / (1.0 + odds)


def _median_shift(before_px: Floats, after_px: Floats) -> float:
    """Median distance of line middles before and after [px]; infinite where none is in view."""
    shift = np.linalg.norm(before_px.mean(axis=1) - after_px.mean(axis=1), axis=1)
    shift = shift[np.isfinite(shift)]
    return float(np.median(shift)) if len(shift) else math.inf
