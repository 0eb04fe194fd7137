"""Verdicts of the milestone judge, with the knowledge sources on a board of their own as in a mission."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from blackboard.board import View
from blackboard.effect import Effect, Post
from experiments.perception.milestones_cases import MIN_DIFFERENCE, Case, Site, generate_cases, get_site
from harvey.runner.world_port import build_scheduler
from knowledge_sources.methods.features.picture import read_picture
from knowledge_sources.methods.verification.color_check import check_colors
from knowledge_sources.methods.verification.line_check import check_lines
from knowledge_sources.methods.verification.pose_confidence import compute_evidence
from knowledge_sources.plan.line_finder import LineFinder
from knowledge_sources.plan.matcher import Matcher
from knowledge_sources.plan.med_r_and_t import MedRAndT
from knowledge_sources.plan.milestone_judge import MilestoneJudge
from knowledge_sources.settings import DEFAULT
from world_models.entries.body import CameraPicture
from world_models.entries.percepts import PoseFix, Segments
from world_models.entries.task import Certificate
from world_models.frames import wrap_angle

MAX_SIGMAS, MARGIN_M, MARGIN_RAD = 3.0, 0.05, math.radians(0.6)
"""A pose is wrong if its error exceeds this many of its standard deviations plus the margin."""
BLOCK = 60
"""Cases per trial."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Cases of a floor, ``count`` from number ``first`` on."""

    floor: int
    first: int
    count: int


@dataclass(frozen=True, slots=True)
class JudgedCase:
    """One case and its verdict, in plain types.

    Attributes:
        doubted: whether a second hypothesis was on the board.
        is_wrong: whether the pose is; is_same: whether wrong and believed place are indistinguishable.
        sigma_m: largest standard deviation of the position. error_m: infinite on another floor.
        evidence: of the pose (:class:`knowledge_sources.methods.verification.pose_confidence.PoseEvidence`).
    """

    floor: int
    number: int
    kind: str
    doubted: bool
    verdict: str
    p_false: float
    is_wrong: bool
    is_same: bool
    sigma_m: float
    error_m: float
    hidden: float
    missing: float
    light: float
    evidence: list[float]
    reason: str


@dataclass(frozen=True, slots=True)
class TrialResult:
    """The cases of a trial as tables."""

    judged: list[dict[str, Any]]


def judge_trial(trial: Trial) -> TrialResult:
    """Judge every case of a trial."""
    site = get_site(trial.floor)
    cases = generate_cases(trial.floor, trial.first, trial.count)
    out = [_judge_case(site, trial.floor, number, case) for number, case in enumerate(cases, trial.first)]
    return TrialResult([{name: getattr(j, name) for name in JudgedCase.__slots__} for j in out])


def certify(site: Site, case: Case) -> View:
    """Judge a case; returned is the board with its certificate."""
    sources = [LineFinder(DEFAULT), Matcher(DEFAULT), MedRAndT(DEFAULT), MilestoneJudge(DEFAULT)]
    scheduler = build_scheduler(sources, site.floor.world, site.robot)
    picture = CameraPicture(case.jpeg, 0, 0.0, "milestone")
    effects: list[Effect] = [Post(case.belief), Post(case.milestone), Post(picture)]
    scheduler.post([Post(case.alternative), *effects] if case.alternative else effects, "case")
    while scheduler.view.latest(Certificate) is None:
        decision = scheduler.step()
        if decision is None or decision.refused:
            raise RuntimeError(f"expected a certificate, got {decision.refused if decision else 'stillness'}")
    return scheduler.view


def _judge_case(site: Site, floor: int, number: int, case: Case) -> JudgedCase:
    robot, view = site.robot, certify(site, case)
    certificate, fix, segments = view.latest(Certificate), view.latest(PoseFix), view.latest(Segments)
    assert certificate is not None and fix is not None and segments is not None
    c, pose, covariance = certificate.value, fix.value.world_from_robot, np.asarray(fix.value.covariance)
    lines = np.array(case.milestone.expected, float).reshape(-1, 2, 3)
    evidence = compute_evidence(
        robot, lines, segments.value.segments_px, pose, covariance, case.belief.world_from_robot(robot.world),
        case.belief.covariance_world(robot.world), check_lines(
            robot, lines, segments.value.segments_px, pose, errors=case.milestone.errors),
        check_colors(robot, pose, read_picture(case.jpeg).quarter, case.milestone.face_colors),
    )
    sigma_m, sigma_rad = (math.sqrt(float(v)) for v in (np.linalg.eigvalsh(covariance[:2, :2])[-1], covariance[2, 2]))
    error_m = math.inf if case.is_elsewhere else pose.distance_to(case.true)
    turned = abs(wrap_angle(pose.heading_rad - case.true.heading_rad))
    return JudgedCase(
        floor, number, case.kind, case.alternative is not None, c.verdict, c.p_false,
        error_m > MAX_SIGMAS * sigma_m + MARGIN_M or turned > MAX_SIGMAS * sigma_rad + MARGIN_RAD,
        case.kind != "right" and case.difference < MIN_DIFFERENCE, sigma_m, error_m, case.hidden, case.missing,
        case.light, evidence.values.tolist(), c.reason,
    )
