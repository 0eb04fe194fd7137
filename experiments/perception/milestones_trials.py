"""Verdicts of the milestone judge, with the knowledge sources on a board of their own as in a mission."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from blackboard import Effect, Post, View
from experiments.perception.milestones_cases import MIN_DIFFERENCE, Case, Site, generate_cases, get_site
from harvey.runner.ports import build_scheduler
from knowledge_sources.methods.verification import Weighed
from knowledge_sources.milestone.line_finder import LineFinder
from knowledge_sources.milestone.matcher import Matcher
from knowledge_sources.milestone.med_r_and_t import MedRAndT
from knowledge_sources.milestone.milestone_judge import Case as JudgesCase
from knowledge_sources.milestone.milestone_judge import MilestoneJudge
from knowledge_sources.settings import DEFAULT
from world_models.entries import CameraPicture, Certificate, PoseFix
from world_models.frames import wrap_angle

MAX_SIGMAS, MARGIN_M, MARGIN_RAD = 3.0, 0.05, math.radians(0.6)
"""A pose is wrong if its error exceeds this many of its standard deviations plus the margin."""
BLOCK = 60
"""Cases per trial."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Cases of a floor, ``count`` from number ``first`` on; ``textured``: in a building whose finishes no plan has."""

    floor: int
    first: int
    count: int
    textured: bool = False


@dataclass(frozen=True, slots=True)
class JudgedCase:
    """One case and its verdict, in plain types.

    Attributes:
        textured: whether the building was.
        doubted: whether a second hypothesis was on the board.
        is_wrong: whether the pose is; is_same: whether wrong and believed place are indistinguishable.
        sigma_m: largest standard deviation of the position. error_m: infinite on another floor.
        evidence: of the pose (:class:`knowledge_sources.methods.verification.pose_confidence.PoseEvidence`).
    """

    floor: int
    textured: bool
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
    site = get_site(trial.floor, trial.textured)
    cases = generate_cases(trial.floor, trial.first, trial.count, trial.textured)
    out = [_judge_case(site, trial, number, case) for number, case in enumerate(cases, trial.first)]
    return TrialResult([{name: getattr(j, name) for name in JudgedCase.__slots__} for j in out])


class KeepingJudge(MilestoneJudge):
    """The milestone judge, which keeps what it weighed."""

    weighed: Weighed | None = None

    def weigh(self, view: View, case: JudgesCase) -> Weighed:
        self.weighed = super().weigh(view, case)
        return self.weighed


def certify(site: Site, case: Case) -> tuple[View, Weighed]:
    """Judge a case; returned is the board with its certificate, and what the judge weighed."""
    judge = KeepingJudge(DEFAULT)
    scheduler = build_scheduler([LineFinder(DEFAULT), Matcher(DEFAULT), MedRAndT(DEFAULT), judge], site.floor.world,
                                site.robot)
    picture = CameraPicture(case.jpeg, 0, 0.0, "milestone")
    effects: list[Effect] = [Post(case.belief), Post(case.milestone), Post(picture)]
    scheduler.post([Post(case.alternative), *effects] if case.alternative else effects, "case")
    while scheduler.view.latest(Certificate) is None:
        decision = scheduler.step()
        if decision is None or decision.refused:
            raise RuntimeError(f"expected a certificate, got {decision.refused if decision else 'stillness'}")
    assert judge.weighed is not None
    return scheduler.view, judge.weighed


def _judge_case(site: Site, trial: Trial, number: int, case: Case) -> JudgedCase:
    view, weighed = certify(site, case)
    certificate, fix = view.latest(Certificate), view.latest(PoseFix)
    assert certificate is not None and fix is not None
    c, pose, covariance = certificate.value, fix.value.world_from_robot, np.asarray(fix.value.covariance)
    sigma_m, sigma_rad = (math.sqrt(float(v)) for v in (np.linalg.eigvalsh(covariance[:2, :2])[-1], covariance[2, 2]))
    error_m = math.inf if case.is_elsewhere else pose.distance_to(case.true)
    turned = abs(wrap_angle(pose.heading_rad - case.true.heading_rad))
    return JudgedCase(
        trial.floor, trial.textured, number, case.kind, case.alternative is not None, c.verdict, c.p_false,
        error_m > MAX_SIGMAS * sigma_m + MARGIN_M or turned > MAX_SIGMAS * sigma_rad + MARGIN_RAD,
        case.kind != "right" and case.difference < MIN_DIFFERENCE, sigma_m, error_m, case.hidden, case.missing,
        case.light, weighed.evidence.values.tolist(), c.reason,
    )
