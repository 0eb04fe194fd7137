"""Milestone judge (§4, §6): a milestone is verified, refuted or not testable, with the evidence."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch
from knowledge_sources.methods.calibration import add_yaw, compute_camera_covariance, is_camera_known
from knowledge_sources.methods.pose import tell_unavailable
from knowledge_sources.methods.verification import (
    Before,
    PictureEvidence,
    Verdict,
    Weighed,
    certify,
    is_last_look,
    judge_place,
    tell_odds,
    weigh_picture,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    HELD,
    find_alias,
    find_camera,
    find_followed,
    find_robot_in,
    find_search_here,
    has_only_turned,
    open_discrepancies,
)
from knowledge_sources.reads.place_believed import MAX_P_RIVAL
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import (
    ALERT_LIMIT_M,
    CameraPicture,
    Certificate,
    Difference,
    Discrepancy,
    Hypothesis,
    LineMatch,
    Milestone,
    PoseFix,
    Segments,
    Travel,
    open_or_measure,
)


class Case(NamedTuple):
    """A pose fix, and all that it rests on: the match, the segments, their frame, the milestone and the belief."""

    fix: Entry[PoseFix]
    match: Entry[LineMatch]
    segments: Entry[Segments]
    frame: Entry[CameraPicture]
    milestone: Entry[Milestone]
    belief: Entry[Hypothesis]


class MilestoneJudge(RobotKnowledgeSource):
    """Certifies a milestone from a pose fix, and posts how far the picture differs from what was expected.

    The evidence are lines and the colours of faces (:mod:`knowledge_sources.methods.verification.weigh`), weighted as
    fitted on rendered floors. The largest deviation is what the wheels can do since the belief was sure, for a place
    that is surely seen at least the matcher's window (§6.1.4); where the belief is in doubt, it is that window. Before
    the first milestone it is what the mission says of how the robot is put down. That landmarks were followed speaks
    for the place only where the belief leaves little open in the picture: one door further on it sees much the same.
    """

    level, priority = Level.PLAN, Priority.SEE
    on = (Watch(PoseFix, (Posted,)),)
    needs = (HELD,)
    writes = (Certificate, Milestone, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Case | None:
        match = view.get(trigger.entry.value.match)
        if match is None:
            return None
        milestone, segments = view.get(match.value.milestone), view.get(match.value.segments)
        frame = None if segments is None else view.get(segments.value.frame)
        if milestone is None or milestone.value.status != "expected" or segments is None or frame is None:
            return None
        return Case(trigger.entry, match, segments, frame, milestone, HELD.of(view).entry)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        milestone, weighed = case.milestone, self.weigh(view, case)
        verdict = self._hold_against_others(view, case, weighed, judge_place(weighed))
        verdict = self._hold_against_single_lies(case, weighed, verdict)
        because = (case.fix, milestone, *find_followed(view), *view.all(Travel), *view.all(Difference),
                   *open_discrepancies(view))
        certificate = Post(certify((milestone.id, case.fix.id), weighed, verdict, case.fix.value), because)
        yield certificate
        yield Revise(milestone, replace(milestone.value, status=verdict.kind), (certificate,))
        more = not is_last_look(milestone.value) or find_search_here(view, milestone.value.sketch)
        if verdict.kind == "not testable" and more:
            return
        most_px = max(self._settings.plan.max_deviation_px, weighed.tolerance_px)
        is_measured = verdict.kind == "verified" or weighed.shift_px > most_px
        magnitude = weighed.shift_px if is_measured else math.inf
        what = f"{milestone.value.what.partition(', because')[0]} is {verdict.kind}"
        found = Discrepancy(Level.PLAN, what, magnitude, (0.0, most_px), "px")
        yield open_or_measure(view, found, (certificate,))

    def weigh(self, view: View, case: Case) -> Weighed:
        """What the picture says, with the camera as it was solved for, and with what was believed before."""
        s, fix, belief, camera = self._settings, case.fix.value, case.belief.value, find_camera(view)
        robot = find_robot_in(view, belief.locale, camera.moved(fix.camera_step) if fix.camera_step else None)
        known, covariance = compute_camera_covariance(camera), belief.covariance_world(robot.world)
        if fix.camera_step:
            covariance = add_yaw(covariance, np.array(fix.camera_covariance), known)
        before = Before(
            belief.world_from_robot(robot.world), covariance,
            any(doubt.value.level is Level.PLAN for doubt in open_discrepancies(view)),
            bool(find_followed(view)), has_only_turned(view, belief), is_camera_known(robot, known))
        seen = PictureEvidence(case.frame.value.jpeg, case.segments.value, case.milestone.value, fix)
        return weigh_picture(robot, seen, before, s)

    def _hold_against_others(self, view: View, case: Case, weighed: Weighed, verdict: Verdict) -> Verdict:
        """What would be verified is not testable where it may have been taken elsewhere, or by a sense that lies."""
        if verdict.kind != "verified":
            return verdict
        wrong = view.latest(Difference, lambda d: d.p_misled > MAX_P_RIVAL)
        rival = find_alias(view, case.fix, case.belief, weighed)
        p, said, of = p_alias, *_ = (0.0, "", "") if rival is None else (rival.p, rival.said, "it is")
        if wrong is not None and (misled := wrong.value).p_misled > p:
            p, said, of = misled.p_misled, f"{misled.about} differs, {misled.odds_in_words()}", "that misleads"
        if p <= MAX_P_RIVAL:
            return verdict
        reason = f"{verdict.reason}; but {said}: {tell_odds(p, MAX_P_RIVAL, of)}"
        return Verdict("not testable", reason, p, MAX_P_RIVAL, p_alias=p_alias)

    def _hold_against_single_lies(self, case: Case, weighed: Weighed, verdict: Verdict) -> Verdict:
        """What would be verified is looked at once more where one false thing may have moved the pose too far.

        But for a last look; where the belief may be as far off, so that the pose is no worse; and while the camera is
        hardly known: it is this picture that tells of it.
        """
        protection, before_m = case.fix.value.protection, case.belief.value.protection_m
        if verdict.kind != "verified" or protection.is_available:
            return verdict
        reason = f"{verdict.reason}; but {tell_unavailable(protection)}"
        if is_last_look(case.milestone.value) or before_m > ALERT_LIMIT_M or not weighed.is_camera_known:
            return verdict._replace(reason=reason)
        return verdict._replace(kind="not testable", reason=reason)
