"""What a picture says of a milestone: how much agrees, how far it is from where it was expected, and what follows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import (
    MAX_CAMERA_CHI2,
    MAX_SLIP_CHI2,
    MIN_P_BELIEVED,
    SLIP_SIGMA_M,
    SLIP_SIGMA_RAD,
    Alike,
    BelievedPlace,
    Look,
    add_looks,
    to_log_odds,
    update,
)
from knowledge_sources.methods.features import MIN_CONTRAST, read_picture
from knowledge_sources.methods.verification.color_check import ColorCheck, check_colors
from knowledge_sources.methods.verification.line_check import (
    MIN_MATCHED_LINES,
    LineCheck,
    check_lines,
    find_distinct,
    find_errors,
    list_names,
    predict_lines,
    project_lines,
)
from knowledge_sources.methods.verification.pose_confidence import (
    LEAST_P_FALSE,
    MOTION_TOLERANCE_SIGMAS,
    POSE_CONFIDENCE,
    PoseEvidence,
    compute_evidence,
    compute_motion_tolerance_px,
)
from knowledge_sources.settings import Settings
from world_models.entries import Certificate, Milestone, MilestoneVerdict, PoseFix, Segments
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

P_WRONG_STANDING = 0.02
"""Prior probability of a wrong belief where the robot stands as it was put down, or found (as P_STATED has it)."""
P_WRONG_FOLLOWED = 0.05  # the same where landmarks were followed up to here
MAX_FOLLOWED_PX = 15.0
"""Where the belief leaves more than this open in the picture, followed landmarks tell of no place (half of
max_deviation_px)."""
P_WRONG_UNFOLLOWED = 0.12  # the same where no landmarks were followed
P_WRONG_IN_DOUBT = 0.5  # the same where the belief is in doubt
MAX_MILESTONE_LOOKS = 3  # a milestone is looked for from so many directions before it counts as a discrepancy
MAX_INEXACT_LOOKS = 5  # the same where the model is inexact: each look tells less
OTHER_DIRECTIONS = Alike(step_m=math.inf, turn_rad=math.radians(65.0))
"""Looks from one place are independent where they show nothing in common: about the width of a picture."""


MAX_P_UNMISTAKABLE = 2e-4  # up to it, by belief and picture, the wheels may have slipped beyond what is stated


class Before(NamedTuple):
    """What was believed before a look.

    Attributes:
        pose: world; covariance: of it, (3, 3).
        in_doubt: whether that is in doubt; has_followed: whether landmarks were followed up to here.
        stands: whether the robot stands at its prior or found place, but for turns on the spot.
        is_camera_known: whether the camera's mounting is known well enough for a picture to be predicted.
    """

    pose: Pose2
    covariance: Floats
    in_doubt: bool
    has_followed: bool
    stands: bool
    is_camera_known: bool


class PictureEvidence(NamedTuple):
    """A picture, its line segments, what was expected in it, and the pose that was solved for by them."""

    jpeg: bytes
    segments: Segments
    milestone: Milestone
    fix: PoseFix


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """What a picture says of a milestone, before anything is decided.

    Attributes:
        robot: the model on the floor of the belief, behind the occlusions of its lens.
        segments: of the picture.
        pose: as solved for; before, covariance: as believed before the look, (3, 3).
        expected: number of lines that should be seen, and tell of the place.
        patterned: number of those that lie in a pattern which the model does not have, and tell nothing.
        lines: how they agree with the segments; faces: how the faces' colours agree.
        evidence: what of that supports the pose.
        p_false: probability that the pose is wrong, by lines and colours.
        p_by_looks: the same with the looks in other directions; p_wrong: and with what was believed before.
        most_p_wrong: how much of that is accepted; where no other look is left, as much as is believed.
        shift_px: median distance of the lines from where they were expected.
        tolerance_px: the largest that may be.
        is_inexact: whether the model's lines may be displaced.
        is_weak: whether what was believed before adds little: it is in doubt, leaves much open in the picture, or no
            landmarks were followed.
        camera_chi2: squared distance of the camera, as solved for, from what was believed of it.
        is_camera_known: whether the camera's mounting is known well enough for the picture to be predicted.
    """

    robot: RobotModel
    segments: Segments
    pose: Pose2
    before: Pose2
    covariance: Floats
    expected: int
    patterned: int
    lines: LineCheck
    faces: ColorCheck
    evidence: PoseEvidence
    p_false: float
    p_by_looks: float
    p_wrong: float
    most_p_wrong: float
    shift_px: float
    tolerance_px: float
    is_weak: bool
    is_inexact: bool
    camera_chi2: float
    is_camera_known: bool


class Verdict(NamedTuple):
    """What is decided.

    Attributes:
        kind: ``verified``, ``refuted`` or ``not testable``.
        reason: in words, with the one count of lines and the bound that decided.
        p_wrong: the probability of a wrong place by which it was decided.
        most_p_wrong: what of it is accepted; of what agrees too little for any place, where refuting begins.
        p_alias: of another place at which the picture may have been taken.
    """

    kind: MilestoneVerdict
    reason: str
    p_wrong: float
    most_p_wrong: float
    p_alias: float = 0.0


def tell_odds(p: float, bound: float, of: str = "this is another place", bounds: str = "allowed {}") -> str:
    """A probability and its bound, in words: ``chance that this is another place: 2.1e-5, allowed 6.3e-3``."""
    return f"chance that {of}: {say_chance(p)}, {bounds.format(say_chance(bound))}"


def say_chance(p: float) -> str:
    """A probability to two figures: in percent from one percent on, to four figures where it is near to one."""
    if p < 0.01:
        return f"{p:.1e}".replace("e-0", "e-").replace(".0e", "e")
    return f"{100.0 * p:.{2 if p < 0.99 else 4}g}%"


def weigh_picture(robot: RobotModel, seen: PictureEvidence, before: Before, settings: Settings) -> Weighed:
    """Compare the lines and the colours of faces with the picture, and weigh them to a probability.

    ``robot``: with the camera as it was solved for, where it was.
    """
    milestone, fix, segments_px, s = seen.milestone, seen.fix, seen.segments.segments_px, settings
    lines, pose = np.array(milestone.expected, float).reshape(-1, 2, 3), fix.world_from_robot
    tested = find_distinct(project_lines(robot, lines, pose), segments_px)
    patterned = int(np.count_nonzero(~tested))
    lines, errors = lines[tested], milestone.errors.take(np.flatnonzero(tested))
    agreed = check_lines(robot, lines, segments_px, pose, errors,
                         [milestone.landmarks[i] for i in np.array(milestone.landmark_of, np.intp)[tested]])
    faces = check_colors(robot, pose, read_picture(seen.jpeg).quarter, milestone.face_colors)
    evidence = compute_evidence(pose, fix.covariance, before.pose, before.covariance, agreed, faces)
    p_false = max(POSE_CONFIDENCE.p_false(evidence), LEAST_P_FALSE)
    spread = before.covariance + fix.covariance
    motion_px = compute_motion_tolerance_px(robot, lines, before.pose, spread)
    followed = before.has_followed and motion_px <= MAX_FOLLOWED_PX
    expected_px = np.array(milestone.expected_px, float).reshape(-1, 2, 2)[tested]
    if fix.camera_step:  # how far the robot is from where it was believed, not the camera
        expected_px = robot.camera.project_segments(lines, robot.camera_from_world(before.pose))[0]
    believed = BelievedPlace(before.pose, spread, 1.0 - _find_prior(before, followed=followed))
    by_looks = _sum_log_odds(milestone) + to_log_odds(p_false)
    p_after = update(believed.compute_p_wrong(pose), by_looks)
    tolerance_px = _find_tolerance_px(before, motion_px, p_after <= POSE_CONFIDENCE.accept, s)
    if p_after <= MAX_P_UNMISTAKABLE:  # as far as what a search finds is still the place where it was tracked to
        slipped = spread + np.diag(np.square([SLIP_SIGMA_M, SLIP_SIGMA_M, SLIP_SIGMA_RAD]))
        slip_px = compute_motion_tolerance_px(robot, lines, before.pose, slipped)
        slip_px *= math.sqrt(MAX_SLIP_CHI2) / MOTION_TOLERANCE_SIGMAS
        tolerance_px = max(tolerance_px, s.action.min_tolerance_px + slip_px)
    most = 1.0 - MIN_P_BELIEVED if is_last_look(milestone) else POSE_CONFIDENCE.accept
    return Weighed(
        robot=robot,
        segments=seen.segments,
        pose=pose,
        before=before.pose,
        covariance=before.covariance,
        expected=len(lines),
        patterned=patterned,
        lines=agreed,
        faces=faces,
        evidence=evidence,
        p_false=p_false,
        p_by_looks=update(0.5, by_looks),
        p_wrong=p_after,
        most_p_wrong=most,
        shift_px=_median_shift(expected_px, agreed.projected_px),
        tolerance_px=tolerance_px,
        is_weak=before.in_doubt or not followed,
        is_inexact=milestone.is_inexact,
        camera_chi2=fix.camera_chi2,
        is_camera_known=before.is_camera_known,
    )


def _find_prior(before: Before, *, followed: bool) -> float:
    """The probability that the belief is wrong, before the look. A robot that only turned is at its prior place."""
    if before.in_doubt:
        return P_WRONG_IN_DOUBT
    if before.stands:
        return P_WRONG_STANDING
    return P_WRONG_FOLLOWED if followed else P_WRONG_UNFOLLOWED


def _sum_log_odds(milestone: Milestone) -> float:
    """The log odds of a wrong place by the views in other directions: what they add to this one."""
    looks = [Look(Pose2(0.0, 0.0, along), odds)
             for along, odds in zip(milestone.tried, milestone.log_odds_so_far, strict=True)]
    return add_looks(looks, OTHER_DIRECTIONS, (Pose2(0.0, 0.0, milestone.look_heading_rad),))


def _find_tolerance_px(before: Before, motion_px: float, is_sure: bool, settings: Settings) -> float:
    """How far the lines may be from where they were expected [px]; ``is_sure``: of the place, belief and picture."""
    tolerance_px, most_px = settings.action.min_tolerance_px + motion_px, settings.plan.max_deviation_px
    if is_sure or before.in_doubt:
        tolerance_px = most_px if before.in_doubt and not before.stands else max(most_px, tolerance_px)
    return tolerance_px if before.stands or is_sure else min(tolerance_px, most_px)


def judge_place(w: Weighed) -> Verdict:
    """The verdict by this place alone, and why."""
    a, faces, odds = w.lines.agreement, w.faces, (w.p_wrong, w.most_p_wrong)
    least = MIN_MATCHED_LINES
    if w.segments.contrast < MIN_CONTRAST:
        return Verdict("not testable", f"the frame is dark (contrast {w.segments.contrast:.1f} of 255)", *odds)
    others = f"; {w.patterned} more in a pattern" * (w.patterned > 0)
    if w.expected < least:
        few = f"{a.visible} lines are in this view, and fewer than {least} do not tell{others}"
        return Verdict("not testable", few, *odds)
    colours = f" and {round(faces.agreeing * faces.count)} of {faces.count} faces' colours" * faces.is_testable
    found = f"{a.matched} of {a.visible} lines, {w.lines.coverage:.0%} of their length,{colours} accounted for{others}"
    if w.p_by_looks >= POSE_CONFIDENCE.refute:
        odds = w.p_by_looks, POSE_CONFIDENCE.refute
        if not w.is_camera_known:  # a place where the camera's own error hides what agrees
            return Verdict("not testable", f"{found}: the camera is not known well enough to tell", *odds)
        kind: MilestoneVerdict = "not testable" if w.is_inexact else "refuted"
        return Verdict(kind, f"{found}: {tell_odds(*odds, bounds='refuted from {} on')}", *odds)
    where = f"{found}, {w.shift_px:.1f} px from where expected"
    if w.camera_chi2 > MAX_CAMERA_CHI2:
        return Verdict("refuted", f"{where}: only with a camera that is mounted differently than it can be", *odds)
    if w.p_wrong > w.most_p_wrong:
        return Verdict("not testable", f"{where}: not enough to tell the place by: {tell_odds(*odds)}", *odds)
    if a.matched < least:
        return Verdict("not testable", f"{where}: not enough to tell the place by: fewer than {least} lines", *odds)
    if w.shift_px > w.tolerance_px:
        most = f"more than the {w.tolerance_px:.0f} px that the plan may be adjusted by"
        return Verdict("refuted", f"{where}: {most}", *odds)
    return Verdict("verified", f"{where}: {tell_odds(*odds)}", *odds)


def is_last_look(milestone: Milestone) -> bool:
    """Whether so many views were tried that no other one may be."""
    most = MAX_INEXACT_LOOKS if milestone.is_inexact else MAX_MILESTONE_LOOKS
    return len(milestone.tried) + 1 >= most


def compute_coverage_elsewhere(w: Weighed, there: Pose2) -> float:
    """The part of the lines' length that the picture shows of what should be seen at another place, so corrected."""
    corrected = there @ (w.before.inverse() @ w.pose)
    lines = predict_lines(w.robot, corrected)
    return check_lines(w.robot, lines.lines_world, w.segments.segments_px, corrected,
                       find_errors(w.robot, lines), list_names(lines)).coverage


def certify(names: tuple[str, str], w: Weighed, verdict: Verdict, fix: PoseFix) -> Certificate:
    """The certificate of a verdict; ``names``: of the milestone and of the pose fix on the board."""
    residuals = fix.residuals_px[fix.inliers]
    return Certificate(
        milestone=names[0],
        fix=names[1],
        verdict=verdict.kind,
        reason=verdict.reason,
        expected=w.lines.agreement.visible,
        matched=w.lines.agreement.matched,
        inliers=int(np.count_nonzero(fix.inliers)),
        coverage=w.lines.coverage,
        residual_px=float(np.sqrt(np.mean(residuals**2))) if len(residuals) else math.inf,
        deviation_m=w.pose.distance_to(w.before),
        deviation_rad=wrap_angle(w.pose.heading_rad - w.before.heading_rad),
        deviation_px=w.shift_px,
        tolerance_px=w.tolerance_px,
        p_false=max(w.p_false, verdict.p_alias),
        p_wrong=verdict.p_wrong,
        most_p_wrong=verdict.most_p_wrong,
        faces=w.faces.count,
        faces_agreeing=w.faces.agreeing,
    )


def _median_shift(before_px: Floats, after_px: Floats) -> float:
    """Median distance of line middles before and after [px]; infinite where none is in view."""
    shift = np.linalg.norm(before_px.mean(axis=1) - after_px.mean(axis=1), axis=1)
    shift = shift[np.isfinite(shift)]
    return float(np.median(shift)) if len(shift) else math.inf
