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
from knowledge_sources.expert import Expert
from knowledge_sources.methods.verification import LEAST_ACCOUNTED, Verification, verify
from knowledge_sources.questions import held, open_discrepancy
from knowledge_sources.tolerances import PLAN_PX
from world_models.frames import wrap_angle
from world_models.percepts import LineMatch, PoseFix, Segments
from world_models.task import Certificate, Milestone

DARK = 6.0
"""A frame of less contrast (standard deviation of its grey values) shows nothing."""


Floats = NDArray[np.float64]


class MilestoneJudge(Expert):
    """Certifies a milestone from a pose fix, and posts by how much what was expected and what was seen differ."""

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
        magnitude = c.deviation_px if c.verdict == "verified" or c.deviation_px > c.tolerance_px else math.inf
        what = f"{milestone.value.what.partition(', because')[0]} is {c.verdict}"
        found = Discrepancy(Level.PLAN, what, magnitude, (0.0, PLAN_PX), "px")
        last = open_discrepancy(view, Level.PLAN)
        yield Post(found, (verdict,)) if last is None else Revise(last, found, (verdict,))

    def _certificate(self, view: View, fix: Entry[PoseFix], milestone: Entry[Milestone]) -> Certificate:
        match: LineMatch = view[fix.value.match].value
        segments: Segments = view[match.segments].value
        m, pose = milestone.value, fix.value.world_from_robot
        lines = np.array(m.expected, float).reshape(-1, 2, 3)
        evidence = verify(self._robot, lines, segments.segments_px, pose)
        deviation_px = _median_shift(np.array(m.expected_px, float).reshape(-1, 2, 2), evidence.projected_px)
        verdict, reason = _verdict(len(lines), segments.contrast, evidence, deviation_px)
        belief = held(view)
        before = pose if belief is None else belief.value.world_from_robot(self._robot.world)
        inliers = fix.value.inliers
        residuals = fix.value.residuals_px[inliers]
        return Certificate(
            milestone=milestone.id,
            fix=fix.id,
            verdict=verdict,
            reason=reason,
            expected=len(lines),
            matched=len(np.unique(match.pairs[:, 0])),
            inliers=int(np.count_nonzero(inliers)),
            coverage=evidence.coverage,
            residual_px=float(np.sqrt(np.mean(residuals**2))) if len(residuals) else math.inf,
            deviation_m=pose.distance_to(before),
            deviation_rad=wrap_angle(pose.heading_rad - before.heading_rad),
            deviation_px=deviation_px,
            tolerance_px=PLAN_PX,
            p_false=evidence.agreement.p_false,
        )


def _milestone_of(view: View, fix: PoseFix) -> Entry[Milestone] | None:
    match = view.get(fix.match)
    milestone = None if match is None else view.get(match.value.milestone)
    return milestone if milestone is not None and milestone.value.status == "expected" else None


def _verdict(expected: int, contrast: float, evidence: Verification, deviation_px: float) -> tuple[str, str]:
    a = evidence.agreement
    if contrast < DARK:
        return "not testable", f"the frame is dark (contrast {contrast:.1f} of 255)"
    if expected < LEAST_ACCOUNTED:
        return "not testable", f"only {expected} lines are expected in this view"
    found = f"{a.accounted} of {a.seen} lines, {evidence.coverage:.0%} of their length"
    if not evidence.holds:
        return "refuted", f"{found} accounted for; at a wrong place {a.chance:.0%} are by chance"
    where = f"{found} accounted for, {deviation_px:.1f} px from where expected"
    if deviation_px > PLAN_PX:
        return "refuted", f"{where}: more than the {PLAN_PX:.0f} px that the plan may be adjusted by"
    return "verified", where


def _median_shift(before_px: Floats, after_px: Floats) -> float:
    """Median distance of line middles before and after [px]; infinite where none is in view."""
    shift = np.linalg.norm(before_px.mean(axis=1) - after_px.mean(axis=1), axis=1)
    shift = shift[np.isfinite(shift)]
    return float(np.median(shift)) if len(shift) else math.inf
