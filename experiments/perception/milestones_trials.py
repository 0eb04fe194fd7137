"""What the judge says in each case: the experts themselves on a board of their own, as in a mission."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from blackboard.board import View
from blackboard.effect import Effect, Post
from blackboard.scheduler import Scheduler
from experiments.perception.milestones_cases import SAME, Case, cases, site
from knowledge_sources.methods.verification.color_check import check_colors, decode_small_color
from knowledge_sources.methods.verification.line_check import check_lines
from knowledge_sources.methods.verification.pose_evidence import compute_evidence
from knowledge_sources.plan.line_finder import LineFinder
from knowledge_sources.plan.matcher import Matcher
from knowledge_sources.plan.med_r_and_t import MedRAndT
from knowledge_sources.plan.milestone_judge import MilestoneJudge
from world_models.entries.body import Frame
from world_models.entries.percepts import PoseFix, Segments
from world_models.entries.task import Certificate
from world_models.frames import wrap_angle
from world_models.robot import RobotModel

SIGMAS, FLOOR_M, FLOOR_RAD = 3.0, 0.05, math.radians(0.6)
"""A pose is wrong that is off by more than so many of its own deviations and so much more."""
BLOCK = 60
"""Cases of one floor that are done at a time."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Some cases of a floor: number ``first`` and so many more."""

    floor: int
    first: int
    count: int


@dataclass(frozen=True, slots=True)
class Judged:
    """One case and what was said of it, in plain types.

    Attributes:
        doubted: whether another hypothesis was on the board.
        is_wrong: whether the pose is; is_same: whether nobody could tell the wrong place from the believed one.
        sigma_m: the largest deviation of the pose by its covariance. error_m: infinite on another floor.
        evidence: what spoke for the pose (:class:`knowledge_sources.methods.verification.pose_evidence.PoseEvidence`).
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
    gone: float
    light: float
    evidence: list[float]
    reason: str


@dataclass(frozen=True, slots=True)
class Found:
    """What a trial found: the cases as tables."""

    judged: list[dict[str, Any]]


def judge_trial(trial: Trial) -> Found:
    """Every case of a trial."""
    robot = site(trial.floor).robot
    out = [_judged(robot, trial.floor, number, case)
           for number, case in enumerate(cases(trial.floor, trial.first, trial.count), trial.first)]
    return Found([{name: getattr(j, name) for name in Judged.__slots__} for j in out])


def certified(robot: RobotModel, case: Case) -> View:
    """The board after the experts have judged a case."""
    scheduler = Scheduler([LineFinder(robot), Matcher(robot), MedRAndT(robot), MilestoneJudge(robot)])
    told: list[Effect] = [Post(case.belief), Post(case.milestone), Post(Frame(case.jpeg, 0, 0.0, "milestone"))]
    scheduler.tell([Post(case.rival), *told] if case.rival else told, "case")
    while scheduler.view.latest(Certificate) is None:
        decision = scheduler.step()
        if decision is None or decision.refused:
            raise RuntimeError(f"expected a certificate, got {decision.refused if decision else 'stillness'}")
    return scheduler.view


def _judged(robot: RobotModel, floor: int, number: int, case: Case) -> Judged:
    view = certified(robot, case)
    certificate, fix, segments = view.latest(Certificate), view.latest(PoseFix), view.latest(Segments)
    assert certificate is not None and fix is not None and segments is not None
    c, pose, covariance = certificate.value, fix.value.world_from_robot, np.asarray(fix.value.covariance)
    lines = np.array(case.milestone.expected, float).reshape(-1, 2, 3)
    told = compute_evidence(
        robot, lines, segments.value.segments_px, pose, covariance, case.belief.world_from_robot(robot.world),
        case.belief.covariance_world(robot.world), check_lines(robot, lines, segments.value.segments_px, pose),
        check_colors(robot, pose, decode_small_color(case.jpeg), case.milestone.looks),
    )
    sigma_m, sigma_rad = (math.sqrt(float(v)) for v in (np.linalg.eigvalsh(covariance[:2, :2])[-1], covariance[2, 2]))
    error_m = math.inf if case.is_elsewhere else pose.distance_to(case.true)
    turned = abs(wrap_angle(pose.heading_rad - case.true.heading_rad))
    return Judged(
        floor, number, case.kind, case.rival is not None, c.verdict, c.p_false,
        error_m > SIGMAS * sigma_m + FLOOR_M or turned > SIGMAS * sigma_rad + FLOOR_RAD,
        case.kind != "right" and case.unlike < SAME, sigma_m, error_m, case.hidden, case.gone, case.light,
        told.values.tolist(), c.reason,
    )
